//! Registration pairs of the comparison: two views of one object, 45 degrees apart (0–63) or 90 (64–95).

use std::ops::Range;

use anyhow::Context;
use nalgebra::{Point3, Vector3};
use reconstruct::pose::{Pose, from_row_major, rotation_error_radians};

use crate::clock::Bench;
use crate::inputs::{cloud, numbers};
use crate::reference::quantile;

/// Pairs by the angle between their views, degrees.
pub(crate) const APART: [(usize, Range<usize>); 2] = [(45, 0..64), (90, 64..96)];

/// A pair at one spacing.
pub(crate) struct Pair {
    /// Source and target, each in its own frame.
    pub(crate) clouds: [Vec<[f32; 3]>; 2],
    /// Where the sensors stood in those frames.
    pub(crate) sensors: [[f32; 3]; 2],
    /// Start for fine registration.
    pub(crate) start: Pose,
    truth: Pose,
    centroid: Point3<f64>,
}

impl Pair {
    pub(crate) fn read(bench: &Bench, k: usize, millimetres: usize) -> anyhow::Result<Self> {
        let file = |end: &str| bench.data.join(format!("pairs/p{k:03}_{end}"));
        let pose = |end: &str| from_row_major(&numbers(&file(end))?).context("that is no pose");
        let sensor: [f64; 3] = numbers(&file("srcorigin.txt"))?;
        let clouds = [format!("src{millimetres}.pcd"), format!("tgt{millimetres}.pcd")];
        let [source, target] = clouds.map(|end| cloud(&file(&end)).map(|cloud| cloud.points));
        let source = source?;
        let sum: Vector3<f64> = source.iter().map(|p| Vector3::from(p.map(f64::from))).sum();
        Ok(Self {
            centroid: (sum / source.len().max(1) as f64).into(),
            clouds: [source, target?],
            sensors: [sensor.map(|v| v as f32), [0.0; 3]],
            start: pose("init.txt")?,
            truth: pose("gt.txt")?,
        })
    }

    /// Degrees, and millimetres at the centroid.
    pub(crate) fn error(&self, found: &Pose) -> (f64, f64) {
        let moved = (found * self.centroid - self.truth * self.centroid).norm();
        (rotation_error_radians(found, &self.truth).to_degrees(), moved * 1e3)
    }
}

/// Errors of many pairs; wrong ones count apart, as for the peers.
#[derive(Default)]
pub(crate) struct Errors {
    degrees: Vec<f64>,
    millimetres: Vec<f64>,
    all: usize,
}

impl Errors {
    /// Notes a result, and whether it is right: below 5 degrees and 10 mm.
    pub(crate) fn add(&mut self, error: Option<(f64, f64)>) -> bool {
        self.all += 1;
        let Some((degrees, millimetres)) = error.filter(|(r, t)| *r < 5.0 && *t < 10.0) else { return false };
        self.degrees.push(degrees);
        self.millimetres.push(millimetres);
        true
    }
}

impl std::fmt::Display for Errors {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let of = |values: &[f64], share| quantile(values.to_vec(), share);
        write!(
            f,
            "ok={}/{} rot_med={:.3}deg t_med={:.3}mm rot_p95={:.3}deg t_p95={:.3}mm",
            self.degrees.len(),
            self.all,
            of(&self.degrees, 0.5),
            of(&self.millimetres, 0.5),
            of(&self.degrees, 0.95),
            of(&self.millimetres, 0.95)
        )
    }
}
