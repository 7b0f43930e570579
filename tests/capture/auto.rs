//! Views that are taken by themselves once the scene has been still, one a place.

use serde_json::json;

use super::daemon::Daemon;

#[test]
fn a_still_scene_is_taken_once_and_again_from_elsewhere() {
    let out = tempfile::tempdir().unwrap();
    let daemon = Daemon::capture(out.path(), "simulated:mug");
    daemon.order("/api/board", &json!({"paper": "a3"}));
    daemon.order("/api/auto", &json!({"mode": "still", "seconds": 0.5}));
    let views = |state: &serde_json::Value| state["views"].as_array().unwrap().len();
    daemon.wait_for("the first view", |state| views(state) == 1 && state["taking"].is_null());
    daemon.stand_at(1.5);
    let state = daemon.wait_for("the second view", |state| views(state) == 2 && state["taking"].is_null());
    let azimuth = |k: usize| state["views"][k]["azimuth"].as_f64().unwrap();
    assert!((azimuth(1) - 1.5).abs() < 0.15, "{state}");
    assert!(azimuth(0).sin().abs() < 0.1, "{state}");
    let state = daemon.order("/api/auto", &json!({"mode": "manual"}));
    assert_eq!((&state["auto"]["mode"], views(&state)), (&json!("manual"), 2), "not the same place twice");
}
