//! What the marker board says about the sensor: ids that occur twice, and depth against the size of the print.

use std::sync::Arc;

use kinect::source::Frame;
use reconstruct::board::{BoardFile, KnownBoard};
use reconstruct::calibrate::CalibrationPrior;
use reconstruct::image::DepthImage;
use reconstruct::recording::{Rig, ViewImages};

use super::{Finding, SCALE_ANY, SCALE_USUAL, finding};
use crate::capture::hints::Level;
use crate::capture::preview::OneView;
use crate::config::Config;
use crate::pipeline::load::{Work, load_and_average};
use crate::pipeline::{depth, markers};
use crate::ui::Ui;

/// Fewer white board pixels say nothing.
const MIN_SAMPLES: usize = 500;

pub(super) fn judge(rig: &Rig, board: Option<&KnownBoard>, frames: &[Arc<Frame>]) -> Vec<Finding> {
    let (Some(board), Some(middle)) = (board, frames.get(frames.len() / 2)) else { return Vec::new() };
    let images = ViewImages {
        name: "now".to_owned(),
        color: middle.color.as_ref().clone(),
        depths: frames.iter().map(|frame| frame.depth.as_ref().clone()).collect::<Vec<DepthImage>>(),
    };
    let (config, file) = (Config::default(), BoardFile::Known(board.clone()));
    let source = OneView { rig: *rig, board: &file, name: "now", images };
    let Ok(mut work) = load_and_average(&source, &config, &Ui::silent().stage("load", 1)) else {
        return vec![finding("tags", Level::Red, None, "tags", "The board cannot be checked without depth.")];
    };
    markers::place_on_board(&mut work, Some(&file), &config);
    let mut findings = vec![tags(&work, board)];
    findings.extend(twice(&work));
    findings.extend(scale(&work));
    findings
}

fn tags(work: &Work, board: &KnownBoard) -> Finding {
    let view = &work.views[0];
    if let Some(pose) = &view.marker_pose {
        let (used, all) = (pose.used.len(), board.tags.len());
        let level = if used >= 4 { Level::Green } else { Level::Yellow };
        let text = format!(
            "{used} of the board's {all} markers are read, {:.2} pixels off their places.",
            pose.reprojection_px
        );
        return finding("tags", level, Some(used as f64), "tags", text);
    }
    let why = view.left_out.as_ref().map(ToString::to_string).or_else(|| work.failure.clone());
    let text =
        format!("The board cannot be found: {}.", why.unwrap_or_else(|| "no reason is known".to_owned()));
    finding("tags", Level::Red, Some(0.0), "tags", text)
}

/// Two sheets with the same marker, or a poster of it in the room.
fn twice(work: &Work) -> Option<Finding> {
    let mut ids: Vec<u32> = work.views[0].detections.iter().map(|d| d.id).collect();
    ids.sort_unstable();
    let mut double: Vec<u32> = ids.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]).collect();
    double.dedup();
    (!double.is_empty()).then(|| {
        let list: Vec<String> = double.iter().map(ToString::to_string).collect();
        let text = format!(
            "Marker {} is in the picture more than once: take the second sheet out of sight, markers must be unique.",
            list.join(", ")
        );
        finding("duplicate_tags", Level::Red, Some(double.len() as f64), "ids", text)
    })
}

/// Depth against the board: true by measured distance, in the middle of all white board pixels.
fn scale(work: &Work) -> Option<Finding> {
    let samples = depth::board_samples(work, &CalibrationPrior::of_any_kinect()).concat();
    if samples.len() < MIN_SAMPLES {
        return None;
    }
    let ratios: Vec<f64> =
        samples.iter().map(|s| f64::from(s.measured_px) / f64::from(s.expected_px)).collect();
    let off = 1.0 / super::median(&ratios) - 1.0;
    let percent = format!("On the board, depth reads {:+.1} %", off * 100.0);
    let (level, advice) = match off.abs() {
        ..=SCALE_USUAL => (Level::Green, "; every scan corrects that."),
        ..=SCALE_ANY => (
            Level::Yellow,
            "; every scan on the board corrects that, and `scan-product calibrate` does so for scans without one. Check with a ruler that the line of 100 mm on the board is 100 mm long.",
        ),
        _ => (
            Level::Red,
            ": more than a Kinect errs. Measure the line of 100 mm on the board with a ruler; if it is not 100 mm long, print the board at 100 %.",
        ),
    };
    Some(finding("depth_scale", level, Some(off), "share", format!("{percent}{advice}")))
}
