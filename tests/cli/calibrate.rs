//! A sensor is calibrated once, and every later recording of it is the truer for it.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::support::{Broken, Ran, clean, names, program, simulated};

/// The program with a place of its own for calibrations.
fn scan_with(calibrations: &Path, arguments: &[&str]) -> Ran {
    let mut command = clean(std::process::Command::new(program()));
    command.env("SCAN_CALIBRATION_DIR", calibrations).args(arguments).output().unwrap().into()
}

/// Depth reads 1.5 % long; ten views from near and far.
fn on_the_board() -> PathBuf {
    simulated(
        "to-calibrate",
        &[
            "--product",
            "bowl",
            "--views",
            "10",
            "--frames",
            "2",
            "--scale-error",
            "0.015",
            "--seed",
            "4",
            "--distances",
            "0.55,0.7,0.9,1.15",
            "--elevations",
            "60,35",
        ],
    )
}

fn longest_side(report: &Value) -> f64 {
    let sides = report["dimensions_m"].as_array().unwrap();
    sides.iter().map(|v| v.as_f64().unwrap()).fold(0.0, f64::max)
}

#[test]
fn a_calibrated_sensor_measures_right_without_a_board() {
    let home = tempfile::tempdir().unwrap();
    let rec = on_the_board();
    let kept = scan_with(home.path(), &["calibrate", rec.to_str().unwrap(), "--json"]).with_status(0);
    let kept = serde_json::from_str::<Value>(&kept.out).unwrap();
    let scale = 1.0 / (1.0 + kept["calibration"]["coefficients"][0].as_f64().unwrap());
    // The scale alone is one term of several; what counts is the error on the board.
    let [before, after] = [0, 1].map(|i| kept["calibration"]["error_mm"][i].as_f64().unwrap());
    assert!(before > 6.0 && after.abs() < 0.5, "{before} mm before, {after} mm after, scale {scale}");
    assert_eq!(names(home.path()), ["simulated-seed-4.json"]);

    let free = simulated(
        "calibrated-free",
        &["--product", "camera", "--no-board", "--views", "12", "--scale-error", "0.015", "--seed", "4"],
    );
    let size = |more: &[&str]| {
        let out = home.path().join("out");
        let fixed = ["build", free.to_str().unwrap(), "--out", out.to_str().unwrap(), "--no-board", "--json"];
        let all: Vec<&str> = fixed.iter().chain(more).copied().collect();
        let ran = scan_with(home.path(), &all).with_status(0);
        let report = serde_json::from_str::<Value>(&ran.out).unwrap()["report"].clone();
        (longest_side(&report), report["depth_calibration"]["of_this_sensor"] == true)
    };
    let ((with, used), (without, unused)) = (size(&[]), size(&["--no-calibration"]));
    assert!(used && !unused);
    // The sensor reads 1.5 % long, so the uncalibrated model is that much larger.
    let ratio = without / with;
    assert!((ratio - 1.015).abs() < 0.005, "{without} m without, {with} m with: {ratio}");
}

#[test]
fn views_from_one_distance_are_refused_with_what_to_do() {
    let home = tempfile::tempdir().unwrap();
    let rec = simulated(
        "one-distance",
        &["--product", "bowl", "--views", "6", "--frames", "1", "--distances", "0.9", "--elevations", "75"],
    );
    let ran = scan_with(home.path(), &["calibrate", rec.to_str().unwrap()]).with_status(1);
    assert!(ran.out.contains("take views from 0.5 m up to 1.2 m"), "{}", ran.out);
    assert_eq!(names(home.path()), [""; 0]);
}

#[test]
fn a_broken_calibration_is_named() {
    let home = tempfile::tempdir().unwrap();
    let broken = Broken::mug();
    std::fs::write(home.path().join("simulated-seed-1.json"), "{}").unwrap();
    let out = broken.out();
    let ran = scan_with(
        home.path(),
        &["build", broken.recording().to_str().unwrap(), "--out", out.to_str().unwrap()],
    )
    .with_status(2);
    assert!(ran.err.contains("simulated-seed-1.json") && ran.err.contains("make it anew"), "{}", ran.err);
}
