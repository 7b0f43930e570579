//! `recording.json`: from bytes to a checked description.

use std::collections::BTreeSet;

use reconstruct::camera::Intrinsics;
use reconstruct::pose;
use reconstruct::recording::RecordingFile;
use serde_json::Value;

use super::RecordingError;
use crate::pictures::MAX_SIDE;

const FILE: &str = "recording.json";
const PIXELS: &str = "write the camera's value in pixels (its data sheet or a calibration gives it)";
const UNITS: &str = "write how many depth units a metre has: 1000 for millimetres, 5000 for TUM recordings";

/// Parses and checks a description; says nothing about the images.
pub fn parse(bytes: &[u8]) -> Result<RecordingFile, RecordingError> {
    let file = parse_unfinished(bytes)?;
    if file.views.is_empty() && file.frames.is_empty() {
        return Err(RecordingError::NoViews);
    }
    Ok(file)
}

/// As [`parse`], of a recording that is still being taken: it may have no view yet.
pub fn parse_unfinished(bytes: &[u8]) -> Result<RecordingFile, RecordingError> {
    let value: Value = serde_json::from_slice(bytes).map_err(|e| format_error(&e))?;
    check_version(FILE, &value)?;
    require_fields(&value)?;
    let file: RecordingFile = serde_json::from_value(value).map_err(|e| format_error(&e))?;
    check_camera("color", &file.color)?;
    check_camera("depth", &file.depth.intrinsics)?;
    check_units(file.depth.units_per_metre)?;
    pose::from_row_major(&file.color_from_depth).ok_or(RecordingError::NotRigid)?;
    check_views(&file)?;
    Ok(file)
}

/// Refuses versions of the future; shared with `board.json`.
pub(super) fn check_version(file: &'static str, value: &Value) -> Result<(), RecordingError> {
    match value.get("version") {
        Some(version) if version.as_u64() == Some(1) => Ok(()),
        Some(version) => Err(RecordingError::Version { file, version: shortened(version) }),
        None => Err(RecordingError::Format { file, what: "it has no version".to_owned() }),
    }
}

fn format_error(error: &serde_json::Error) -> RecordingError {
    RecordingError::Format { file: FILE, what: error.to_string() }
}

fn shortened(value: &Value) -> String {
    value.to_string().chars().take(40).collect()
}

/// What must be there is looked for by name, so that the message can say what to write.
fn require_fields(value: &Value) -> Result<(), RecordingError> {
    for camera in ["color", "depth"] {
        for field in ["width", "height", "fx", "fy", "cx", "cy"] {
            require(value, &[camera, field], PIXELS)?;
        }
    }
    require(value, &["depth", "units_per_metre"], UNITS)?;
    for list in ["views", "frames"] {
        let frames = value.get(list).and_then(Value::as_array).into_iter().flatten().enumerate();
        for (i, entry) in frames {
            match entry.get("frames").and_then(Value::as_array) {
                Some(frames) => {
                    for (j, frame) in frames.iter().enumerate() {
                        require_pair(frame, &format!("{list}[{i}].frames[{j}]"))?;
                    }
                }
                None if list == "frames" => require_pair(entry, &format!("{list}[{i}]"))?,
                None => {}
            }
        }
    }
    Ok(())
}

fn require(value: &Value, path: &[&str], advice: &'static str) -> Result<(), RecordingError> {
    let found = path.iter().try_fold(value, |value, key| value.get(key));
    match found {
        Some(Value::Number(_)) => Ok(()),
        None | Some(Value::Null) => Err(RecordingError::MissingField { field: path.join("."), advice }),
        Some(other) => {
            Err(RecordingError::BadValue { field: path.join("."), value: shortened(other), advice })
        }
    }
}

/// A frame is a pair: colour and depth lists of different lengths show up as a frame that lacks one.
fn require_pair(frame: &Value, place: &str) -> Result<(), RecordingError> {
    for (key, advice) in [
        ("color", "every depth image needs its colour image: add it or remove the frame"),
        ("depth", "every colour image needs its depth image: add it or remove the frame"),
    ] {
        if frame.get(key).is_none_or(Value::is_null) {
            return Err(RecordingError::MissingField { field: format!("{place}.{key}"), advice });
        }
    }
    Ok(())
}

/// Refuses numbers that describe no camera; `camera` names it in the message.
pub(crate) fn check_camera(camera: &str, intrinsics: &Intrinsics) -> Result<(), RecordingError> {
    let bad = |field: &str, value: String, advice| {
        Err(RecordingError::BadValue { field: format!("{camera}.{field}"), value, advice })
    };
    let sides = 16..=MAX_SIDE as u32;
    for (field, side) in [("width", intrinsics.width), ("height", intrinsics.height)] {
        if !sides.contains(&side) {
            return bad(field, side.to_string(), "images of 16 to 8192 pixels a side are read");
        }
    }
    let side = f64::from(intrinsics.width.max(intrinsics.height));
    for (field, focal) in [("fx", intrinsics.fx), ("fy", intrinsics.fy)] {
        if !(focal > side * 0.05 && focal < side * 100.0) {
            return bad(
                field,
                focal.to_string(),
                "the focal length in pixels is about as large as the image is wide",
            );
        }
    }
    let centers = [("cx", intrinsics.cx, intrinsics.width), ("cy", intrinsics.cy, intrinsics.height)];
    for (field, center, side) in centers {
        let side = f64::from(side);
        if !(center > -side && center < 2.0 * side) {
            return bad(
                field,
                center.to_string(),
                "the principal point in pixels is near the middle of the image",
            );
        }
    }
    if intrinsics.distortion.iter().any(|k| !k.is_finite() || k.abs() >= 100.0) {
        let value = format!("{:?}", intrinsics.distortion);
        return bad("distortion", value, "write k1 k2 p1 p2 k3, all zero for an ideal camera");
    }
    Ok(())
}

/// A unit coarser than a centimetre or finer than ten micrometres belongs to no such sensor.
pub(crate) fn check_units(units_per_metre: f64) -> Result<(), RecordingError> {
    if (100.0..=100_000.0).contains(&units_per_metre) {
        return Ok(());
    }
    Err(RecordingError::BadValue {
        field: "depth.units_per_metre".to_owned(),
        value: units_per_metre.to_string(),
        advice: "products would have the wrong size: write 1000 where depth is in millimetres, 5000 for TUM recordings, \
                 10000 for tenths of a millimetre",
    })
}

fn check_views(file: &RecordingFile) -> Result<(), RecordingError> {
    if !file.views.is_empty() && !file.frames.is_empty() {
        return Err(RecordingError::ViewsAndFrames);
    }
    let mut names = BTreeSet::new();
    for view in &file.views {
        if view.frames.is_empty() {
            return Err(RecordingError::EmptyView(view.name.clone()));
        }
        if !names.insert(&view.name) {
            return Err(RecordingError::DuplicateView(view.name.clone()));
        }
    }
    Ok(())
}
