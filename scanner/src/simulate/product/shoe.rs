//! A running shoe along x, toe at +x, open at the ankle.

use super::Shape;
use crate::simulate::sdf::{Vec3, ellipsoid, limb, smooth_subtract, smooth_union};
use crate::simulate::texture::{Rgb, clouds, hue, scale, stripe, word};

pub(super) struct Shoe {
    upper: Rgb,
    swoosh: Rgb,
    sole: Rgb,
    seed: u32,
}

impl Shoe {
    pub(super) fn new(rng: &mut fastrand::Rng) -> Self {
        let turn = rng.f32();
        Self {
            upper: hue(turn, 0.7, 0.75),
            swoosh: hue(turn + 0.5, 0.6, 0.95),
            sole: [0.93, 0.92, 0.9],
            seed: rng.u32(..),
        }
    }

    /// Distance to the outline of the foot in the plane.
    fn print(p: Vec3) -> f32 {
        let flat = Vec3::new(p.x, p.y, 0.0);
        let heel = limb(flat, Vec3::new(-0.082, 0.0, 0.0), Vec3::new(0.01, -0.002, 0.0), 0.033, 0.032);
        let ball = limb(flat, Vec3::new(0.02, -0.002, 0.0), Vec3::new(0.075, 0.004, 0.0), 0.036, 0.036);
        let tip = limb(flat, Vec3::new(0.06, 0.006, 0.0), Vec3::new(0.09, 0.008, 0.0), 0.034, 0.027);
        smooth_union(smooth_union(heel, ball, 0.03), tip, 0.02)
    }
}

impl Shape for Shoe {
    fn distance(&self, p: Vec3) -> f32 {
        let print = Self::print(p);
        let lift = 0.009 * ((p.x - 0.06) / 0.06).max(0.0).powi(2);
        let thick = 0.012 + 0.006 * ((0.0 - p.x) / 0.1).clamp(0.0, 1.0);
        let sole = (print - 0.002).max((p.z - thick - lift * 0.5).max(lift - p.z)) - 0.0015;
        let toe = ellipsoid(p - Vec3::new(0.058, 0.004, 0.020), Vec3::new(0.060, 0.035, 0.034));
        let middle = limb(p, Vec3::new(0.045, 0.002, 0.034), Vec3::new(-0.03, 0.0, 0.056), 0.029, 0.032);
        let heel = limb(p, Vec3::new(-0.078, 0.0, 0.02), Vec3::new(-0.074, 0.0, 0.082), 0.034, 0.028);
        let ankle = limb(p, Vec3::new(-0.04, 0.0, 0.05), Vec3::new(-0.05, 0.0, 0.088), 0.034, 0.030);
        let upper = smooth_union(smooth_union(toe, middle, 0.03), smooth_union(heel, ankle, 0.03), 0.025);
        let opening = limb(p, Vec3::new(-0.055, 0.0, 0.038), Vec3::new(-0.056, 0.0, 0.13), 0.023, 0.027);
        let throat = limb(p, Vec3::new(-0.05, 0.0, 0.078), Vec3::new(-0.008, 0.0, 0.088), 0.022, 0.011);
        let hollow = smooth_subtract(upper.max(p.z - 0.100), opening.min(throat), 0.004);
        smooth_union(sole, hollow.max(0.004 - p.z), 0.003)
    }

    fn color(&self, p: Vec3) -> Rgb {
        let thick = 0.0145
            + 0.006 * ((0.0 - p.x) / 0.1).clamp(0.0, 1.0)
            + 0.0045 * ((p.x - 0.06) / 0.06).max(0.0).powi(2);
        if p.z < thick {
            let groove = stripe(p.z, 0.0042, 0.3) && p.z > 0.004;
            let tread = p.z < 0.004 && stripe(p.x, 0.008, 0.5);
            return if groove || tread { scale(self.upper, 0.7) } else { self.sole };
        }
        if Self::is_inside(p) {
            return scale([0.55, 0.55, 0.6], 0.7 + 0.5 * clouds(p * 200.0, self.seed));
        }
        let lace = (-0.004..0.062).contains(&p.x) && p.y.abs() < 0.017 && p.z > 0.048;
        if lace {
            let cross = stripe(p.x + p.y.abs() * 0.5, 0.013, 0.42);
            return if cross { [0.95, 0.95, 0.95] } else { scale(self.swoosh, 0.75) };
        }
        if p.x > 0.088 || p.x < -0.092 {
            let name = p.x < -0.092 && word((0.02 - p.y) / 0.013, (p.z - 0.052) / 0.013, "RUN");
            return if name { self.sole } else { scale(self.swoosh, 0.85) };
        }
        let curve = p.z - 0.024 - 7.0 * (p.x + 0.03).powi(2) - 0.25 * (0.02 - p.x).max(0.0);
        if curve.abs() < 0.0055 && (-0.085..0.06).contains(&p.x) {
            return self.swoosh;
        }
        if p.y.abs() > 0.02 && (-0.055..-0.01).contains(&p.x) {
            let u = if p.y < 0.0 { p.x + 0.052 } else { -0.012 - p.x };
            if word(u / 0.012, (p.z - 0.058) / 0.012, "VELO") {
                return self.sole;
            }
        }
        let mesh = stripe(p.x + p.z, 0.0045, 0.5) && stripe(p.x - p.z, 0.0045, 0.5);
        scale(self.upper, (0.8 + 0.3 * clouds(p * 50.0, self.seed)) * if mesh { 0.72 } else { 1.0 })
    }

    fn gloss(&self, _: Vec3) -> f32 {
        0.08
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::new(-0.121, -0.045, 0.0), Vec3::new(0.123, 0.048, 0.104))
    }
}

impl Shoe {
    fn is_inside(p: Vec3) -> bool {
        let hole = limb(p, Vec3::new(-0.055, 0.0, 0.038), Vec3::new(-0.056, 0.0, 0.13), 0.0245, 0.0285);
        let throat = limb(p, Vec3::new(-0.05, 0.0, 0.078), Vec3::new(-0.008, 0.0, 0.088), 0.0235, 0.0125);
        hole.min(throat) < 0.0 && p.z < 0.0975
    }
}
