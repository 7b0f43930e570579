//! A penguin with a striped scarf and a hat.

use std::f32::consts::TAU;

use super::Shape;
use crate::simulate::sdf::{Vec3, ellipsoid, limb, smooth_union, sphere, torus};
use crate::simulate::texture::{Rgb, clouds, hue, scale, stripe};

pub(super) struct Figurine {
    coat: Rgb,
    scarf: Rgb,
    hat: Rgb,
    seed: u32,
}

impl Figurine {
    pub(super) fn new(rng: &mut fastrand::Rng) -> Self {
        let turn = rng.f32();
        Self {
            coat: hue(0.55 + 0.2 * turn, 0.5, 0.45),
            scarf: hue(turn, 0.85, 0.8),
            hat: hue(turn + 0.3, 0.7, 0.65),
            seed: rng.u32(..),
        }
    }
}

/// Parts whose paint differs, as distances.
struct Parts {
    body: f32,
    wings: f32,
    feet: f32,
    beak: f32,
    scarf: f32,
    hat: f32,
}

/// Looks along -y.
fn parts(p: Vec3) -> Parts {
    let side = Vec3::new(p.x.abs(), p.y, p.z);
    let trunk = ellipsoid(p - Vec3::new(0.0, 0.0, 0.058), Vec3::new(0.043, 0.038, 0.056));
    let head = sphere(p - Vec3::new(0.0, -0.004, 0.120), 0.031);
    let wing = ellipsoid(
        nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::y_axis(), 0.45)
            * (side - Vec3::new(0.047, 0.0, 0.068)),
        Vec3::new(0.009, 0.017, 0.036),
    );
    let foot = ellipsoid(side - Vec3::new(0.021, -0.016, 0.006), Vec3::new(0.018, 0.027, 0.010));
    let beak = limb(p, Vec3::new(0.0, -0.028, 0.116), Vec3::new(0.0, -0.051, 0.112), 0.009, 0.003);
    let ring =
        torus((p - Vec3::new(0.0, -0.002, 0.095)).component_div(&Vec3::new(1.0, 0.95, 1.0)), 0.029, 0.0075);
    let tail = limb(p, Vec3::new(0.017, -0.030, 0.093), Vec3::new(0.024, -0.040, 0.062), 0.0065, 0.0080);
    let brim = torus(p - Vec3::new(0.0, -0.002, 0.141), 0.024, 0.0055);
    let cone = limb(p, Vec3::new(0.0, 0.0, 0.143), Vec3::new(0.011, 0.010, 0.176), 0.023, 0.006);
    let pompon = sphere(p - Vec3::new(0.0125, 0.0115, 0.182), 0.0095);
    Parts {
        body: smooth_union(trunk, head, 0.012),
        wings: wing,
        feet: foot,
        beak,
        scarf: smooth_union(ring, tail, 0.005),
        hat: smooth_union(brim.min(pompon), cone, 0.003),
    }
}

impl Shape for Figurine {
    fn distance(&self, p: Vec3) -> f32 {
        let q = parts(p);
        let body = smooth_union(smooth_union(q.body, q.wings, 0.008), q.feet, 0.005);
        smooth_union(smooth_union(body, q.beak, 0.003), q.scarf, 0.002).min(q.hat)
    }

    fn color(&self, p: Vec3) -> Rgb {
        let q = parts(p);
        let near = 0.0012;
        if q.hat < near {
            let pompon = (p - Vec3::new(0.0125, 0.0115, 0.182)).norm() < 0.0105;
            if pompon || (p.z < 0.1475 && q.hat < near && p.xy().norm() > 0.0225) {
                return scale([0.95, 0.93, 0.9], 0.75 + 0.4 * clouds(p * 260.0, self.seed));
            }
            let knit = stripe(p.z, 0.012, 0.5) || stripe(p.y.atan2(p.x), TAU / 10.0, 0.3);
            return if knit { self.hat } else { scale(self.hat, 0.6) };
        }
        if q.scarf < near {
            let band =
                if p.z < 0.087 { stripe(p.z, 0.009, 0.5) } else { stripe(p.y.atan2(p.x), TAU / 16.0, 0.5) };
            return if band { self.scarf } else { [0.93, 0.92, 0.88] };
        }
        if q.beak < near || q.feet < near {
            let toe = q.feet < near && p.y < -0.03 && stripe(p.x, 0.008, 0.25);
            return if toe { [0.7, 0.4, 0.1] } else { [0.95, 0.62, 0.15] };
        }
        let eye = Vec3::new(p.x.abs() - 0.0115, p.y + 0.0325, p.z - 0.1265).norm();
        if eye < 0.0034 {
            return [0.1, 0.1, 0.12];
        }
        let belly = (p.x / 0.030).hypot((p.z - 0.056) / 0.046) < 1.0 && p.y < -0.01;
        let face = (p.x.abs() - 0.012).hypot(p.z - 0.1215) < 0.0145 && p.y < -0.015;
        if face || (belly && q.wings > 0.002) {
            let button = p.x.abs() < 0.0032 && stripe(p.z - 0.0245, 0.02, 0.3) && belly && !face;
            return if button { self.scarf } else { [0.95, 0.95, 0.93] };
        }
        if p.y > 0.012 && (p.x.hypot(p.z - 0.06) * 160.0).sin() > 0.55 {
            return scale(self.coat, 1.5);
        }
        scale(self.coat, 0.75 + 0.6 * clouds(p * 120.0, self.seed))
    }

    fn gloss(&self, _: Vec3) -> f32 {
        0.3
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::new(-0.068, -0.056, 0.0), Vec3::new(0.068, 0.042, 0.193))
    }
}
