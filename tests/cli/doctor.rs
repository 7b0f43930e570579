//! The live check, on the simulated sensor and without any.

use serde_json::Value;

use super::support::{Ran, clean, program};

/// The program on a computer into which nothing is plugged.
fn doctor(arguments: &[&str]) -> Ran {
    let nothing = tempfile::tempdir().unwrap();
    let mut command = clean(std::process::Command::new(program()));
    command.env("SCAN_USB_ROOT", nothing.path()).arg("doctor").args(arguments).output().unwrap().into()
}

#[test]
fn the_simulated_sensor_is_checked_in_words_and_numbers() {
    let sensor = ["--sensor", "simulated:crackerbox", "--seconds", "1"];
    let ran = doctor(&[&sensor[..], &["--board", "a3", "--json"]].concat());
    let result: Value = serde_json::from_str(&ran.out).unwrap();
    let findings = result["findings"].as_array().unwrap();
    let of = |code: &str| {
        findings.iter().find(|f| f["code"] == code).unwrap_or_else(|| panic!("{code}: {result}"))
    };
    for code in
        ["frame_rate", "lost_packets", "valid_depth", "time_offset", "pixel_offset", "tags", "depth_scale"]
    {
        assert!(of(code)["text"].as_str().unwrap().ends_with('.'), "{code}: {result}");
    }
    assert_eq!(
        (of("tags")["level"].as_str(), of("depth_scale")["level"].as_str()),
        (Some("green"), Some("green"))
    );
    assert!(of("tags")["value"].as_f64().unwrap() >= 8.0, "{result}");
    // A busy computer may get too few pictures a second, and then says so.
    let red = findings.iter().any(|f| f["level"] == "red");
    assert_eq!((result["good"] == true, ran.status), (!red, Some(i32::from(red))), "{result}");

    let words = doctor(&sensor).out;
    assert!(words.contains("Live check of Simulated Kinect") && words.contains("Name the board"), "{words}");
}

#[test]
fn without_a_sensor_it_says_so() {
    let ran = doctor(&[]).with_status(1);
    assert!(ran.out.contains("none is plugged in") && ran.out.contains("no sensor to check"), "{}", ran.out);
    let ran = doctor(&["--sensor", "replay:/nowhere"]).with_status(2);
    assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
    let ran = doctor(&["--seconds", "0"]).with_status(2);
    assert!(ran.err.contains("0.5 to 600 seconds"), "{}", ran.err);
}
