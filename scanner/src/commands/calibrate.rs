//! `scan-product calibrate`: how one sensor's depth errs, learnt from recordings on the board and kept by its serial number.

use std::path::PathBuf;

use anyhow::{bail, ensure};
use reconstruct::calibrate::{self, BoardSample, CalibrationPrior, DepthCalibration};
use serde_json::json;

use crate::cli::{DONE, NO_GOOD_SCAN};
use crate::config::Config;
use crate::pipeline::{depth, load, markers};
use crate::recording::Recording;
use crate::ui::Ui;
use crate::unit_calibration::{UnitCalibration, keep};

/// Fewer board pixels say too little about a sensor.
const MIN_SAMPLES: usize = 20_000;
/// Distances must differ by this factor, or scale and offset cannot be told apart.
const MIN_SPAN: f64 = 1.3;
/// Board pixels that err more than this on the whole belong to another board, or to one that is not flat.
const MAX_RESIDUAL_PX: f64 = 0.5;

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
How to calibrate: put the printed board flat on a table, check its line of 100 mm with a ruler, and take about ten views of
it from 0.5 to 1.2 m, straight and at a slant, near the middle and near the edges of the picture. A product may stand on it.
The calibration is kept on this computer and used by itself for every recording of the same sensor
(`build --no-calibration` does without).

Examples:
  scan-product capture --sensor freenect         take the views
  scan-product calibrate ~/scans/2026-11-22-1
  scan-product calibrate rec1 rec2               from several recordings of one sensor")]
pub struct Args {
    /// Folders of recordings of one sensor, each with its board.json
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// Say what was found, but keep nothing
    #[arg(long)]
    dry_run: bool,
}

/// Runs the command.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let recordings: Vec<Recording> =
        args.recordings.iter().map(|folder| Recording::open(folder)).collect::<Result<_, _>>()?;
    let first = &recordings[0];
    let (device, rig) = (&first.file().device, first.rig());
    for (recording, folder) in recordings.iter().zip(&args.recordings) {
        ensure!(
            recording.file().device == *device && recording.rig() == rig,
            "{} was taken by another sensor than {}: calibrate each by itself",
            folder.display(),
            args.recordings[0].display()
        );
        ensure!(
            recording.board().is_some(),
            "{} has no board.json: take the views on the marker board",
            folder.display()
        );
    }
    let mut samples = Vec::new();
    for recording in &recordings {
        samples.extend(board_samples(recording, ui)?);
    }
    let (width, height) = (rig.color.width as usize, rig.color.height as usize);
    let found = calibrate::fit(&samples, width, height, &CalibrationPrior::of_any_kinect());
    let distances = distances(&samples, rig.color.fx);
    if let Some(why) = useless(&found, distances) {
        ui.result(&format!("Nothing was kept: {why}."), &json!({"kept": null, "reason": why}));
        return Ok(NO_GOOD_SCAN);
    }
    let calibration = UnitCalibration::new(device, &rig, &found, distances);
    let kept = if args.dry_run { None } else { Some(keep(&calibration)?) };
    let place = kept
        .as_ref()
        .map_or("Not kept (--dry-run).".to_owned(), |path| format!("Kept in {}.", path.display()));
    ui.result(
        &format!("{}\n{place}", words(&calibration)),
        &json!({"kept": kept, "calibration": calibration}),
    );
    Ok(DONE)
}

/// White board pixels of all views that could be placed.
fn board_samples(recording: &Recording, ui: &Ui) -> anyhow::Result<Vec<BoardSample>> {
    let config = Config::default();
    let stage = ui.stage("load", recording.view_count());
    let mut work = load::load_and_average(recording, &config, &stage)?;
    stage.done();
    let stage = ui.stage("markers", 1);
    markers::place_on_board(&mut work, recording.board(), &config);
    stage.done();
    for view in work.views.iter().filter(|view| !view.is_used()) {
        if let Some(reason) = &view.left_out {
            ui.warn(&format!("view {}: {reason}", view.name));
        }
    }
    if let Some(why) = &work.failure {
        bail!("{why}");
    }
    Ok(depth::board_samples(&work, &CalibrationPrior::of_any_kinect()).concat())
}

/// Nearest and farthest hundredth of the board pixels, metres.
fn distances(samples: &[BoardSample], fx: f64) -> [f64; 2] {
    let mut metres: Vec<f64> =
        samples.iter().map(|s| UnitCalibration::metres(fx, f64::from(s.expected_px))).collect();
    metres.sort_by(f64::total_cmp);
    match metres.len() {
        0 => [0.0; 2],
        n => [metres[n / 100], metres[n - 1 - n / 100]],
    }
}

/// Why nothing can be learnt.
fn useless(found: &DepthCalibration, [near, far]: [f64; 2]) -> Option<String> {
    if found.samples < MIN_SAMPLES {
        return Some(format!(
            "only {} pixels of the board were measured: take more views that show more of the board",
            found.samples
        ));
    }
    if far < near * MIN_SPAN {
        return Some(format!(
            "the board was seen from {near:.2} to {far:.2} m only: take views from 0.5 m up to 1.2 m"
        ));
    }
    (found.residual_px > MAX_RESIDUAL_PX).then(|| {
        "depth and board do not agree: put the board flat on a table, and print it at 100 %".to_owned()
    })
}

fn words(calibration: &UnitCalibration) -> String {
    let scale = 1.0 / (1.0 + calibration.coefficients[0]);
    let [before, after] = calibration.error_mm;
    let [near, far] = calibration.distances_m;
    format!(
        "{}: depth is corrected by a factor of {scale:.4} (± {:.4}) and a warp; on the board it erred by {before:.1} mm, now {after:.1} mm \
         ({} pixels from {near:.2} to {far:.2} m)",
        calibration.device.serial,
        1.96 * calibration.standard_deviations[0],
        calibration.samples
    )
}
