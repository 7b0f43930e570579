//! A sauce bottle: turned on a lathe, so that only its label tells its sides apart.

use std::f32::consts::{PI, TAU};

use super::Shape;
use crate::simulate::sdf::{Turned, Vec3};
use crate::simulate::texture::{Rgb, bars, clouds, hue, mix, scale, small_print, stripe, word, word_width};

/// Radius of the label's cylinder, metres.
const RADIUS: f32 = 0.035;

pub(super) struct Bottle {
    outline: Turned,
    sauce: Rgb,
    label: Rgb,
    cap: Rgb,
    name: &'static str,
    seed: u32,
}

impl Bottle {
    pub(super) fn new(rng: &mut fastrand::Rng) -> Self {
        let outline = Turned::new(
            &[
                [0.0, 2.0],
                [28.0, 2.0],
                [32.5, 6.0],
                [33.0, 24.0],
                [33.0, 108.0],
                [31.0, 122.0],
                [24.0, 136.0],
                [15.0, 148.0],
                [12.0, 158.0],
                [11.5, 182.0],
                [14.0, 183.0],
                [14.0, 206.0],
                [12.0, 208.0],
                [0.0, 208.0],
            ],
            0.001,
        );
        let turn = rng.f32();
        Self {
            outline,
            sauce: hue(turn, 0.75, 0.5),
            label: hue(turn + 0.12 + 0.2 * rng.f32(), 0.25, 0.95),
            cap: hue(turn + 0.5, 0.8, 0.75),
            name: ["TOMATO", "CURRY", "PESTO", "OLIVE"][rng.usize(0..4)],
            seed: rng.u32(..),
        }
    }

    fn label_paint(&self, along: f32, z: f32, p: Vec3) -> Rgb {
        let ink = scale(self.sauce, 0.55);
        if stripe(z - 0.024, 0.084, 0.06) || stripe(z - 0.098, 0.084, 0.05) {
            return self.cap;
        }
        let height = 0.017;
        let start = -0.5 * word_width(self.name) * height;
        if word((along - start) / height, (z - 0.078) / height, self.name) {
            return ink;
        }
        if word((along + 0.022) / 0.007, (z - 0.067) / 0.007, "SAUCE") {
            return self.cap;
        }
        let spot = ((along.powi(2) + (z - 0.046).powi(2)).sqrt() - 0.013).abs();
        if spot < 0.0018
            || (along.abs() < 0.009 && stripe(along + z, 0.006, 0.4) && (z - 0.046).abs() < 0.009)
        {
            return self.sauce;
        }
        if (0.045..0.085).contains(&along)
            && (0.034..0.092).contains(&z)
            && small_print(along, z, 0.0045, self.seed)
        {
            return scale(ink, 0.8);
        }
        if (-0.085..-0.05).contains(&along)
            && (0.034..0.056).contains(&z)
            && bars((along + 0.085) / 0.0009, self.seed)
        {
            return [0.12, 0.12, 0.12];
        }
        if (-0.083..-0.052).contains(&along)
            && (0.064..0.092).contains(&z)
            && clouds(p * 110.0, self.seed) > 0.5
        {
            return self.cap;
        }
        self.label
    }
}

impl Shape for Bottle {
    fn distance(&self, p: Vec3) -> f32 {
        self.outline.distance(p, 0.002)
    }

    fn color(&self, p: Vec3) -> Rgb {
        let angle = p.y.atan2(p.x);
        if p.z > 0.183 {
            let ridge = stripe(angle, TAU / 36.0, 0.5) && p.z < 0.206;
            return scale(self.cap, if ridge { 0.75 } else { 1.0 });
        }
        if (0.026..0.106).contains(&p.z) {
            return self.label_paint(angle * RADIUS, p.z, p);
        }
        let shade = 0.8 + 0.4 * clouds(p * 60.0, self.seed ^ 9);
        let neck = ((p.z - 0.12) / 0.05).clamp(0.0, 1.0);
        let mark = p.z > 0.118 && p.z < 0.14 && stripe(angle + PI, TAU / 5.0, 0.3);
        if mark { self.label } else { mix(scale(self.sauce, shade), scale(self.label, 0.8), neck * 0.6) }
    }

    fn gloss(&self, p: Vec3) -> f32 {
        if (0.026..0.106).contains(&p.z) { 0.15 } else { 0.5 }
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::new(-0.036, -0.036, 0.0), Vec3::new(0.036, 0.036, 0.211))
    }
}
