//! The scanner's `report.json`: what the listing shows of it, checked.

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use crate::error::{Error, Result};
use crate::model::{ScanInfo, Verdict, Word};

/// Largest side of a product, metres.
const MAX_SIDE_METRES: f64 = 100.0;
const MAX_VIEWS: usize = 10_000;
const MAX_WARNINGS: usize = 50;
const MAX_TEXT: usize = 500;

#[derive(Deserialize)]
struct Report {
    version: u32,
    #[serde(default)]
    views: Vec<View>,
    dimensions_m: Option<[f64; 3]>,
    dimensions_uncertainty_m: Option<[f64; 3]>,
    #[serde(default)]
    warnings: Vec<String>,
    verdict: Option<String>,
    software: Option<String>,
}

#[derive(Deserialize)]
struct View {
    used: bool,
}

/// What the listing shows, and the report to keep: the same JSON without what makes it long.
pub(super) fn read(path: &Path) -> Result<(ScanInfo, Vec<u8>)> {
    let bytes = std::fs::read(path)?;
    let value: Value = serde_json::from_slice(&bytes).map_err(bad)?;
    let report: Report = serde_json::from_value(value.clone()).map_err(bad)?;
    if report.version != 1 {
        return Err(bad(format!("version {} is not known here; version 1 is", report.version)));
    }
    let info = ScanInfo {
        dimensions_m: report.dimensions_m.map(|d| lengths("dimensions_m", d)).transpose()?,
        dimensions_uncertainty_m: report
            .dimensions_uncertainty_m
            .map(|d| lengths("dimensions_uncertainty_m", d))
            .transpose()?,
        verdict: report.verdict.as_deref().map(verdict).transpose()?,
        views_used: report.views.iter().filter(|view| view.used).count() as u64,
        views_total: at_most("views", report.views.len(), MAX_VIEWS)? as u64,
        warnings: report.warnings.iter().take(MAX_WARNINGS).map(|text| shortened(text)).collect(),
        software: report.software.as_deref().map(shortened),
    };
    Ok((info, serde_json::to_vec(&value).map_err(Error::internal)?))
}

fn bad(what: impl std::fmt::Display) -> Error {
    let detail = format!("The report cannot be used: {what}. Send the report.json that scan-product wrote.");
    Error::unprocessable("bad_report", detail)
}

fn lengths(field: &str, values: [f64; 3]) -> Result<[f64; 3]> {
    if values.iter().all(|v| (0.0..=MAX_SIDE_METRES).contains(v)) {
        Ok(values)
    } else {
        Err(bad(format!("{field} must be three lengths of 0 to {MAX_SIDE_METRES} m")))
    }
}

fn verdict(word: &str) -> Result<Verdict> {
    Verdict::from_word(word).ok_or_else(|| bad("verdict must be good, acceptable or poor"))
}

fn at_most(field: &str, count: usize, most: usize) -> Result<usize> {
    if count <= most { Ok(count) } else { Err(bad(format!("{field} has more than {most} entries"))) }
}

fn shortened(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(MAX_TEXT).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(json: &str) -> Result<ScanInfo> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), json).unwrap();
        read(file.path()).map(|(info, _)| info)
    }

    #[test]
    fn what_the_listing_shows() {
        let info = check(
            r#"{"version": 1, "views": [{"name": "000", "used": true}, {"name": "001", "used": false, "reason": "knocked"}],
                "dimensions_m": [0.1, 0.2, 0.3], "verdict": "good", "warnings": ["<b>dark</b>"], "software": "0.1.0"}"#,
        )
        .unwrap();
        assert_eq!((info.views_used, info.views_total), (1, 2));
        assert_eq!(info.verdict, Some(Verdict::Good));
        assert_eq!(info.warnings, ["<b>dark</b>"]);
    }

    #[test]
    fn what_is_no_report_is_refused() {
        for json in [
            "",
            "[]",
            r#"{"version": 2}"#,
            r#"{"version": 1, "dimensions_m": [1e400, 0, 0]}"#,
            r#"{"version": 1, "dimensions_m": [-1, 0, 0]}"#,
            r#"{"version": 1, "dimensions_m": [0, 0]}"#,
            r#"{"version": 1, "verdict": "superb"}"#,
        ] {
            assert!(check(json).is_err(), "{json}");
        }
        let deep = "[".repeat(100_000);
        assert!(check(&deep).is_err());
    }
}
