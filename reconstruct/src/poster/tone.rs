//! Light: sRGB to linear and back, shading, exposure.

use std::sync::LazyLock;

static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|v| {
        let v = v as f32 / 255.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    })
});

static SRGB: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let steps = 4096;
    let encode = |i: usize| {
        let v = i as f32 / (steps - 1) as f32;
        let encoded = if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
        (encoded * 255.0).round() as u8
    };
    (0..steps).map(encode).collect()
});

/// Linear light of an 8-bit sRGB value.
pub(super) fn linear(srgb: u8) -> f32 {
    LINEAR[usize::from(srgb)]
}

/// The 8-bit sRGB value of linear light.
pub(super) fn srgb(linear: f32) -> u8 {
    SRGB[(linear.clamp(0.0, 1.0) * (SRGB.len() - 1) as f32).round() as usize]
}

/// Light from the upper left, in the camera frame; scanned colours already hold some light and get little.
pub(super) fn shade(normal: [f32; 3], colored: bool) -> f32 {
    const TO_LIGHT: [f32; 3] = [-0.42, -0.68, -0.60];
    if normal == [0.0; 3] {
        return 1.0;
    }
    // A normal that looks away belongs to a surface seen from behind.
    let side = if normal[2] > 0.0 { -1.0 } else { 1.0 };
    let facing: f32 = normal.iter().zip(TO_LIGHT).map(|(n, l)| side * n * l).sum();
    let wrapped = (0.5 + 0.5 * facing).clamp(0.0, 1.0);
    if colored { 0.62 + 0.43 * wrapped } else { 0.18 + 0.92 * wrapped * wrapped }
}

/// A mild exposure that brings the bright parts of a dark scan near white.
pub(super) fn gain(colors: &[[u8; 3]]) -> f32 {
    let mut bright: Vec<u8> =
        colors.iter().step_by(1 + colors.len() / 20_000).map(|c| c[0].max(c[1]).max(c[2])).collect();
    let place = bright.len() * 95 / 100;
    let (_, &mut high, _) = bright.select_nth_unstable(place);
    (0.85 / linear(high).max(1e-3)).clamp(1.0, 1.5)
}
