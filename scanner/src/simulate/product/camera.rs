//! A compact camera: leather on a box, a lens barrel, a viewfinder hump and buttons.

use std::f32::consts::TAU;

use super::Shape;
use crate::simulate::sdf::{Vec3, cylinder, rounded_box, smooth_union};
use crate::simulate::texture::{Rgb, clouds, hue, mix, noise, scale, stripe, word};

pub(super) struct Camera {
    leather: Rgb,
    metal: Rgb,
    accent: Rgb,
    seed: u32,
}

impl Camera {
    pub(super) fn new(rng: &mut fastrand::Rng) -> Self {
        let turn = rng.f32();
        Self {
            leather: hue(turn, 0.55, 0.42),
            metal: [0.74, 0.75, 0.78],
            accent: hue(turn + 0.35, 0.9, 0.8),
            seed: rng.u32(..),
        }
    }
}

/// The lens looks along -y; this turns it so that the barrel's axis is z.
fn along_lens(p: Vec3) -> Vec3 {
    Vec3::new(p.x - 0.008, p.z - 0.036, -(p.y + 0.022))
}

impl Shape for Camera {
    fn distance(&self, p: Vec3) -> f32 {
        let body = rounded_box(p - Vec3::new(0.0, 0.0, 0.037), Vec3::new(0.062, 0.021, 0.037), 0.006);
        let grip = rounded_box(p - Vec3::new(-0.048, -0.022, 0.034), Vec3::new(0.011, 0.010, 0.031), 0.008);
        let hump = rounded_box(p - Vec3::new(0.008, 0.0, 0.078), Vec3::new(0.021, 0.018, 0.011), 0.005);
        let l = along_lens(p);
        let base = cylinder(l - Vec3::new(0.0, 0.0, 0.008), 0.031, 0.010, 0.002);
        let barrel = cylinder(l - Vec3::new(0.0, 0.0, 0.020), 0.027, 0.018, 0.002);
        let glass = cylinder(l - Vec3::new(0.0, 0.0, 0.040), 0.022, 0.008, 0.001);
        let shutter = cylinder(p - Vec3::new(-0.045, -0.006, 0.076), 0.0065, 0.005, 0.001);
        let dial = cylinder(p - Vec3::new(0.047, 0.0, 0.076), 0.011, 0.006, 0.001);
        let case = smooth_union(smooth_union(body, grip, 0.006), hump, 0.005);
        smooth_union(base, case, 0.004).min(barrel).max(-glass).min(shutter).min(dial)
    }

    fn color(&self, p: Vec3) -> Rgb {
        let l = along_lens(p);
        let r = l.xy().norm();
        if l.z > 0.0025 && r < 0.033 {
            return self.lens(l, r);
        }
        if p.z > 0.0745 && (p.x + 0.045).hypot(p.y + 0.006) < 0.0075 {
            return self.accent;
        }
        if p.z > 0.0745 && (p.x - 0.047).hypot(p.y) < 0.0115 {
            let tick = stripe(p.y.atan2(p.x - 0.047), TAU / 12.0, 0.2);
            return if tick { [0.95, 0.95, 0.95] } else { [0.3, 0.3, 0.32] };
        }
        if p.z > 0.0665 || p.z < 0.006 {
            if p.z > 0.07 && p.y < -0.012 && word((p.x + 0.006) / 0.0085, (p.z - 0.0745) / 0.0085, "KINO") {
                return [0.15, 0.15, 0.17];
            }
            return scale(
                self.metal,
                0.92 + 0.12 * noise(Vec3::new(p.x * 900.0, p.y * 60.0, p.z * 60.0), self.seed),
            );
        }
        if p.y > 0.0195 {
            return self.back(p);
        }
        if p.y < -0.019
            && (0.052..0.06).contains(&p.z)
            && word((p.x - 0.041) / 0.008, (p.z - 0.052) / 0.008, "AR")
        {
            return self.accent;
        }
        let grain = clouds(p * 350.0, self.seed);
        scale(self.leather, 0.65 + 0.7 * grain)
    }

    fn gloss(&self, p: Vec3) -> f32 {
        let l = along_lens(p);
        if l.z > 0.02 && l.xy().norm() < 0.022 { 1.0 } else { 0.25 }
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::new(-0.063, -0.062, 0.0), Vec3::new(0.063, 0.022, 0.09))
    }
}

impl Camera {
    fn lens(&self, l: Vec3, r: f32) -> Rgb {
        let angle = l.y.atan2(l.x);
        if l.z > 0.03 && r < 0.0215 {
            let reflex = (l.x - 0.006).hypot(l.y - 0.007) < 0.006;
            let coat = mix([0.20, 0.16, 0.34], [0.30, 0.42, 0.50], (r / 0.0215).powi(2));
            return if reflex { [0.8, 0.86, 0.95] } else { coat };
        }
        if l.z > 0.0345 {
            let ink = stripe(angle, TAU / 3.0, 0.5)
                && stripe(angle, TAU / 60.0, 0.55)
                && (0.0232..0.0256).contains(&r);
            return if ink { [0.9, 0.9, 0.9] } else { [0.24, 0.24, 0.26] };
        }
        if (0.019..0.031).contains(&l.z) && r > 0.0255 {
            let ridge = stripe(angle, TAU / 48.0, 0.5);
            return if ridge { [0.2, 0.2, 0.22] } else { [0.38, 0.38, 0.4] };
        }
        if stripe(angle - 0.3, TAU, 0.06) { self.accent } else { scale(self.metal, 0.85) }
    }

    /// The back: a screen with a picture and a row of buttons.
    fn back(&self, p: Vec3) -> Rgb {
        if (p.x + 0.014).abs() < 0.034 && (p.z - 0.036).abs() < 0.023 {
            let sky = mix([0.35, 0.55, 0.85], [0.8, 0.88, 0.95], ((0.06 - p.z) * 25.0).clamp(0.0, 1.0));
            let hill = 0.03 + 0.012 * noise(Vec3::new(p.x * 70.0, 0.0, 0.0), self.seed);
            let rim = (p.x + 0.014).abs() > 0.032 || (p.z - 0.036).abs() > 0.021;
            return if rim {
                [0.2, 0.2, 0.2]
            } else if p.z < hill {
                [0.35, 0.55, 0.25]
            } else {
                sky
            };
        }
        let button = (p.x - 0.041).hypot((p.z - 0.016).rem_euclid(0.014) - 0.007) < 0.0042;
        if button { self.metal } else { scale(self.leather, 0.9) }
    }
}
