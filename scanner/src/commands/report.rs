//! `scan-product report`: what a build said about its model, for people.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, bail};
use reconstruct::report::Report;

use crate::cli::{DONE, NO_GOOD_SCAN};
use crate::report_words;
use crate::ui::Ui;

/// A report is small; more is no report.
const MAX_BYTES: u64 = 64 << 20;

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Exit status 1 where the scan gave no model: the report says why and what to do.

Examples:
  scan-product report out
  scan-product report out --json      report.json itself")]
pub struct Args {
    /// Folder that `scan-product build` wrote, or its report.json
    pub out: PathBuf,
}

/// Prints the report.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let path = if args.out.is_dir() { args.out.join("report.json") } else { args.out.clone() };
    let shown = path.display();
    let length = fs::metadata(&path)
        .with_context(|| format!("no report in {shown}; run `scan-product build` first"))?
        .len();
    if length > MAX_BYTES {
        bail!("{shown} is too large for a report");
    }
    let bytes = fs::read(&path).with_context(|| format!("cannot read {shown}"))?;
    let report: Report = serde_json::from_slice(&bytes)
        .with_context(|| format!("{shown} is no report of scan-product; build the recording again"))?;
    ui.result(&report_words::in_words(&report), &serde_json::to_value(&report)?);
    Ok(if report.points == 0 { NO_GOOD_SCAN } else { DONE })
}
