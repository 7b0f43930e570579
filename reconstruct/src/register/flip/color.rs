//! Paint: what is left of colour when the light is taken away, so that a product can be compared with itself laid over.
//!
//! Light scales all channels alike and, from afar, by a linear function of the normal: ratios of channels do not know it, and of the
//! brightness that linear part is taken away.

use nalgebra::{Matrix4, Vector3, Vector4};

use crate::cloud::PointCloud;

/// Brightness without light, and the two ratios of channels; logarithms.
pub(super) type Paint = [f32; 3];

/// How much a difference in brightness counts against one in colour.
const BRIGHTNESS: f32 = 0.5;
/// Added to every channel, so that the noise of dark places does not count as colour.
const DARK: f32 = 24.0;
/// Mean square spread of the paint below which it is one colour, and above which it tells places apart well.
const TEXTURE: [f64; 2] = [0.006, 0.03];

/// Paint of every point.
pub(super) fn paint_of(cloud: &PointCloud) -> Vec<Paint> {
    let logs: Vec<[f32; 3]> = cloud.colors.iter().map(|c| c.map(|v| (f32::from(v) + DARK).ln())).collect();
    let brightness: Vec<f32> = logs.iter().map(|l| (l[0] + l[1] + l[2]) / 3.0).collect();
    let light = light(&cloud.normals, &brightness);
    logs.iter()
        .zip(&brightness)
        .zip(&cloud.normals)
        .map(|((l, b), n)| {
            let of_light = Vector4::new(n[0], n[1], n[2], 1.0).dot(&light);
            [BRIGHTNESS * (b - of_light), l[0] - l[1], l[2] - l[1]]
        })
        .collect()
}

/// Least squares of the brightness over the normals.
fn light(normals: &[[f32; 3]], brightness: &[f32]) -> Vector4<f32> {
    let (mut normal, mut right) = (Matrix4::<f64>::identity() * 1e-3, Vector4::<f64>::zeros());
    for (n, b) in normals.iter().zip(brightness) {
        let row = Vector4::new(f64::from(n[0]), f64::from(n[1]), f64::from(n[2]), 1.0);
        normal += row * row.transpose();
        right += row * f64::from(*b);
    }
    normal.cholesky().map_or_else(Vector4::zeros, |c| c.solve(&right)).cast()
}

/// Running comparison of paint at pairs of places.
#[derive(Clone, Copy, Default)]
pub(super) struct Comparison {
    pairs: f64,
    sums: [Vector3<f64>; 2],
    squares: [f64; 2],
    product: f64,
}

impl Comparison {
    pub(super) fn add(&mut self, a: &Paint, b: &Paint) {
        let (a, b) = (Vector3::from(a.map(f64::from)), Vector3::from(b.map(f64::from)));
        self.pairs += 1.0;
        self.sums[0] += a;
        self.sums[1] += b;
        self.squares[0] += a.norm_squared();
        self.squares[1] += b.norm_squared();
        self.product += a.dot(&b);
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            pairs: self.pairs + other.pairs,
            sums: [0, 1].map(|k| self.sums[k] + other.sums[k]),
            squares: [0, 1].map(|k| self.squares[k] + other.squares[k]),
            product: self.product + other.product,
        }
    }

    /// How alike the paint is (concordance: 1 the same, 0 as any two places), and how much of it there is, 0 to 1.
    pub(super) fn result(&self) -> (f64, f64) {
        if self.pairs < 30.0 {
            return (0.0, 0.0);
        }
        let mean = self.sums.map(|s| s / self.pairs);
        let variance = [0, 1].map(|k| self.squares[k] / self.pairs - mean[k].norm_squared());
        let covariance = self.product / self.pairs - mean[0].dot(&mean[1]);
        let spread = 0.5 * (variance[0] + variance[1]);
        let texture = ((spread - TEXTURE[0]) / (TEXTURE[1] - TEXTURE[0])).clamp(0.0, 1.0);
        (covariance / spread.max(1e-9), texture)
    }
}
