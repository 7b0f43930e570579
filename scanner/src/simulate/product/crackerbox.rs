//! A box of crackers: six printed faces.

use super::Shape;
use crate::simulate::sdf::{Vec3, rounded_box};
use crate::simulate::texture::{
    Rgb, bars, clouds, hue, mix, noise, scale, small_print, stripe, word, word_width,
};

/// Half sizes, metres.
const HALF: [f32; 3] = [0.078, 0.031, 0.103];

pub(super) struct Crackerbox {
    ground: Rgb,
    accent: Rgb,
    name: &'static str,
    seed: u32,
}

impl Crackerbox {
    pub(super) fn new(rng: &mut fastrand::Rng) -> Self {
        let turn = rng.f32();
        Self {
            ground: hue(turn, 0.75, 0.8),
            accent: hue(turn + 0.15, 0.7, 0.95),
            name: ["CRUNCHY", "OATCAKE", "SALTINE"][rng.usize(0..3)],
            seed: rng.u32(..),
        }
    }

    /// A cracker: a biscuit disc with holes, centre at the origin of `(u, v)`, radius `r`.
    fn cracker(&self, u: f32, v: f32, r: f32) -> Option<Rgb> {
        let edge = r * (1.0 + 0.04 * (v.atan2(u) * 18.0).sin());
        if u.hypot(v) > edge {
            return None;
        }
        let hole = (u.rem_euclid(r * 0.4) - r * 0.2).hypot(v.rem_euclid(r * 0.4) - r * 0.2) < r * 0.045;
        let bake = clouds(Vec3::new(u * 150.0, v * 150.0, r * 900.0), self.seed);
        Some(if hole { [0.45, 0.28, 0.12] } else { mix([0.88, 0.7, 0.42], [0.66, 0.43, 0.2], bake) })
    }

    /// Front and back: `u` to the right, `z` up.
    fn front(&self, u: f32, z: f32, back: bool) -> Rgb {
        let height = 0.021;
        let start = -0.5 * word_width(self.name) * height;
        let top = if back { 0.165 } else { 0.155 };
        if word((u - start) / height, (z - top) / height, self.name) {
            return [0.97, 0.96, 0.9];
        }
        if word((u - start + 0.002) / height, (z - top + 0.002) / height, self.name) {
            return scale(self.ground, 0.4);
        }
        if back {
            if u.abs() < 0.064 && (0.06..0.15).contains(&z) {
                let rows = small_print(u, z, 0.0055, self.seed ^ 8);
                return if rows { [0.15, 0.13, 0.12] } else { [0.95, 0.94, 0.9] };
            }
            let chart = (z - 0.015) < 0.03 * noise(Vec3::new((u * 90.0).floor(), 0.5, 0.5), self.seed);
            return if (0.015..0.05).contains(&z) && chart { self.accent } else { self.ground };
        }
        for (du, dv, r) in [(-0.031, 0.105, 0.034), (0.028, 0.078, 0.037), (-0.022, 0.045, 0.033)] {
            if let Some(paint) = self.cracker(u - du, z - dv, r) {
                return paint;
            }
        }
        if word((u - 0.012) / 0.010, (z - 0.018) / 0.010, "SEASALT") {
            return [0.97, 0.96, 0.9];
        }
        let ray = stripe((z - 0.08).atan2(u), 0.35, 0.5);
        if ray { self.ground } else { mix(self.ground, self.accent, 0.45) }
    }

    /// The narrow sides: table of numbers on one, a price code on the other.
    fn side(&self, v: f32, z: f32, right: bool) -> Rgb {
        if v.abs() < 0.024 && (0.05..0.155).contains(&z) {
            if right {
                let rule = stripe(z, 0.0075, 0.08);
                return if rule || small_print(v, z, 0.0075, self.seed) {
                    [0.1, 0.1, 0.1]
                } else {
                    [0.96, 0.95, 0.92]
                };
            }
            if (0.055..0.085).contains(&z) {
                return if bars((v + 0.024) / 0.0011, self.seed) {
                    [0.12, 0.12, 0.12]
                } else {
                    [0.97, 0.97, 0.97]
                };
            }
            return if stripe(v + z, 0.012, 0.5) { self.accent } else { self.ground };
        }
        if word((v + 0.022) / 0.012, (z - 0.172) / 0.012, "OATS") { [0.97, 0.96, 0.9] } else { self.ground }
    }
}

impl Shape for Crackerbox {
    fn distance(&self, p: Vec3) -> f32 {
        rounded_box(p - Vec3::new(0.0, 0.0, HALF[2]), Vec3::from(HALF), 0.002)
    }

    fn color(&self, p: Vec3) -> Rgb {
        let q = p - Vec3::new(0.0, 0.0, HALF[2]);
        let reach = [HALF[0] - q.x.abs(), HALF[1] - q.y.abs(), HALF[2] - q.z.abs()];
        if reach[2] <= reach[0] && reach[2] <= reach[1] {
            let flap = (q.y.abs() < 0.0008) || (q.x.abs() > 0.05 && stripe(q.x, 0.006, 0.5));
            return if flap { scale(self.ground, 0.6) } else { scale(self.accent, 0.9) };
        }
        if reach[1] <= reach[0] {
            return if q.y < 0.0 { self.front(p.x, p.z, false) } else { self.front(-p.x, p.z, true) };
        }
        self.side(if q.x > 0.0 { p.y } else { -p.y }, p.z, q.x > 0.0)
    }

    fn gloss(&self, _: Vec3) -> f32 {
        0.15
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::new(-HALF[0], -HALF[1], 0.0), Vec3::new(HALF[0], HALF[1], 2.0 * HALF[2]))
    }
}
