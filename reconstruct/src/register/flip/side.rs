//! One recording's cloud, thinned: one mean point a cell and direction its surface faces, so both sides of a wall stay apart.

use nalgebra::{Isometry3, Point3, Vector3};

use super::super::near_field::NearField;
use super::super::surfel::Surfels;
use super::color::{Comparison, Paint, paint_of};
use crate::cloud::PointCloud;
use crate::fuse::grid::{cell_of, key, lowest};
use crate::pose::Pose;

/// Fewer points cannot be compared.
const LEAST: usize = 60;
/// Cells in which the paint at a place is looked up, and how far off it may be, metres.
const PAINT_CELL: f32 = 0.001;
const PAINT_REACH: f32 = 0.002;
/// Fewer points that face down are no underside.
const LEAST_UNDERSIDE: usize = 300;

/// A thinned cloud. All vectors have the same length.
pub(super) struct Prepared {
    /// In the recording's own frame, metres.
    pub cloud: PointCloud,
    /// The same points and normals as fine registration takes them, about their middle.
    pub surfels: Surfels,
    /// All points.
    pub dense: Dense,
}

/// All points of a cloud with their paint, which is finer than the thinned cloud.
#[derive(Clone)]
pub(super) struct Dense {
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// Without the light that fell on it.
    paint: Vec<Paint>,
    field: NearField,
}

impl Prepared {
    /// `None` where there are hardly any points, or none with normals and colours.
    pub(super) fn new(all: &PointCloud, cell: f32) -> Option<Self> {
        if !all.has_normals() || !all.has_colors() {
            return None;
        }
        let cloud = thinned(all, cell);
        if cloud.len() < LEAST {
            return None;
        }
        let sum: Vector3<f64> = cloud.points.iter().map(|p| Vector3::from(p.map(f64::from))).sum();
        let centre = Point3::from((sum / cloud.len() as f64).map(|v| f64::from(v as f32)));
        let middle: [f32; 3] = centre.coords.map(|v| v as f32).into();
        let surfels = Surfels {
            centre,
            points: cloud.points.iter().map(|p| std::array::from_fn(|k| p[k] - middle[k])).collect(),
            normals: cloud.normals.clone(),
            weights: vec![1.0; cloud.len()],
        };
        let dense = Dense {
            points: all.points.clone(),
            normals: all.normals.clone(),
            paint: paint_of(all),
            field: NearField::new(&all.points, 1, PAINT_CELL, PAINT_REACH),
        };
        Some(Self { cloud, surfels, dense })
    }

    /// Number of points.
    pub(super) fn len(&self) -> usize {
        self.cloud.len()
    }
}

impl Dense {
    /// Compares the paint of about `count` points of another recording, carried here by `pose`, with what lies at their place.
    pub(super) fn compare(&self, other: &Self, pose: &Isometry3<f32>, count: usize) -> Comparison {
        let mut comparison = Comparison::default();
        if count == 0 {
            return comparison;
        }
        let step = (other.points.len() / count).max(1);
        for i in (0..other.points.len()).step_by(step) {
            let p = pose * Point3::from(other.points[i]);
            let Some(j) = self.field.nearest(&p.into()) else { continue };
            let off = (p.coords - Vector3::from(self.points[j])).norm();
            let facing =
                (pose.rotation * Vector3::from(other.normals[i])).dot(&Vector3::from(self.normals[j]));
            if off < PAINT_REACH && facing > 0.7 {
                comparison.add(&self.paint[j], &other.paint[i]);
            }
        }
        comparison
    }

    /// The lowest measured place that faces down when the cloud is carried by `pose`, and its height; `None` where hardly anything
    /// faces down.
    pub(super) fn foot(&self, pose: &Pose) -> Option<(Vector3<f64>, f64)> {
        let moved = pose.cast::<f32>();
        let down = -(moved.rotation.inverse() * Vector3::z());
        let mut low: Vec<(f32, [f32; 3])> = self
            .points
            .iter()
            .zip(&self.normals)
            .filter(|(_, n)| Vector3::from(**n).dot(&down) > 0.7)
            .map(|(p, _)| moved * Point3::from(*p))
            .map(|p| (p.z, p.into()))
            .collect();
        if low.len() < LEAST_UNDERSIDE {
            return None;
        }
        // As sizes are measured: the extreme itself is noise.
        let count = (low.len() / 100).clamp(5, 40);
        low.select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0));
        let low = &mut low[..count];
        low.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1[0].total_cmp(&b.1[0])));
        let sum: Vector3<f64> = low.iter().map(|(_, p)| Vector3::from(p.map(f64::from))).sum();
        Some((sum / count as f64, f64::from(low[count / 2].0)))
    }
}

/// One mean point for every cell and direction, in the order of the cells.
fn thinned(cloud: &PointCloud, cell: f32) -> PointCloud {
    let low = lowest(&cloud.points);
    let mut keyed: Vec<(u64, u8, u32)> = (0u32..)
        .zip(&cloud.points)
        .filter(|(_, p)| p.iter().all(|v| v.is_finite()))
        .map(|(i, p)| (key(cell_of(p, &low, cell)), direction(&cloud.normals[i as usize]), i))
        .collect();
    keyed.sort_unstable();
    let mut out = PointCloud::default();
    for run in keyed.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let n = run.len() as f32;
        let mean = |value: &dyn Fn(usize) -> [f32; 3]| {
            run.iter().fold([0.0f32; 3], |sum, &(_, _, i)| {
                let v = value(i as usize);
                std::array::from_fn(|k| sum[k] + v[k] / n)
            })
        };
        let normal = Vector3::from(mean(&|i| cloud.normals[i]));
        let Some(normal) = normal.try_normalize(1e-6) else { continue };
        out.points.push(mean(&|i| cloud.points[i]));
        out.normals.push(normal.into());
        out.colors.push(mean(&|i| cloud.colors[i].map(f32::from)).map(|c| c.round().clamp(0.0, 255.0) as u8));
    }
    out
}

/// Which of six directions a normal points to most.
fn direction(n: &[f32; 3]) -> u8 {
    let axis =
        (0..3u8).fold(0, |best, k| if n[k as usize].abs() > n[best as usize].abs() { k } else { best });
    2 * axis + u8::from(n[axis as usize] < 0.0)
}
