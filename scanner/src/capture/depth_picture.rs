//! Depth as a picture for people: coloured by distance, black where nothing was measured, grey where it will be cut away.

use reconstruct::image::ColorImage;

/// Distances at the two ends of the colours, metres.
const NEAR: f32 = 0.4;
const FAR: f32 = 1.8;
/// From near to far: red, yellow, green, cyan, blue; evenly spaced.
const COLORS: [[f32; 3]; 5] = [
    [214.0, 60.0, 46.0],
    [240.0, 190.0, 60.0],
    [80.0, 176.0, 90.0],
    [60.0, 170.0, 200.0],
    [50.0, 80.0, 170.0],
];

/// Draws depth (metres, 0 or NaN = none) with what is kept; `keep` is empty where nothing is known of the cut.
pub fn draw(depth: &[f32], keep: &[bool], width: usize, height: usize) -> ColorImage {
    let pixel = |(i, &z): (usize, &f32)| {
        if z.is_nan() || z <= 0.0 {
            return [0; 3];
        }
        let color = color_of(z);
        if keep.get(i).copied().unwrap_or(true) { color } else { grayed(color) }
    };
    ColorImage { width, height, data: depth.iter().enumerate().map(pixel).collect() }
}

fn color_of(metres: f32) -> [u8; 3] {
    let place = ((metres - NEAR) / (FAR - NEAR)).clamp(0.0, 1.0) * (COLORS.len() - 1) as f32;
    let index = (place as usize).min(COLORS.len() - 2);
    let share = place - index as f32;
    std::array::from_fn(|k| (COLORS[index][k] * (1.0 - share) + COLORS[index + 1][k] * share).round() as u8)
}

/// Still lighter and darker with distance, but without colour and dim.
fn grayed([r, g, b]: [u8; 3]) -> [u8; 3] {
    let gray = (u32::from(r) * 30 + u32::from(g) * 59 + u32::from(b) * 11) / 100;
    [(40 + gray / 3) as u8; 3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_red_far_is_blue_nothing_is_black_and_cut_is_grey() {
        let picture =
            draw(&[0.3, 5.0, 0.0, f32::NAN, 0.8, 0.8], &[true, true, true, true, true, false], 6, 1);
        assert!(picture.data[0][0] > 200 && picture.data[1][2] > 150);
        assert_eq!(&picture.data[2..4], [[0; 3]; 2]);
        let ([r, g, b], [x, y, z]) = (picture.data[4], picture.data[5]);
        assert!(r != g && g != b && x == y && y == z && x > 0);
        assert_eq!(draw(&[0.8], &[], 1, 1).data[0], [r, g, b]);
    }
}
