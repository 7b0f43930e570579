//! `board.json`: from bytes to a checked board.

use std::collections::BTreeSet;

use reconstruct::board::{BoardFile, Family, KnownBoard, LooseSheets};
use reconstruct::marker::Dictionary;
use serde::Deserialize;
use serde_json::Value;

use super::RecordingError;
use super::description::check_version;

const FILE: &str = "board.json";
/// Farthest a tag may lie from the board's origin, metres.
const MAX_REACH_METRES: f64 = 20.0;
/// Smallest and largest side of a tag, metres.
const TAG_SIDES_METRES: std::ops::RangeInclusive<f64> = 0.003..=2.0;
/// How much the sides and diagonals of a tag may differ from a square's, as part of its side.
const SQUARE_TOLERANCE: f64 = 0.05;

/// Parses and checks a board.
pub fn parse(bytes: &[u8]) -> Result<BoardFile, RecordingError> {
    let value: Value = serde_json::from_slice(bytes).map_err(|e| format_error(&e))?;
    check_version(FILE, &value)?;
    check_family(&value)?;
    if let Some(layout) = value.get("layout") {
        check_layout(layout)?;
        let sheets = LooseSheets::deserialize(value).map_err(|e| format_error(&e))?;
        check_sheets(&sheets)?;
        Ok(BoardFile::Loose(sheets))
    } else {
        let board = KnownBoard::deserialize(value).map_err(|e| format_error(&e))?;
        check_known(&board)?;
        Ok(BoardFile::Known(board))
    }
}

fn format_error(error: &serde_json::Error) -> RecordingError {
    RecordingError::Format { file: FILE, what: error.to_string() }
}

fn board_error(what: String) -> RecordingError {
    RecordingError::Board(what)
}

fn check_family(value: &Value) -> Result<(), RecordingError> {
    let known: Vec<&str> = Family::ALL.iter().map(|family| family.name()).collect();
    let family = value.get("family").and_then(Value::as_str).unwrap_or("");
    if known.contains(&family) {
        return Ok(());
    }
    let family: String = family.chars().take(40).collect();
    Err(board_error(format!("the family {family:?} is not known; write one of {}", known.join(", "))))
}

fn check_ids(family: Family, ids: impl Iterator<Item = u32>) -> Result<(), RecordingError> {
    let count = Dictionary::of(family).len();
    let mut seen = BTreeSet::new();
    for id in ids {
        if id as usize >= count {
            return Err(board_error(format!(
                "{} has the tags 0 to {}, there is no tag {id}; correct the family or the id",
                family.name(),
                count - 1
            )));
        }
        if !seen.insert(id) {
            return Err(board_error(format!(
                "tag {id} is on the board twice; every tag needs its own id: remove one of them and print the board again"
            )));
        }
    }
    if seen.is_empty() {
        return Err(board_error(
            "there is no tag on the board; write the board again with `scan-product board`".to_owned(),
        ));
    }
    Ok(())
}

fn check_layout(layout: &Value) -> Result<(), RecordingError> {
    if layout == "unknown" {
        return Ok(());
    }
    Err(board_error(
        "layout can only be \"unknown\"; leave it out where the places of the tags are listed".to_owned(),
    ))
}

fn check_sheets(sheets: &LooseSheets) -> Result<(), RecordingError> {
    if !TAG_SIDES_METRES.contains(&sheets.tag_size_m) {
        return Err(board_error(format!(
            "tag_size_m is {}; write the side of the black square in metres, as 0.096",
            sheets.tag_size_m
        )));
    }
    check_ids(sheets.family, sheets.ids.iter().copied())
}

fn check_known(board: &KnownBoard) -> Result<(), RecordingError> {
    check_ids(board.family, board.tags.iter().map(|tag| tag.id))?;
    for tag in &board.tags {
        check_square(tag.id, &tag.corners_m)?;
    }
    let region = &board.inner_region_m;
    let near = |v: &f64| v.abs() <= MAX_REACH_METRES;
    if region.len() < 3 || !region.iter().flatten().all(near) || area(region).abs() < 1e-6 {
        return Err(board_error(
            "inner_region_m is no area; list at least three corners [x, y] in metres of where the product stands".to_owned(),
        ));
    }
    Ok(())
}

fn check_square(id: u32, corners: &[[f64; 3]; 4]) -> Result<(), RecordingError> {
    let distance =
        |a: usize, b: usize| (0..3).map(|k| (corners[a][k] - corners[b][k]).powi(2)).sum::<f64>().sqrt();
    let side = distance(0, 1);
    let square = corners.iter().flatten().all(|v| v.abs() <= MAX_REACH_METRES)
        && TAG_SIDES_METRES.contains(&side)
        && [(1, 2), (2, 3), (3, 0)]
            .iter()
            .all(|&(a, b)| (distance(a, b) - side).abs() < SQUARE_TOLERANCE * side)
        && [(0, 2), (1, 3)].iter().all(|&(a, b)| {
            (distance(a, b) - side * std::f64::consts::SQRT_2).abs() < SQUARE_TOLERANCE * side
        });
    if square {
        return Ok(());
    }
    Err(board_error(format!(
        "the corners of tag {id} form no square of 3 mm to 2 m; list top-left, top-right, bottom-right, bottom-left in metres"
    )))
}

/// Signed area of a polygon, square metres.
fn area(polygon: &[[f64; 2]]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>() / 2.0
}
