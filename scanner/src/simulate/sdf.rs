//! Signed distances of simple solids, metres, negative inside: the clay the simulated products are made of.
//!
//! The combinations follow the usual distance algebra (Hart 1996); smooth ones keep the gradient near 1, which
//! is what [`super::nets`] relies on when it skips empty space.

use nalgebra::{Vector2, Vector3};

/// A point or direction in the product's own frame, metres.
pub type Vec3 = Vector3<f32>;

/// Ball of radius `r` about the origin.
pub fn sphere(p: Vec3, r: f32) -> f32 {
    p.norm() - r
}

/// Ellipsoid with half axes `r`; a bound that is exact on the surface.
pub fn ellipsoid(p: Vec3, r: Vec3) -> f32 {
    let scaled = p.component_div(&r).norm();
    let gradient = p.component_div(&r.component_mul(&r)).norm();
    if gradient < 1e-6 { -r.min() } else { scaled * (scaled - 1.0) / gradient }
}

/// Line from `a` to `b` with a radius that goes from `ra` to `rb`.
pub fn limb(p: Vec3, a: Vec3, b: Vec3, ra: f32, rb: f32) -> f32 {
    let along = b - a;
    let t = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (p - a - along * t).norm() - (ra + (rb - ra) * t)
}

/// Box with half sizes `half` and edges rounded by `r`.
pub fn rounded_box(p: Vec3, half: Vec3, r: f32) -> f32 {
    let q = p.abs() - half + Vec3::repeat(r);
    q.map(|v| v.max(0.0)).norm() + q.max().min(0.0) - r
}

/// Upright cylinder of radius `radius` and half height `half`, edges rounded by `r`.
pub fn cylinder(p: Vec3, radius: f32, half: f32, r: f32) -> f32 {
    let q = Vector2::new(p.xy().norm() - radius + r, p.z.abs() - half + r);
    q.map(|v| v.max(0.0)).norm() + q.max().min(0.0) - r
}

/// Ring about the z axis: a tube of radius `tube` bent to radius `ring`.
pub fn torus(p: Vec3, ring: f32, tube: f32) -> f32 {
    Vector2::new(p.xy().norm() - ring, p.z).norm() - tube
}

/// Union whose seam is filled over about `k` metres.
pub fn smooth_union(a: f32, b: f32, k: f32) -> f32 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k * 0.25
}

/// `a` without `b`, the edge rounded over about `k` metres.
pub fn smooth_subtract(a: f32, b: f32, k: f32) -> f32 {
    -smooth_union(-a, b, k)
}

/// A closed outline in the half plane (distance from the axis, height), turned round the z axis.
#[derive(Debug, Clone)]
pub struct Turned {
    outline: Vec<[f32; 2]>,
}

impl Turned {
    /// Solid of revolution of an outline `[radius, height]` in metres.
    pub fn new(outline: &[[f32; 2]], scale: f32) -> Self {
        Self { outline: outline.iter().map(|&[r, z]| [r * scale, z * scale]).collect() }
    }

    /// Signed distance, the outline grown by `round`.
    pub fn distance(&self, p: Vec3, round: f32) -> f32 {
        polygon(Vector2::new(p.xy().norm(), p.z), &self.outline) - round
    }
}

/// Signed distance of a closed polygon in the plane.
fn polygon(p: Vector2<f32>, corners: &[[f32; 2]]) -> f32 {
    let mut squared = f32::INFINITY;
    let mut inside = false;
    let mut a = Vector2::from(corners[corners.len() - 1]);
    for corner in corners {
        let b = Vector2::from(*corner);
        let (edge, w) = (b - a, p - a);
        let t = (w.dot(&edge) / edge.norm_squared()).clamp(0.0, 1.0);
        squared = squared.min((w - edge * t).norm_squared());
        if (a.y > p.y) != (b.y > p.y) && p.x < a.x + edge.x * (p.y - a.y) / edge.y {
            inside = !inside;
        }
        a = b;
    }
    if inside { -squared.sqrt() } else { squared.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_square_is_a_cylinder() {
        let turned = Turned::new(&[[0.0, -0.5], [0.3, -0.5], [0.3, 0.5], [0.0, 0.5]], 1.0);
        for p in [[0.0, 0.5, 0.1], [0.1, 0.1, 0.9], [0.2, 0.1, 0.0], [0.4, 0.0, 0.7]] {
            let p = Vec3::from(p);
            let expected = cylinder(p, 0.3, 0.5, 0.0);
            // Inside, the polygon also measures to its side on the axis, which is not a surface: sign only.
            if expected > 0.0 {
                assert!((turned.distance(p, 0.0) - expected).abs() < 1e-6);
            } else {
                assert!(turned.distance(p, 0.0) < 0.0);
            }
        }
    }

    #[test]
    fn a_smooth_union_holds_both() {
        assert!(smooth_union(0.01, 0.011, 0.02) < 0.01);
        assert_eq!(smooth_union(0.01, 0.5, 0.02), 0.01);
    }
}
