//! One recording's cloud, thinned: one mean point a cell and direction its surface faces, so both sides of a wall stay apart.

use nalgebra::{Point3, Vector3};

use super::super::surfel::Surfels;
use super::color::{Paint, paint_of};
use crate::cloud::PointCloud;
use crate::fuse::grid::{cell_of, key, lowest};

/// Fewer points cannot be compared.
const LEAST: usize = 60;

/// A thinned cloud. All vectors have the same length.
pub(super) struct Prepared {
    /// In the recording's own frame, metres.
    pub cloud: PointCloud,
    /// The same points and normals as fine registration takes them, about their middle.
    pub surfels: Surfels,
    /// Paint of each point, without the light that fell on it.
    pub paint: Vec<Paint>,
}

impl Prepared {
    /// `None` where there are hardly any points, or none with normals and colours.
    pub(super) fn new(cloud: &PointCloud, cell: f32) -> Option<Self> {
        if !cloud.has_normals() || !cloud.has_colors() {
            return None;
        }
        let cloud = thinned(cloud, cell);
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
        let paint = paint_of(&cloud);
        Some(Self { cloud, surfels, paint })
    }

    /// Number of points.
    pub(super) fn len(&self) -> usize {
        self.cloud.len()
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
    let axis = (0..3u8).fold(0, |best, k| if n[k as usize].abs() > n[best as usize].abs() { k } else { best });
    2 * axis + u8::from(n[axis as usize] < 0.0)
}
