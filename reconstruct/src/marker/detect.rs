//! From a grey picture to tags with sub-pixel corners.

use nalgebra::{Point2, Vector2};

use super::decode::{Reading, read};
use super::dictionary::Dictionary;
use super::edge::Lens;
use super::outline::{Connected, for_each_outline};
use super::quad::{Quad, fit_quad};
use super::refine::{RefinedQuad, refine};
use super::threshold::black_mask;
use crate::board::Family;
use crate::camera::Intrinsics;
use crate::image::GrayImage;

/// Smallest picture that is looked at, pixels a side.
const MIN_IMAGE_SIDE: usize = 16;
/// Tags up to this mean side have a border that may be thinner than two pixels.
const SMALL_SIDE_PX: f64 = 40.0;

/// What counts as a tag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectConfig {
    /// Least difference between the black and the white of a tag, grey levels.
    pub min_contrast: u8,
    /// Shortest side of a tag, pixels.
    pub min_side_px: f64,
}

impl Default for DetectConfig {
    fn default() -> Self {
        Self { min_contrast: 20, min_side_px: 8.0 }
    }
}

/// A tag in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// Id in the family.
    pub id: u32,
    /// Top-left, top-right, bottom-right, bottom-left of the upright tag, image pixels (of the bent picture).
    pub corners: [Point2<f64>; 4],
    /// Standard deviation of each corner, pixels; infinite where the corner was not seen.
    pub corner_sigma_px: [f64; 4],
    /// Bits that differed from the published code.
    pub bit_errors: u32,
    /// Mean distance of the bits from the threshold: 1 = as black and white as the border and its surrounding.
    pub clarity: f64,
}

impl Detection {
    /// Mean length of the four sides, pixels.
    pub fn side_px(&self) -> f64 {
        (0..4).map(|k| (self.corners[(k + 1) % 4] - self.corners[k]).norm()).sum::<f64>() / 4.0
    }

    /// Mean of the corners, pixels.
    pub fn centre(&self) -> Point2<f64> {
        Point2::from(self.corners.iter().fold(Vector2::zeros(), |sum, c| sum + c.coords) / 4.0)
    }
}

/// All tags of a family in a picture, by id, then top to bottom. The same id may be found more than once.
///
/// With a `camera` whose lens bends, sides are taken as straight in undistorted coordinates; corners are always given
/// in pixels of the picture. A picture whose size does not match its data has no tags.
pub fn detect(
    image: &GrayImage,
    dictionary: &Dictionary,
    camera: Option<&Intrinsics>,
    config: &DetectConfig,
) -> Vec<Detection> {
    let lens = Lens::of(camera);
    let found = find_quads(image, config)
        .iter()
        .filter_map(|quad| recognise(image, lens, quad, dictionary, config))
        .collect();
    without_duplicates(found)
}

/// How many tags of every other family a picture holds, most first: to name the board that was used instead.
pub fn other_families(
    image: &GrayImage,
    family: Family,
    camera: Option<&Intrinsics>,
    config: &DetectConfig,
) -> Vec<(Family, usize)> {
    let others = Family::ALL.into_iter().filter(|&f| f != family);
    let mut counts: Vec<_> = others
        .map(|f| (f, detect(image, Dictionary::of(f), camera, config).len()))
        .filter(|&(_, count)| count > 0)
        .collect();
    counts.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    counts
}

fn find_quads(image: &GrayImage, config: &DetectConfig) -> Vec<Quad> {
    let sized = image.width.checked_mul(image.height) == Some(image.data.len());
    if !sized || image.width.min(image.height) < MIN_IMAGE_SIDE {
        return Vec::new();
    }
    let mask = black_mask(image, config.min_contrast.max(1));
    let shortest = (4.0 * config.min_side_px * 0.7) as usize;
    let longest = 4 * (image.width + image.height);
    let mut quads: Vec<Quad> = Vec::new();
    for_each_outline(&mask, Connected::Sides, shortest, longest, |outline| {
        quads.extend(fit_quad(outline, config.min_side_px));
    });
    // Borders of small tags may hang together over corners only.
    let (first, small) = (quads.len(), (4.0 * SMALL_SIDE_PX) as usize);
    for_each_outline(&mask, Connected::Corners, shortest, longest.min(small), |outline| {
        let quad = fit_quad(outline, config.min_side_px);
        quads.extend(quad.filter(|q| !quads[..first].iter().any(|known| known.is_same(q))));
    });
    quads
}

fn recognise(
    image: &GrayImage,
    lens: Lens<'_>,
    quad: &Quad,
    dictionary: &Dictionary,
    config: &DetectConfig,
) -> Option<Detection> {
    let start = quad.corners.map(|c| lens.straighten(&c));
    let refined = refine(image, lens, &start, dictionary.cells(), f64::from(config.min_contrast))?;
    // Codes without redundancy are believed only where all sides are those of a tag.
    if refined.unfitted_sides > 2 * dictionary.max_bit_errors as usize {
        return None;
    }
    let reading = read(image, lens, &refined.corners, dictionary, f64::from(config.min_contrast))?;
    Some(upright(&refined, &reading, lens))
}

/// Corners in the order of the upright tag, in picture pixels.
fn upright(refined: &RefinedQuad, reading: &Reading, lens: Lens<'_>) -> Detection {
    let shift = reading.decoded.quarter_turns;
    let order: [usize; 4] = std::array::from_fn(|k| (k + shift) % 4);
    Detection {
        id: reading.decoded.id,
        corners: order.map(|k| lens.bend(&refined.corners[k])),
        corner_sigma_px: order.map(|k| refined.sigma_px[k]),
        bit_errors: reading.decoded.bit_errors,
        clarity: reading.clarity,
    }
}

/// One detection a place: of two with one id whose centres lie within each other's half side, the larger stays.
fn without_duplicates(mut found: Vec<Detection>) -> Vec<Detection> {
    let key = |d: &Detection| (d.id, d.centre().y, d.centre().x);
    found.sort_by(|a, b| {
        let (a, b) = (key(a), key(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
    });
    let covered = |d: &Detection, other: &Detection| {
        d.id == other.id
            && other.side_px() > d.side_px()
            && (d.centre() - other.centre()).norm() < 0.5 * other.side_px()
    };
    let keep: Vec<bool> = found.iter().map(|d| !found.iter().any(|other| covered(d, other))).collect();
    found.into_iter().zip(keep).filter_map(|(d, keep)| keep.then_some(d)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::rendering::Canvas;
    use super::*;

    /// Corners of a square of `side` pixels around `centre`, turned and foreshortened a little.
    fn tilted(centre: [f64; 2], side: f64, angle: f64) -> [Point2<f64>; 4] {
        let (sin, cos) = angle.sin_cos();
        [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, y]: [f64; 2]| {
            let (u, v) = ((x * cos - y * sin) * side, (x * sin + y * cos) * side * 0.85);
            let depth = 1.0 + 0.0008 * v;
            Point2::new(centre[0] + u / depth, centre[1] + v / depth)
        })
    }

    /// Draws tags of a family in a grid, detects them, and returns the corner errors in pixels.
    fn corner_errors(family: Family, ids: &[u32], side: f64, blur: f64, noise: f64) -> Vec<f64> {
        let dictionary = Dictionary::of(family);
        let mut canvas = Canvas::white(640, 480);
        let pitch = 1.6 * side;
        let columns = (600.0 / pitch) as usize;
        let mut truth = Vec::new();
        for (k, &id) in ids.iter().enumerate() {
            let place =
                [40.3 + pitch * (0.4 + (k % columns) as f64), 40.7 + pitch * (0.4 + (k / columns) as f64)];
            let corners = tilted(place, side, 0.7 * k as f64 + 0.2);
            canvas.draw(dictionary, id, &corners);
            truth.push((id, corners));
        }
        let found = detect(&canvas.picture(blur, noise, 7), dictionary, None, &DetectConfig::default());
        assert_eq!(found.iter().map(|d| d.id).collect::<Vec<_>>(), ids, "{family:?}");
        let errors = truth
            .iter()
            .zip(&found)
            .flat_map(|((_, corners), d)| corners.iter().zip(&d.corners).map(|(a, b)| (a - b).norm()));
        errors.collect()
    }

    fn median(mut values: Vec<f64>) -> f64 {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    }

    #[test]
    fn every_id_of_every_family_is_found_the_right_way_round() {
        for family in Family::ALL {
            // ARUCO_ORIGINAL's last tag looks the same upside down.
            let all: Vec<u32> = (0..Dictionary::of(family).len().min(1023) as u32).collect();
            for ids in all.chunks(48) {
                let errors = corner_errors(family, ids, 40.0, 0.6, 2.0);
                let worst = errors.iter().copied().fold(0.0, f64::max);
                assert!(worst < 0.5, "{family:?} {ids:?} {worst}");
            }
        }
    }

    #[test]
    fn corners_are_good_to_a_tenth_of_a_pixel() {
        for (side, blur, noise) in [(60.0, 0.7, 3.0), (36.0, 0.7, 4.0), (30.0, 1.0, 4.0)] {
            let ids: Vec<u32> = (0..20).collect();
            let error = median(corner_errors(Family::Aruco4x4_50, &ids, side, blur, noise));
            assert!(error < 0.1, "side {side} blur {blur} noise {noise}: {error}");
        }
    }

    #[test]
    fn nothing_is_found_in_noise_or_in_a_picture_of_the_wrong_size() {
        let noise = Canvas::white(320, 240).picture(0.0, 60.0, 3);
        let short = GrayImage { width: 4000, height: 4000, data: vec![0; 10] };
        for family in Family::ALL {
            for image in [&noise, &short] {
                assert!(detect(image, Dictionary::of(family), None, &DetectConfig::default()).is_empty());
            }
        }
    }
}
