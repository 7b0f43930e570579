//! Black or not: every pixel against the middle of the darkest and brightest value around it, by tiles
//! (as AprilTag 2, Wang & Olson 2016). Where nothing contrasts nothing is black.

use crate::image::GrayImage;

/// Side of a tile in pixels; the range is taken over 3x3 tiles.
const TILE: usize = 4;

/// Black pixels with a rim of one pixel that is never black.
pub(super) struct BlackMask {
    /// Pixels a row with the rim: the image's width + 2.
    pub(super) stride: usize,
    /// 1 = black; pixel (x, y) of the image is at `(y + 1) * stride + x + 1`.
    pub(super) data: Vec<u8>,
}

/// A range below this many standard deviations of the pixels' noise is likely noise alone.
const NOISE_SIGMAS: f64 = 7.0;
/// Noise raises the contrast asked for by at most this factor: texture must not hide tags.
const MOST_RAISED: f64 = 1.6;
/// Every so many rows are looked at for the noise.
const NOISE_STEP: usize = 4;
/// Median of the absolute difference of two values with noise of standard deviation 1.
const MEDIAN_DIFFERENCE: f64 = 0.954;

/// Darkest and brightest value of every tile, row by row.
struct TileRange {
    columns: usize,
    low: Vec<u8>,
    high: Vec<u8>,
}

/// Thresholds a picture; regions whose range is below `min_contrast`, or about the noise's, have no black.
pub(super) fn black_mask(image: &GrayImage, min_contrast: u8) -> BlackMask {
    let least = f64::from(min_contrast);
    let contrast = (NOISE_SIGMAS * noise(image)).clamp(least, MOST_RAISED * least).min(255.0) as u8;
    let tiles = spread(&tile_range(image));
    let stride = image.width + 2;
    let mut data = vec![0; stride * (image.height + 2)];
    let mut thresholds = vec![0; tiles.columns * TILE];
    for (y, row) in image.data.chunks_exact(image.width).enumerate() {
        if y % TILE == 0 {
            let first = y / TILE * tiles.columns;
            let ranges = tiles.low[first..].iter().zip(&tiles.high[first..]);
            for (thresholds, (&low, &high)) in thresholds.chunks_exact_mut(TILE).zip(ranges) {
                let threshold = if high - low < contrast { 0 } else { low + (high - low).div_ceil(2) };
                thresholds.fill(threshold);
            }
        }
        let out = &mut data[(y + 1) * stride + 1..][..image.width];
        for ((mark, &pixel), &threshold) in out.iter_mut().zip(row).zip(&thresholds) {
            *mark = u8::from(pixel < threshold);
        }
    }
    BlackMask { stride, data }
}

/// Standard deviation of the pixels' noise, from the median difference of neighbours: most pixels have no edge between.
fn noise(image: &GrayImage) -> f64 {
    let mut counts = [0u32; 256];
    for row in image.data.chunks_exact(image.width).step_by(NOISE_STEP) {
        for pair in row.as_chunks::<2>().0 {
            counts[pair[0].abs_diff(pair[1]) as usize] += 1;
        }
    }
    let half = f64::from(counts.iter().sum::<u32>()) / 2.0;
    let mut below = 0.0;
    for (difference, &count) in counts.iter().enumerate() {
        let count = f64::from(count);
        if below + count >= half && count > 0.0 {
            // A difference stands for all values that are rounded to it.
            let median = difference as f64 - 0.5 + (half - below) / count;
            return median.max(0.0) / MEDIAN_DIFFERENCE;
        }
        below += count;
    }
    0.0
}

fn tile_range(image: &GrayImage) -> TileRange {
    let (columns, rows) = (image.width.div_ceil(TILE), image.height.div_ceil(TILE));
    let mut range = TileRange { columns, low: Vec::new(), high: Vec::new() };
    range.low.reserve(columns * rows);
    range.high.reserve(columns * rows);
    let (mut low, mut high) = (vec![0; image.width], vec![0; image.width]);
    for rows in image.data.chunks(image.width * TILE) {
        low.copy_from_slice(&rows[..image.width]);
        high.copy_from_slice(&rows[..image.width]);
        for row in rows.chunks_exact(image.width).skip(1) {
            darker(&mut low, row);
            brighter(&mut high, row);
        }
        range.low.extend(low.chunks(TILE).map(|tile| tile.iter().copied().fold(255, u8::min)));
        range.high.extend(high.chunks(TILE).map(|tile| tile.iter().copied().fold(0, u8::max)));
    }
    range
}

fn darker(values: &mut [u8], others: &[u8]) {
    for (value, &other) in values.iter_mut().zip(others) {
        *value = (*value).min(other);
    }
}

fn brighter(values: &mut [u8], others: &[u8]) {
    for (value, &other) in values.iter_mut().zip(others) {
        *value = (*value).max(other);
    }
}

/// Every tile takes the range of its 3x3 neighbourhood.
fn spread(range: &TileRange) -> TileRange {
    TileRange {
        columns: range.columns,
        low: spread_by(&range.low, range.columns, darker),
        high: spread_by(&range.high, range.columns, brighter),
    }
}

/// Takes the neighbours in all four directions, sideways first.
fn spread_by(values: &[u8], columns: usize, take: fn(&mut [u8], &[u8])) -> Vec<u8> {
    let mut wide = values.to_vec();
    for (wide, row) in wide.chunks_exact_mut(columns).zip(values.chunks_exact(columns)) {
        take(&mut wide[1..], &row[..columns - 1]);
        take(&mut wide[..columns - 1], &row[1..]);
    }
    let mut out = wide.clone();
    let inner = out.len() - columns;
    take(&mut out[columns..], &wide[..inner]);
    take(&mut out[..inner], &wide[columns..]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dark_spot_is_black_and_a_flat_picture_is_not() {
        let mut image = GrayImage { width: 21, height: 19, data: vec![200; 21 * 19] };
        assert!(black_mask(&image, 20).data.iter().all(|&m| m == 0));
        image.data[9 * 21 + 20] = 50;
        let mask = black_mask(&image, 20);
        assert_eq!(mask.data.iter().map(|&m| u32::from(m)).sum::<u32>(), 1);
        assert_eq!(mask.data[10 * mask.stride + 21], 1);
    }

    #[test]
    fn ranges_are_those_of_three_by_three_tiles() {
        let mut rng = fastrand::Rng::with_seed(2);
        let (width, height) = (37, 22);
        let image = GrayImage { width, height, data: (0..width * height).map(|_| rng.u8(..)).collect() };
        let tiles = spread(&tile_range(&image));
        for (i, (&low, &high)) in tiles.low.iter().zip(&tiles.high).enumerate() {
            let (c, r) = (i % tiles.columns, i / tiles.columns);
            let span = |at: usize, size: usize| (at.saturating_sub(1) * TILE)..((at + 2) * TILE).min(size);
            let around = span(r, height).flat_map(|y| span(c, width).map(move |x| y * width + x));
            let values: Vec<u8> = around.map(|at| image.data[at]).collect();
            assert_eq!((Some(&low), Some(&high)), (values.iter().min(), values.iter().max()));
        }
    }

    #[test]
    fn noise_is_measured_beside_edges() {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut gaussian = move || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
        let (width, height) = (320, 240);
        for sigma in [0.0, 1.5, 4.0] {
            let value = |i: usize| if i % width % 40 < 20 { 60.0 } else { 180.0 };
            let data = (0..width * height).map(|i| (value(i) + sigma * gaussian()).round() as u8).collect();
            let found = noise(&GrayImage { width, height, data });
            assert!((found - sigma).abs() < 0.15 + 0.05 * sigma, "{found} {sigma}");
        }
    }
}
