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

/// Darkest and brightest value of every tile.
struct TileRange {
    columns: usize,
    rows: usize,
    low: Vec<u8>,
    high: Vec<u8>,
}

/// Thresholds a picture; regions whose range is below `min_contrast` have no black.
pub(super) fn black_mask(image: &GrayImage, min_contrast: u8) -> BlackMask {
    let tiles = spread(&tile_range(image));
    let stride = image.width + 2;
    let mut data = vec![0; stride * (image.height + 2)];
    let mut thresholds = vec![0; tiles.columns];
    for (y, row) in image.data.chunks_exact(image.width).enumerate() {
        if y % TILE == 0 {
            let first = y / TILE * tiles.columns;
            for (t, threshold) in thresholds.iter_mut().enumerate() {
                let (low, high) = (tiles.low[first + t], tiles.high[first + t]);
                *threshold = if high - low < min_contrast { 0 } else { low + (high - low).div_ceil(2) };
            }
        }
        let out = &mut data[(y + 1) * stride + 1..][..image.width];
        for ((pixels, marks), &threshold) in row.chunks(TILE).zip(out.chunks_mut(TILE)).zip(&thresholds) {
            for (mark, &pixel) in marks.iter_mut().zip(pixels) {
                *mark = u8::from(pixel < threshold);
            }
        }
    }
    BlackMask { stride, data }
}

fn tile_range(image: &GrayImage) -> TileRange {
    let (columns, rows) = (image.width.div_ceil(TILE), image.height.div_ceil(TILE));
    let mut range =
        TileRange { columns, rows, low: vec![255; columns * rows], high: vec![0; columns * rows] };
    for (y, row) in image.data.chunks_exact(image.width).enumerate() {
        let first = y / TILE * columns;
        let lows = &mut range.low[first..first + columns];
        let highs = &mut range.high[first..first + columns];
        for ((pixels, low), high) in row.chunks(TILE).zip(lows).zip(highs) {
            *low = pixels.iter().fold(*low, |a, &b| a.min(b));
            *high = pixels.iter().fold(*high, |a, &b| a.max(b));
        }
    }
    range
}

/// Every tile takes the range of its 3x3 neighbourhood.
fn spread(range: &TileRange) -> TileRange {
    let (columns, rows) = (range.columns, range.rows);
    let mut out = TileRange { columns, rows, low: range.low.clone(), high: range.high.clone() };
    for r in 0..rows {
        for c in 0..columns {
            let (mut low, mut high) = (255, 0);
            for rr in r.saturating_sub(1)..(r + 2).min(rows) {
                for cc in c.saturating_sub(1)..(c + 2).min(columns) {
                    low = low.min(range.low[rr * columns + cc]);
                    high = high.max(range.high[rr * columns + cc]);
                }
            }
            out.low[r * columns + c] = low;
            out.high[r * columns + c] = high;
        }
    }
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
}
