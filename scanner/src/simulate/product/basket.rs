//! A small woven basket with a thin arched handle and a ribbon.

use std::f32::consts::TAU;

use super::Shape;
use crate::simulate::sdf::{Turned, Vec3, smooth_union, torus};
use crate::simulate::texture::{Rgb, clouds, hue, scale, stripe};

/// Radius of the handle's arch and of its rod, metres.
const ARCH: f32 = 0.066;
const ROD: f32 = 0.0042;

pub(super) struct Basket {
    wall: Turned,
    straw: Rgb,
    ribbon: Rgb,
    seed: u32,
}

impl Basket {
    pub(super) fn new(rng: &mut fastrand::Rng) -> Self {
        let wall = Turned::new(
            &[[0.0, 1.5], [51.0, 1.5], [66.5, 72.0], [65.0, 73.5], [63.5, 72.0], [48.5, 4.5], [0.0, 4.5]],
            0.001,
        );
        let turn = rng.f32();
        Self {
            wall,
            straw: hue(0.09 + 0.04 * turn, 0.5, 0.78),
            ribbon: hue(turn, 0.8, 0.75),
            seed: rng.u32(..),
        }
    }
}

/// The arch stands in the xz plane on the rim; the frame turns it into a ring about z.
fn handle(p: Vec3) -> f32 {
    let q = Vec3::new(p.x, (p.z - 0.070) / 1.45, p.y);
    let ring = torus(q, ARCH, ROD);
    ring.max(0.066 - p.z)
}

/// A bow where the handle meets the rim at +x.
fn bow(p: Vec3) -> f32 {
    let q = p - Vec3::new(ARCH + 0.004, 0.0, 0.074);
    let side = Vec3::new(q.x, q.y.abs() - 0.012, q.z - 0.003);
    smooth_union(side.component_div(&Vec3::new(0.5, 1.1, 0.8)).norm() * 0.5 - 0.005, q.norm() - 0.007, 0.003)
}

impl Shape for Basket {
    fn distance(&self, p: Vec3) -> f32 {
        let weave = 0.0005 * ((p.z * TAU / 0.009).sin() * (p.y.atan2(p.x) * 20.0).sin());
        let wall = self.wall.distance(p, 0.0015) - weave;
        smooth_union(wall.min(handle(p)), bow(p), 0.002)
    }

    fn color(&self, p: Vec3) -> Rgb {
        let angle = p.y.atan2(p.x);
        if bow(p) < 0.001 {
            return scale(self.ribbon, 0.8 + 0.35 * clouds(p * 200.0, self.seed));
        }
        if p.z > 0.0755 {
            let arc = (p.z - 0.070).atan2(p.x);
            return if stripe(arc, 0.28, 0.5) { self.ribbon } else { scale(self.straw, 0.85) };
        }
        let over = stripe(angle, TAU / 20.0, 0.5) == stripe(p.z, 0.009, 0.5);
        let straw = scale(
            self.straw,
            (0.7 + 0.5 * clouds(Vec3::new(angle * 60.0, p.z * 300.0, 0.0), self.seed))
                * if over { 1.0 } else { 0.72 },
        );
        if p.xy().norm() < 0.045 && p.z < 0.01 {
            let check = stripe(p.x, 0.016, 0.5) == stripe(p.y, 0.016, 0.5);
            let corner = p.x > 0.016 && p.y > 0.0;
            return if corner {
                self.ribbon
            } else if check {
                [0.9, 0.88, 0.82]
            } else {
                scale(self.ribbon, 0.8)
            };
        }
        let band = (0.030..0.048).contains(&p.z);
        if band && clouds(Vec3::new(angle.cos() * 3.0, angle.sin() * 3.0, 0.0), self.seed ^ 4) > 0.5 {
            return if over { self.ribbon } else { scale(self.ribbon, 0.7) };
        }
        straw
    }

    fn gloss(&self, _: Vec3) -> f32 {
        0.05
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::new(-0.071, -0.068, 0.0), Vec3::new(0.078, 0.068, 0.173))
    }
}
