//! sRGB transfer (IEC 61966-2-1): 8-bit sRGB to linear light and back.

/// Linear light from 0 to 1 of an 8-bit sRGB value.
pub(super) fn linear(srgb: u8) -> f64 {
    let v = f64::from(srgb) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The nearest 8-bit sRGB value of linear light; what lies outside of 0 to 1 is clamped.
pub(super) fn srgb(linear: f64) -> u8 {
    let v = linear.clamp(0.0, 1.0);
    let encoded = if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

/// Sixteen-bit linear values of all 8-bit sRGB values.
pub(super) fn linear_table() -> [u16; 256] {
    std::array::from_fn(|v| (linear(v as u8) * 65535.0).round() as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tone_comes_back_from_sixteen_bits() {
        for (v, &wide) in linear_table().iter().enumerate() {
            assert_eq!(usize::from(srgb(f64::from(wide) / 65535.0)), v);
        }
        assert_eq!((srgb(f64::NAN), srgb(-1.0), srgb(7.0)), (0, 0, 255));
    }
}
