//! Tags drawn for the tests: exact corners, anti-aliased, blurred, with noise.

use nalgebra::{Matrix3, Point2};

use super::dictionary::Dictionary;
use super::homography::{apply, from_unit_square};
use crate::image::GrayImage;

/// Samples a side in every pixel.
const SUPERSAMPLING: usize = 5;

/// A white picture to draw tags on.
pub(super) struct Canvas {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

impl Canvas {
    pub(super) fn white(width: usize, height: usize) -> Self {
        Self { width, height, values: vec![230.0; width * height] }
    }

    /// Draws a tag whose upright corners lie at given pixels, by supersampling the true picture.
    pub(super) fn draw(&mut self, dictionary: &Dictionary, id: u32, corners: &[Point2<f64>; 4]) {
        let square_from_pixel = from_unit_square(corners).unwrap().try_inverse().unwrap();
        let bound = |pick: fn(&Point2<f64>) -> f64, limit: usize| {
            let low = corners.iter().map(pick).fold(f64::INFINITY, f64::min).floor().max(0.0) as usize;
            let high = corners.iter().map(pick).fold(0.0, f64::max).ceil().min(limit as f64 - 1.0) as usize;
            low..=high
        };
        for y in bound(|p| p.y, self.height) {
            for x in bound(|p| p.x, self.width) {
                let value = &mut self.values[y * self.width + x];
                *value = pixel(dictionary, id, &square_from_pixel, x, y, *value);
            }
        }
    }

    /// The picture after a Gaussian blur and white noise, in 8 bits.
    pub(super) fn picture(&self, blur_px: f64, noise: f64, seed: u64) -> GrayImage {
        let mut rng = fastrand::Rng::with_seed(seed);
        let blurred = blur(&blur(&self.values, self.width, 1, blur_px), self.width, self.width, blur_px);
        let noisy = blurred.iter().map(|v| (v + noise * gaussian(&mut rng)).round().clamp(0.0, 255.0) as u8);
        GrayImage { width: self.width, height: self.height, data: noisy.collect() }
    }
}

fn pixel(
    dictionary: &Dictionary,
    id: u32,
    square_from_pixel: &Matrix3<f64>,
    x: usize,
    y: usize,
    background: f64,
) -> f64 {
    let n = dictionary.cells() as f64;
    let mut sum = 0.0;
    for k in 0..SUPERSAMPLING * SUPERSAMPLING {
        let at = |i: usize| (i as f64 + 0.5) / SUPERSAMPLING as f64 - 0.5;
        let place = Point2::new(x as f64 + at(k % SUPERSAMPLING), y as f64 + at(k / SUPERSAMPLING));
        let cell = apply(square_from_pixel, &place) * n;
        let inside = cell.x >= 0.0 && cell.y >= 0.0 && cell.x < n && cell.y < n;
        let white = inside.then(|| dictionary.is_white(id, cell.y as usize, cell.x as usize)).flatten();
        sum += match white {
            None => background,
            Some(true) => 225.0,
            Some(false) => 30.0,
        };
    }
    sum / (SUPERSAMPLING * SUPERSAMPLING) as f64
}

/// Blur along one axis (`step` 1: rows, `step` = width: columns).
fn blur(values: &[f64], width: usize, step: usize, sigma: f64) -> Vec<f64> {
    if sigma <= 0.0 {
        return values.to_vec();
    }
    let reach = (3.0 * sigma).ceil() as isize;
    let weights: Vec<f64> = (-reach..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let total: f64 = weights.iter().sum();
    let (count, height) = (values.len() as isize, values.len() / width);
    (0..values.len())
        .map(|i| {
            let (line, place) = if step == 1 { (width, i % width) } else { (height, i / width) };
            let sum: f64 = (-reach..=reach)
                .map(|k| {
                    let clamped = (place as isize + k).clamp(0, line as isize - 1) - place as isize;
                    let at = (i as isize + clamped * step as isize).clamp(0, count - 1);
                    weights[(k + reach) as usize] * values[at as usize]
                })
                .sum();
            sum / total
        })
        .collect()
}

fn gaussian(rng: &mut fastrand::Rng) -> f64 {
    (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (std::f64::consts::TAU * rng.f64()).cos()
}
