//! A glazed bowl on a foot ring, painted inside and out.

use std::f32::consts::TAU;

use super::Shape;
use crate::simulate::sdf::{Turned, Vec3};
use crate::simulate::texture::{Rgb, clouds, hue, mix, scale, stripe};

pub(super) struct Bowl {
    wall: Turned,
    glaze: Rgb,
    paint: Rgb,
    seed: u32,
}

impl Bowl {
    pub(super) fn new(rng: &mut fastrand::Rng) -> Self {
        let wall = Turned::new(
            &[
                [0.0, 5.5],
                [27.0, 5.5],
                [28.5, 1.5],
                [32.5, 1.5],
                [34.0, 8.0],
                [52.0, 18.0],
                [66.0, 36.0],
                [74.0, 63.0],
                [72.0, 64.5],
                [70.5, 63.0],
                [62.5, 37.5],
                [49.5, 21.5],
                [32.0, 12.0],
                [20.0, 9.5],
                [0.0, 9.0],
            ],
            0.001,
        );
        let turn = rng.f32();
        Self { wall, glaze: [0.9, 0.89, 0.84], paint: hue(turn, 0.8, 0.6), seed: rng.u32(..) }
    }

    /// A fish seen from above on the bowl's floor: what tells its sides apart from inside.
    fn fish(&self, p: Vec3) -> Option<Rgb> {
        let (x, y) = (p.x - 0.004, p.y + 0.003);
        let body = (x / 0.024).hypot(y / 0.011) < 1.0;
        let tail = (-0.040..-0.020).contains(&x) && y.abs() < (-0.016 - x) * 0.55;
        if (x - 0.015).hypot(y - 0.003) < 0.0022 {
            return Some([0.95, 0.95, 0.95]);
        }
        if body {
            return Some(if stripe(x, 0.008, 0.35) { scale(self.paint, 1.5) } else { self.paint });
        }
        tail.then(|| scale(self.paint, 0.7))
    }
}

impl Shape for Bowl {
    fn distance(&self, p: Vec3) -> f32 {
        self.wall.distance(p, 0.0015)
    }

    fn color(&self, p: Vec3) -> Rgb {
        let r = p.xy().norm();
        let angle = p.y.atan2(p.x);
        let crackle = 0.94 + 0.1 * clouds(p * 150.0, self.seed);
        if p.z > 0.0625 {
            return scale(self.paint, 0.8);
        }
        if self.wall.distance(p + Vec3::new(p.x, p.y, -0.4 * r) * (0.003 / r.max(0.01)), 0.0015) < 0.0
            || r < 0.03 && p.z > 0.008
        {
            if p.z < 0.025
                && let Some(paint) = self.fish(p)
            {
                return paint;
            }
            let wave = (p.z - 0.044 - 0.004 * (angle * 9.0).sin()).abs() < 0.0022;
            let dot = (p.z - 0.032).abs() < 0.003 && stripe(angle, TAU / 14.0, 0.25);
            return if wave || dot { self.paint } else { scale(self.glaze, crackle) };
        }
        let leaf = clouds(p * 55.0, self.seed ^ 3);
        if (0.022..0.052).contains(&p.z) && leaf > 0.52 {
            return mix(self.paint, [0.25, 0.5, 0.25], f32::from(leaf > 0.6));
        }
        if stripe(p.z - 0.054, 0.1, 0.035) || stripe(p.z - 0.016, 0.1, 0.03) {
            return self.paint;
        }
        scale(self.glaze, crackle)
    }

    fn gloss(&self, _: Vec3) -> f32 {
        0.5
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::new(-0.076, -0.076, 0.0), Vec3::new(0.076, 0.076, 0.067))
    }
}
