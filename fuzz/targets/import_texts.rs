//! The texts of other programs' recordings: lists, trajectories, matrices, scene cameras.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scanner::import::{bop, trajectory, tum};

fn seeds() -> Vec<Vec<u8>> {
    [
        "# list\n1305031102.175304 rgb/1305031102.175304.png\n1305031102.21 rgb/b.png\n",
        "# truth\n1305031098.6659 1.3563 0.6305 1.6380 0.6132 0.5962 -0.3311 -0.3986\n",
        "0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n",
        "1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n",
        "{\"0\": {\"cam_K\": [550, 0, 316, 0, 540, 244, 0, 0, 1], \"depth_scale\": 0.1, \
         \"cam_R_w2c\": [1, 0, 0, 0, 1, 0, 0, 0, 1], \"cam_t_w2c\": [0, 0, 9]}}",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| {
    let text = String::from_utf8_lossy(data);
    if let Ok(list) = tum::parse_list("rgb.txt", &text) {
        let times: Vec<f64> = list.iter().map(|(time, _)| *time).collect();
        assert_eq!(tum::associate(&times, &list).len(), times.len());
    }
    let _ = trajectory::parse_tum(&text);
    let _ = trajectory::parse_log(&text);
    let _ = trajectory::parse_matrix(&text);
    if let Ok(cameras) = bop::parse_scene_camera(data) {
        for camera in cameras.values() {
            let _ = camera.world_from_camera();
        }
    }
});
