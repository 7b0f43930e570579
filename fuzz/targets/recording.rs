//! `recording.json`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scanner::recording::parse_description;
use serde_json::json;

fn seeds() -> Vec<Vec<u8>> {
    let camera = json!({"width": 640, "height": 480, "fx": 525.0, "fy": 525.0, "cx": 319.5, "cy": 239.5,
        "distortion": [0.1, 0, 0, 0, 0]});
    let mut depth = camera.clone();
    depth["units_per_metre"] = json!(1000.0);
    let frames = json!([{"color": "color/0.png", "depth": "depth/0.png", "timestamp_nanos": 7}]);
    let identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
    let views = json!({"version": 1, "device": {"backend": "simulated", "serial": "1"}, "color": camera, "depth": depth,
        "color_from_depth": identity, "mirrored": true, "views": [{"name": "000", "frames": frames}]});
    let mut stream = views.clone();
    stream.as_object_mut().expect("an object").remove("views");
    stream["frames"] = frames;
    vec![views.to_string().into_bytes(), stream.to_string().into_bytes()]
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| {
    match parse_description(data) {
        Ok(file) => {
            let views = file.view_entries();
            assert!(!views.is_empty() && views.iter().all(|view| !view.frames.is_empty()));
            assert!(file.color.is_valid() && file.depth.intrinsics.is_valid());
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
