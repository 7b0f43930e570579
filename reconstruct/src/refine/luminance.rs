//! A view's brightness, smoothed, with its slope: what the colour term compares.
//!
//! Values are 0 to 1 in the picture's own encoding, pixels of the colour camera.

use rayon::prelude::*;

use crate::image::ColorImage;

/// A smoothed grey picture, row-major.
#[derive(Debug, Clone)]
pub struct Luminance {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

/// Times the picture is smoothed by 1-2-1 both ways: about one pixel of standard deviation, so that the slope holds for as far as poses
/// from markers are off.
const PASSES: usize = 2;

impl Luminance {
    /// Brightness of a picture.
    pub fn of(color: &ColorImage) -> Self {
        let gray = color.to_gray();
        let mut values: Vec<f32> = gray.data.iter().map(|&g| f32::from(g) / 255.0).collect();
        for _ in 0..PASSES {
            values = smoothed(&values, gray.width);
        }
        Self { width: gray.width, height: gray.height, values }
    }

    /// Brightness of a pixel; 0 beyond the picture.
    pub(super) fn at(&self, pixel: usize) -> f64 {
        self.values.get(pixel).map_or(0.0, |&v| f64::from(v))
    }

    /// Brightness between pixels (bilinear), and its slope along u and v; `None` at the border.
    pub(super) fn between(&self, u: f64, v: f64) -> Option<(f64, [f64; 2])> {
        let (column, row) = (u.floor(), v.floor());
        let inside =
            column >= 0.0 && row >= 0.0 && column < self.width as f64 - 1.0 && row < self.height as f64 - 1.0;
        if !inside {
            return None;
        }
        let first = row as usize * self.width + column as usize;
        let (a, b) = (u - column, v - row);
        let [p, q, r, s] = [0, 1, self.width, self.width + 1].map(|k| f64::from(self.values[first + k]));
        let (above, below) = (p + a * (q - p), r + a * (s - r));
        let slope = [(1.0 - b) * (q - p) + b * (s - r), below - above];
        Some((above + b * (below - above), slope))
    }
}

/// 1-2-1 along the rows, then along the columns; the border keeps its value.
fn smoothed(values: &[f32], width: usize) -> Vec<f32> {
    if width < 3 || values.len() < 3 * width {
        return values.to_vec();
    }
    let mut along = values.to_vec();
    along.par_chunks_mut(width).zip(values.par_chunks(width)).for_each(|(out, row)| {
        for (out, w) in out[1..].iter_mut().zip(row.windows(3)) {
            *out = 0.25 * w[0] + 0.5 * w[1] + 0.25 * w[2];
        }
    });
    let height = along.len() / width;
    let mut out = along.clone();
    out.par_chunks_mut(width).enumerate().filter(|(row, _)| *row > 0 && row + 1 < height).for_each(
        |(row, out)| {
            let [above, here, below] = [row - 1, row, row + 1].map(|r| &along[r * width..(r + 1) * width]);
            for (u, out) in out.iter_mut().enumerate() {
                *out = 0.25 * above[u] + 0.5 * here[u] + 0.25 * below[u];
            }
        },
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_has_its_slope_everywhere_inside() {
        let mut picture = ColorImage::filled(40, 30, [0; 3]);
        for (i, pixel) in picture.data.iter_mut().enumerate() {
            *pixel = [(2 * (i % 40) + 3 * (i / 40)) as u8; 3];
        }
        let light = Luminance::of(&picture);
        let (value, slope) = light.between(12.25, 9.5).unwrap();
        assert!((value - (24.5 + 28.5) / 255.0).abs() < 1e-5, "{value}");
        assert!((slope[0] - 2.0 / 255.0).abs() < 1e-5 && (slope[1] - 3.0 / 255.0).abs() < 1e-5, "{slope:?}");
        assert_eq!(light.between(39.5, 3.0), None);
        assert_eq!(light.between(-0.1, 3.0), None);
        assert_eq!(light.between(f64::NAN, 3.0), None);
    }
}
