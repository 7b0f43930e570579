//! `board.json`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scanner::recording::parse_board;
use serde_json::json;

fn seeds() -> Vec<Vec<u8>> {
    let corners = json!([[0.0, 0.05, 0.0], [0.05, 0.05, 0.0], [0.05, 0.0, 0.0], [0.0, 0.0, 0.0]]);
    let known = json!({"version": 1, "family": "tag36h11", "tags": [{"id": 0, "corners_m": corners}],
        "inner_region_m": [[0, 0], [0.1, 0], [0.1, 0.1]]});
    let loose = json!({"version": 1, "family": "aruco_original", "tag_size_m": 0.096, "layout": "unknown", "ids": [3, 4]});
    vec![known.to_string().into_bytes(), loose.to_string().into_bytes()]
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| {
    if let Err(error) = parse_board(data) {
        assert!(!error.to_string().is_empty());
    }
});
