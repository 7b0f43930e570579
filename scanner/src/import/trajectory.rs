//! Poses as text: TUM lines, 4x4 matrices, and the `.log` trajectories of the Redwood data.

use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use reconstruct::pose::{self, Pose};

use super::ImportError;

/// Farthest a camera may be from the origin, metres.
const MAX_REACH_METRES: f64 = 1e4;

/// All numbers of a line; `None` where something else stands there.
pub(super) fn numbers(line: &str) -> Option<Vec<f64>> {
    let values = line.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty()).take(32);
    values.map(|word| word.parse().ok().filter(|v: &f64| v.is_finite())).collect()
}

/// Lines with their numbers from 1, without comments and blank ones.
pub(super) fn content(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// `timestamp tx ty tz qx qy qz qw` a line: seconds and `world_from_camera`, in the order of the file.
pub fn parse_tum(text: &str) -> Result<Vec<(f64, Pose)>, ImportError> {
    const FILE: &str = "groundtruth.txt";
    let mut poses = Vec::new();
    for (line, content) in content(text) {
        let wrong = || ImportError::text(FILE, line, "expected timestamp tx ty tz qx qy qz qw");
        let values = numbers(content).filter(|values| values.len() == 8).ok_or_else(wrong)?;
        let rotation =
            UnitQuaternion::try_new(Quaternion::new(values[7], values[4], values[5], values[6]), 1e-6)
                .ok_or_else(wrong)?;
        let translation = Translation3::new(values[1], values[2], values[3]);
        if translation.vector.amax() > MAX_REACH_METRES {
            return Err(ImportError::text(FILE, line, "the camera is more than 10 km away"));
        }
        poses.push((values[0], Pose::from_parts(translation, rotation)));
    }
    Ok(poses)
}

/// Four lines of four numbers: a rigid transform; `None` where they are none.
pub fn parse_matrix(text: &str) -> Option<Pose> {
    let rows: Vec<f64> = content(text).map(|(_, line)| numbers(line)).collect::<Option<Vec<_>>>()?.concat();
    let rows: [f64; 16] = rows.try_into().ok()?;
    rigid(rows)
}

/// Blocks of five lines, `i j n` and the matrix `world_from_camera` of frame `i`: frame number and pose.
pub fn parse_log(text: &str) -> Result<Vec<(usize, Pose)>, ImportError> {
    const FILE: &str = "trajectory.log";
    let lines: Vec<(usize, &str)> = content(text).collect();
    let mut poses = Vec::new();
    for block in lines.chunks(5) {
        let (line, head) = block[0];
        let frame = numbers(head).and_then(|v| v.first().copied()).filter(|v| (0.0..1e9).contains(v));
        let rows: Option<Vec<f64>> =
            block[1..].iter().map(|(_, row)| numbers(row)).collect::<Option<Vec<_>>>().map(|r| r.concat());
        let pose = rows.and_then(|rows| rows.try_into().ok()).and_then(rigid);
        match (frame, pose) {
            (Some(frame), Some(pose)) => poses.push((frame as usize, pose)),
            _ => return Err(ImportError::text(FILE, line, "expected three numbers and a rigid 4x4 matrix")),
        }
    }
    Ok(poses)
}

/// Text files carry few digits: the rotation is taken as it is where it is one within a thousandth.
fn rigid(mut rows: [f64; 16]) -> Option<Pose> {
    rows[12..].iter_mut().for_each(|v| *v = v.round());
    pose::from_row_major(&rows)
}
