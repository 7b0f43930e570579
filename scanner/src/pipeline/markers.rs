//! Second stage: markers are found in every view and place it on the board.

use rayon::prelude::*;
use reconstruct::board::{BoardFile, Family, KnownBoard, LooseSheets};
use reconstruct::marker::{
    BoardPoseError, Dictionary, LayoutConfig, board_pose, detect, explain_no_tags, place_sheets,
};
use reconstruct::report::{Ground, LeftOut};
use reconstruct::segment::Region;

use super::load::{View, Work};
use crate::config::Config;

/// Finds the markers and places every view by them.
pub fn place_on_board(scan: &mut Work, board: Option<&BoardFile>, config: &Config) {
    let Some(board) = board.filter(|_| !config.no_board) else { return };
    scan.board_expected = true;
    let family = match board {
        BoardFile::Known(known) => known.family,
        BoardFile::Loose(loose) => loose.family,
    };
    let camera = scan.rig.color;
    scan.views.par_iter_mut().filter(|v| v.is_used()).for_each(|view| {
        view.detections =
            detect(&view.color.to_gray(), Dictionary::of(family), Some(&camera), &config.detect);
    });
    let known = match board {
        BoardFile::Known(known) => Some(known.clone()),
        BoardFile::Loose(loose) => place_loose_sheets(scan, loose),
    };
    if let Some(known) = known {
        scan.views
            .par_iter_mut()
            .filter(|v| v.is_used())
            .for_each(|view| place_view(view, &known, &camera, config));
        scan.region = Some(Region::of_board(&known, &config.segment));
        super::unit::compare_with_markers(scan, &known);
        scan.board = Some(known);
        scan.ground = Ground::Board;
    }
    name_other_family(scan, family, config);
    explain_failure(scan);
}

/// Works out where loose sheets lie from all views together.
fn place_loose_sheets(scan: &mut Work, loose: &LooseSheets) -> Option<KnownBoard> {
    scan.loose_sheets = true;
    let sightings: Vec<_> = scan.views.iter().map(|v| v.detections.clone()).collect();
    match place_sheets(&sightings, loose, &scan.rig.color, &LayoutConfig::default()) {
        Ok(layout) => Some(layout.board),
        Err(error) => {
            scan.failure = Some(format!("the marker sheets could not be placed: {error}"));
            None
        }
    }
}

/// Places one view by its tags, or says why not.
fn place_view(
    view: &mut View,
    board: &KnownBoard,
    camera: &reconstruct::camera::Intrinsics,
    config: &Config,
) {
    match board_pose(&view.detections, board, camera, &config.pose) {
        Ok(pose) => {
            view.world_from_camera = Some(pose.camera_from_board.inverse());
            view.marker_pose = Some(pose);
        }
        Err(BoardPoseError::NoTags) => view.leave_out(LeftOut::NoTags { blurred: is_blurred(view) }),
        Err(BoardPoseError::OneTag(id)) => view.leave_out(LeftOut::OneTag { id }),
        Err(error) => view.leave_out(LeftOut::Markers(error.to_string())),
    }
}

/// Where no view shows the family that was asked for, looks whether they show another.
fn name_other_family(scan: &mut Work, family: Family, config: &Config) {
    if scan.views.iter().any(|v| !v.detections.is_empty()) {
        return;
    }
    let camera = scan.rig.color;
    scan.views.par_iter_mut().filter(|v| matches!(v.left_out, Some(LeftOut::NoTags { .. }))).for_each(
        |view| {
            let why = explain_no_tags(&view.color.to_gray(), family, Some(&camera), &config.detect);
            if let BoardPoseError::OtherFamily { found, expected } = why {
                view.left_out = Some(LeftOut::OtherFamily {
                    found: found.name().into(),
                    expected: expected.name().into(),
                });
            }
        },
    );
}

/// Says in one sentence why no view at all could be placed.
fn explain_failure(scan: &mut Work) {
    if scan.failure.is_some() || scan.views.iter().any(View::is_used) {
        return;
    }
    let reason =
        scan.views.iter().filter_map(|v| v.left_out.as_ref()).find(|r| !matches!(r, LeftOut::NoDepth));
    let reason = reason.or(scan.views.iter().find_map(|v| v.left_out.as_ref()));
    scan.failure = reason.map(|r| format!("no view could be placed on the board; {r}"));
}

/// Whether the picture has no sharp edge: the strongest differences between neighbours are weak.
fn is_blurred(view: &View) -> bool {
    const SHARP: u8 = 60;
    let gray = view.color.to_gray();
    let mut steps: Vec<u8> = gray
        .data
        .chunks_exact(gray.width.max(1))
        .flat_map(|row| row.windows(3).step_by(3).map(|w| w[0].abs_diff(w[2])))
        .collect();
    if steps.is_empty() {
        return false;
    }
    let at = steps.len() - 1 - steps.len() / 500;
    *steps.select_nth_unstable(at).1 < SHARP
}
