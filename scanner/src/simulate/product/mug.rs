//! A mug: wall of 4 mm, floor 5 mm above the board, a handle on one side.

use std::f32::consts::TAU;

use super::Shape;
use crate::simulate::sdf::{Turned, Vec3, smooth_union};
use crate::simulate::texture::{Rgb, clouds, hue, mix, scale, stripe, word, word_width};

/// Outer radius and height, metres.
const RADIUS: f32 = 0.041;
const HEIGHT: f32 = 0.096;

pub(super) struct Mug {
    wall: Turned,
    glaze: Rgb,
    band: Rgb,
    name: &'static str,
    seed: u32,
}

impl Mug {
    pub(super) fn new(rng: &mut fastrand::Rng) -> Self {
        let wall = Turned::new(
            &[
                [0.0, 1.0],
                [36.0, 1.0],
                [40.0, 5.0],
                [40.0, 95.0],
                [38.0, 95.0],
                [38.0, 9.0],
                [33.0, 4.0],
                [0.0, 4.0],
            ],
            0.001,
        );
        let turn = rng.f32();
        Self {
            wall,
            glaze: hue(turn, 0.35, 0.9),
            band: hue(turn + 0.45, 0.8, 0.6),
            name: ["COFFEE", "TEATIME", "MORNING"][rng.usize(0..3)],
            seed: rng.u32(..),
        }
    }

    fn handle(p: Vec3) -> f32 {
        // An oval ring in the xz plane, its inner part swallowed by the wall.
        let q = Vec3::new((p.x - RADIUS - 0.004) / 0.9, p.z - 0.05, p.y);
        let ring = ((q.x * q.x + q.y * q.y).sqrt() - 0.026).hypot(q.z * 0.75) - 0.0052;
        ring * 0.9
    }
}

impl Shape for Mug {
    fn distance(&self, p: Vec3) -> f32 {
        let cup = self.wall.distance(p, 0.001);
        let inside = p.xy().norm() < RADIUS - 0.002;
        if inside { cup } else { smooth_union(cup, Self::handle(p).max(0.040 - p.xy().norm()), 0.004) }
    }

    fn color(&self, p: Vec3) -> Rgb {
        let r = p.xy().norm();
        let angle = p.y.atan2(p.x);
        if r < RADIUS - 0.0015 && p.z > 0.004 {
            let ring = stripe(p.z - 0.088, 0.2, 0.02);
            let speck = clouds(p * 90.0, self.seed ^ 5);
            return if ring {
                self.band
            } else {
                mix([0.94, 0.92, 0.86], [0.72, 0.68, 0.6], (speck - 0.4).max(0.0))
            };
        }
        if r > RADIUS + 0.003 {
            return scale(self.band, 0.8 + 0.4 * clouds(p * 80.0, self.seed));
        }
        if stripe(p.z - 0.01, 0.075, 0.09) {
            return self.band;
        }
        let along = (angle + TAU * 0.25) * RADIUS;
        let start = -0.5 * word_width(self.name) * 0.014;
        if word((along - start) / 0.014, (p.z - 0.046) / 0.014, self.name) {
            return scale(self.band, 0.6);
        }
        let flower = clouds(p * 75.0, self.seed);
        if p.y > 0.0 && flower > 0.56 {
            return mix(self.band, [0.95, 0.85, 0.3], f32::from(flower > 0.66));
        }
        if (0.03..0.038).contains(&p.z) && stripe(angle, TAU / 24.0, 0.5) {
            return scale(self.glaze, 0.6);
        }
        self.glaze
    }

    fn gloss(&self, _: Vec3) -> f32 {
        0.6
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::new(-RADIUS, -RADIUS, 0.0), Vec3::new(RADIUS + 0.04, RADIUS, HEIGHT))
    }
}
