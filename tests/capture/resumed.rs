//! Going on after an end, and building an old recording anew.
#![cfg(unix)]

use serde_json::{Value, json};

use super::daemon::Daemon;
use crate::cli::support::{json as read_json, names, scan};

#[test]
fn a_capture_is_gone_on_with_and_built_anew() {
    let out = tempfile::tempdir().unwrap();
    let daemon = Daemon::capture(out.path(), "simulated:bowl:3");
    daemon.order("/api/board", &json!({"paper": "a4"}));
    for azimuth in [0.0, 2.0] {
        daemon.stand_at(azimuth);
        daemon.order("/api/views", &json!({}));
    }
    let before = daemon.state();
    let folder = before["folder"].as_str().unwrap().to_owned();
    assert!(Daemon::refuses_to_start(&["resume", &folder]).contains("Another scan-product"));
    daemon.kill();

    let daemon = Daemon::start(&["resume", out.path().to_str().unwrap()]);
    let state = daemon.state();
    assert_eq!((&state["step"], &state["folder"]), (&json!("views"), &json!(folder)));
    assert_eq!(state["sensor"]["address"], "simulated:bowl:3");
    assert_eq!(state["board"], before["board"]);
    let place = |state: &Value, k: usize| state["views"][k]["azimuth"].as_f64().unwrap();
    assert!((0..2).all(|k| (place(&state, k) - place(&before, k)).abs() < 1e-9), "{state}");
    assert!(state["preview"]["points"].as_u64().unwrap() > 100);
    assert!(
        daemon.refused("/api/sensor", &json!({"address": "simulated:mug"}), 409).contains("another sensor")
    );
    daemon.order("/api/sensor", &json!({"address": "simulated:bowl:3"}));
    assert!(daemon.refused("/api/board", &json!({"paper": "a3"}), 409).contains("another board"));
    daemon.stand_at(4.0);
    assert_eq!(daemon.order("/api/views", &json!({}))["views"][2]["name"], "002");
    interrupt(&daemon);
    assert_eq!(daemon.ended(), Some(0));

    let model = out.path().join("model");
    let rebuild = || scan(["rebuild", &folder, "--out", model.to_str().unwrap()]).with_status(0);
    rebuild();
    let first = read_json(&model.join("report.json"));
    assert_eq!(first["views"].as_array().unwrap().len(), 3);
    assert!(rebuild().err.contains("model.before"));
    assert_eq!(read_json(&out.path().join("model.before/report.json")), first);
    assert_eq!(names(&out.path().join("model.before")), names(&model));
}

fn interrupt(daemon: &Daemon) {
    let kill = std::process::Command::new("kill").args(["-INT", &daemon.id().to_string()]).status();
    assert!(kill.unwrap().success());
}

#[test]
fn what_cannot_be_resumed_is_said() {
    let empty = tempfile::tempdir().unwrap();
    let said = Daemon::refuses_to_start(&["resume", empty.path().to_str().unwrap()]);
    assert!(said.contains("recording.json"), "{said}");
    let said = Daemon::refuses_to_start(&["resume", "/nowhere"]);
    assert!(said.contains("/nowhere"), "{said}");
    let said = Daemon::refuses_to_start(&[
        "capture",
        "--sensor",
        "simulated:car",
        "--out",
        empty.path().to_str().unwrap(),
    ]);
    assert!(said.contains("simulated:car"), "{said}");
}
