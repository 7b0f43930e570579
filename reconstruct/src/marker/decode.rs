//! Reading the code of a quadrilateral: cells are sampled through its homography and compared with the middle between
//! the black of the border and the white around it, both of which may change over the tag (as AprilTag 2).

use nalgebra::{Matrix3, Point2, Vector3};

use super::dictionary::{Decoded, Dictionary};
use super::edge::Lens;
use super::homography::{apply, from_unit_square};
use crate::image::GrayImage;

/// Places inside a cell where it is sampled, in cells from its middle.
const PROBES: [[f64; 2]; 5] = [[0.0, 0.0], [-0.22, -0.22], [0.22, -0.22], [0.22, 0.22], [-0.22, 0.22]];
/// Share of the white samples around the tag that must be white.
const MIN_WHITE_SHARE: f64 = 0.75;
/// Share of border cells that may not be black.
const MAX_BORDER_ERRORS: f64 = 0.07;
/// Cells below this many pixels run into each other and are read a second time sharpened.
const SMALL_CELL_PX: f64 = 4.0;
/// Sharpening of small cells: how much of the difference to the four neighbours is added.
const SHARPENING: [f64; 2] = [0.15, 0.3];
/// Mean distance of the bits from the threshold, 1 = as black and white as border and surrounding.
const MIN_CLARITY: f64 = 0.45;
/// No bit may be nearer to the threshold than this in families whose codes leave no room for errors.
const MIN_BIT_CLARITY: f64 = 0.12;

/// What was read inside a quadrilateral.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reading {
    pub(super) decoded: Decoded,
    /// Mean distance of the bits from the threshold, 1 = ideal.
    pub(super) clarity: f64,
}

/// The grey picture around one quadrilateral, addressed in cells: (0, 0) to (n, n) is the black square.
struct CellSampler<'a> {
    image: &'a GrayImage,
    lens: Lens<'a>,
    plane_from_square: Matrix3<f64>,
    cells: usize,
}

impl CellSampler<'_> {
    /// Grey value at a place in cells; `None` outside of the picture.
    fn at(&self, x: f64, y: f64) -> Option<f64> {
        let n = self.cells as f64;
        let pixel = self.lens.bend(&apply(&self.plane_from_square, &Point2::new(x / n, y / n)));
        bilinear(self.image, &pixel)
    }
}

/// Grey value between pixels; `None` outside of the picture.
fn bilinear(image: &GrayImage, p: &Point2<f64>) -> Option<f64> {
    let (x0, y0) = (p.x.floor(), p.y.floor());
    let inside = x0 >= 0.0 && y0 >= 0.0 && x0 < image.width as f64 - 1.0 && y0 < image.height as f64 - 1.0;
    if !inside {
        return None;
    }
    let (fx, fy) = (p.x - x0, p.y - y0);
    let base = y0 as usize * image.width + x0 as usize;
    let value = |offset: usize| f64::from(image.data[base + offset]);
    let (top, bottom) = (
        value(0) * (1.0 - fx) + value(1) * fx,
        value(image.width) * (1.0 - fx) + value(image.width + 1) * fx,
    );
    Some(top * (1.0 - fy) + bottom * fy)
}

/// Grey level that changes linearly over the tag.
#[derive(Default)]
struct LevelFit {
    normal: Matrix3<f64>,
    right: Vector3<f64>,
    count: usize,
}

impl LevelFit {
    fn add(&mut self, x: f64, y: f64, value: f64) {
        let row = Vector3::new(x, y, 1.0);
        self.normal += row * row.transpose();
        self.right += row * value;
        self.count += 1;
    }

    /// Coefficients of x, y, 1; a constant where the samples do not carry a slope.
    fn solve(&self) -> Option<Vector3<f64>> {
        if self.count < 4 {
            return None;
        }
        let mut damped = self.normal;
        damped[(0, 0)] += 0.5;
        damped[(1, 1)] += 0.5;
        damped.try_inverse().map(|inverse| inverse * self.right)
    }
}

/// Reads the tag whose corners are given clockwise in straightened pixels.
pub(super) fn read(
    image: &GrayImage,
    lens: Lens<'_>,
    corners: &[Point2<f64>; 4],
    dictionary: &Dictionary,
    min_contrast: f64,
) -> Option<Reading> {
    let cells = dictionary.cells();
    let sampler = CellSampler { image, lens, plane_from_square: from_unit_square(corners)?, cells };
    let levels = Levels::measure(&sampler, min_contrast)?;
    let n = dictionary.payload_cells;
    let clarity = levels.payload(&sampler, n)?;
    let perimeter: f64 = (0..4).map(|k| (corners[(k + 1) % 4] - corners[k]).norm()).sum();
    let cell_px = perimeter / (4.0 * cells as f64);
    if let Some(reading) = judge(&clarity, dictionary) {
        return Some(reading);
    }
    if cell_px >= SMALL_CELL_PX {
        return None;
    }
    SHARPENING.iter().find_map(|&amount| judge(&sharpened(&clarity, n, amount), dictionary))
}

/// The reading of signed bits, if it is clear enough and the dictionary has the code.
fn judge(bits: &[f64], dictionary: &Dictionary) -> Option<Reading> {
    let clarity = bits.iter().map(|b| b.abs().min(1.0)).sum::<f64>() / bits.len() as f64;
    let weakest = bits.iter().fold(f64::INFINITY, |w, b| w.min(b.abs()));
    if clarity < MIN_CLARITY || (dictionary.max_bit_errors == 0 && weakest < MIN_BIT_CLARITY) {
        return None;
    }
    let code = bits.iter().fold(0, |code, &bit| (code << 1) | u64::from(bit > 0.0));
    dictionary.decode(code).map(|decoded| Reading { decoded, clarity })
}

/// Every cell moved away from its four neighbours; the border counts as black.
fn sharpened(bits: &[f64], n: usize, amount: f64) -> Vec<f64> {
    let at = |r: usize, c: usize| {
        if (1..=n).contains(&r) && (1..=n).contains(&c) { bits[(r - 1) * n + c - 1] } else { -1.0 }
    };
    (0..n * n)
        .map(|i| {
            let (r, c) = (i / n + 1, i % n + 1);
            let around = at(r - 1, c) + at(r + 1, c) + at(r, c - 1) + at(r, c + 1);
            at(r, c) + amount * (4.0 * at(r, c) - around)
        })
        .collect()
}

/// Black of the border and white of the surrounding, linear over the tag.
struct Levels {
    black: Vector3<f64>,
    white: Vector3<f64>,
}

impl Levels {
    fn measure(sampler: &CellSampler<'_>, min_contrast: f64) -> Option<Self> {
        let n = sampler.cells as f64;
        let ring = |inset: f64| {
            (0..sampler.cells).flat_map(move |k| {
                let s = k as f64 + 0.5;
                [(s, inset), (n - inset, s), (n - s, n - inset), (inset, n - s)]
            })
        };
        let fit = |inset: f64| {
            let mut level = LevelFit::default();
            for (x, y) in ring(inset) {
                if let Some(value) = sampler.at(x, y) {
                    level.add(x / n - 0.5, y / n - 0.5, value);
                }
            }
            level.solve()
        };
        let levels = Self { black: fit(0.5)?, white: fit(-0.5)? };
        if levels.white.z - levels.black.z < min_contrast {
            return None;
        }
        let share = |inset: f64, white: bool| {
            let (mut right, mut all) = (0.0, 0.0);
            for (x, y) in ring(inset) {
                if let Some(value) = sampler.at(x, y) {
                    all += 1.0;
                    right += f64::from(u8::from((levels.signed(x / n, y / n, value) > 0.0) == white));
                }
            }
            if all > 0.0 { right / all } else { 0.0 }
        };
        (share(-0.5, true) >= MIN_WHITE_SHARE && share(0.5, false) >= 1.0 - MAX_BORDER_ERRORS)
            .then_some(levels)
    }

    /// -1 = black, +1 = white at a place of the unit square.
    fn signed(&self, x: f64, y: f64, value: f64) -> f64 {
        let row = Vector3::new(x - 0.5, y - 0.5, 1.0);
        let (black, white) = (self.black.dot(&row), self.white.dot(&row));
        (2.0 * value - black - white) / (white - black).max(1.0)
    }

    /// Signed bits of the payload, row-major; `None` where a cell is outside of the picture.
    fn payload(&self, sampler: &CellSampler<'_>, n: usize) -> Option<Vec<f64>> {
        let cells = sampler.cells as f64;
        (0..n * n)
            .map(|i| {
                let (x, y) = ((i % n) as f64 + 1.5, (i / n) as f64 + 1.5);
                let mut sum = 0.0;
                for [dx, dy] in PROBES {
                    let value = sampler.at(x + dx, y + dy)?;
                    sum += self.signed((x + dx) / cells, (y + dy) / cells, value);
                }
                Some(sum / PROBES.len() as f64)
            })
            .collect()
    }
}
