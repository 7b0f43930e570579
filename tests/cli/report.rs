//! `scan-product report`: a built model in words, and what is no report.

use std::fs;

use super::support::{mug_model, scan};

#[test]
fn a_model_is_told_in_words() {
    let folder = mug_model();
    let said = scan(["report", folder.to_str().unwrap()]).with_status(0).out;
    for words in
        ["scan: ", "length", "height", "measured", "invented", "coverage", "Views: ", "Depth calibrated"]
    {
        assert!(said.contains(words), "{words} is missing in {said}");
    }
    let machine = scan(["report", folder.to_str().unwrap(), "--json"]).with_status(0).out;
    let machine: serde_json::Value = serde_json::from_str(&machine).unwrap();
    let surface = &machine["surface"];
    assert!(surface["coverage_percent"].as_f64().unwrap() > 50.0, "{surface}");
    assert!(!surface["holes"].as_array().unwrap().is_empty(), "{surface}");
}

#[test]
fn what_is_no_report_is_named() {
    let home = tempfile::tempdir().unwrap();
    let ran = scan(["report", home.path().to_str().unwrap()]).with_status(2);
    assert!(ran.err.contains("run `scan-product build` first"), "{}", ran.err);
    fs::write(home.path().join("report.json"), "{}").unwrap();
    let ran = scan(["report", home.path().to_str().unwrap()]).with_status(2);
    assert!(ran.err.contains("no report of scan-product"), "{}", ran.err);
}
