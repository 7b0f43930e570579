//! Multi-frame averaging: the frames of a still view become one disparity map.
//!
//! In the depth camera's geometry. Averages **disparity**, not depth, since the sensor's noise is about constant there
//! (Chatterjee & Govindu 2015), and takes the mean, not the median: the 1/8-px steps dither away in a mean only.

use rayon::prelude::*;

use crate::image::DepthImage;

/// Baseline between projector and camera of a Kinect v1, metres. For other sensors it is only a unit of inverse depth.
pub const BASELINE_METRES: f64 = 0.075;
/// The sensor's disparity step, pixels.
pub const STEP_PX: f32 = 0.125;

/// Settings of the averaging.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AverageConfig {
    /// Values farther than this many steps from the middle one are not averaged in.
    pub gate_steps: f32,
    /// Least share of frames in which a pixel must have a value.
    pub min_valid_ratio: f32,
    /// Largest standard deviation over the frames, steps.
    pub max_sd_steps: f32,
    /// Change between the first and the last third of the frames that counts as motion, steps.
    pub motion_steps: f32,
    /// A pixel needs this many of its 8 neighbours within `edge_metres`, else it flies between two surfaces.
    pub min_neighbours: usize,
    /// Depth difference that still is the same surface, metres at 1 m (grows with distance squared).
    pub edge_metres: f32,
}

impl Default for AverageConfig {
    fn default() -> Self {
        Self {
            gate_steps: 3.0,
            min_valid_ratio: 0.5,
            max_sd_steps: 1.5,
            motion_steps: 3.0,
            min_neighbours: 5,
            edge_metres: 0.016,
        }
    }
}

/// Disparity of every pixel, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct DisparityMap {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Disparity in pixels; 0 = no value. Depth in metres is `focal_baseline / disparity`.
    pub disparity_px: Vec<f32>,
    /// Focal length (pixels) times baseline (metres).
    pub focal_baseline: f64,
    /// How far the scene changed from the first to the last third of the frames, pixels; 0 for fewer than 3 frames.
    pub motion_px: f32,
}

impl DisparityMap {
    /// Depth in metres; 0 = no value.
    pub fn metres(&self, index: usize) -> f32 {
        let d = self.disparity_px[index];
        if d > 0.0 { (self.focal_baseline / f64::from(d)) as f32 } else { 0.0 }
    }

    /// Number of pixels with a value.
    pub fn valid(&self) -> usize {
        self.disparity_px.iter().filter(|&&d| d > 0.0).count()
    }
}

/// Averages the frames of one view. All frames have the same size; `focal_px` is the depth camera's fx.
pub fn average(frames: &[DepthImage], focal_px: f64, config: &AverageConfig) -> DisparityMap {
    let (width, height) = frames.first().map_or((0, 0), |f| (f.width, f.height));
    let focal_baseline = focal_px * BASELINE_METRES;
    let tables: Vec<Vec<f32>> =
        frames.iter().map(|f| disparity_table(f.units_per_metre, focal_baseline)).take(1).collect();
    let Some(table) = tables.first() else {
        return DisparityMap { width, height, disparity_px: Vec::new(), focal_baseline, motion_px: 0.0 };
    };
    let mut disparity_px = vec![0.0f32; width * height];
    disparity_px.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, out)| {
        let mut values = Vec::with_capacity(frames.len());
        for (u, out) in out.iter_mut().enumerate() {
            values.clear();
            values
                .extend(frames.iter().map(|f| table[f.data[row * width + u] as usize]).filter(|&d| d > 0.0));
            *out = mean_of(&mut values, frames.len(), config);
        }
    });
    let motion_px = motion(frames, table);
    let mut map = DisparityMap { width, height, disparity_px, focal_baseline, motion_px };
    drop_flying_pixels(&mut map, config);
    map
}

/// Disparity of every raw value; 0 stays 0.
fn disparity_table(units_per_metre: f64, focal_baseline: f64) -> Vec<f32> {
    let disparity =
        |raw: u32| if raw == 0 { 0.0 } else { (focal_baseline * units_per_metre / f64::from(raw)) as f32 };
    (0..=u32::from(u16::MAX)).map(disparity).collect()
}

/// Mean of the values near the middle one; 0 where too few frames saw anything or they disagree.
fn mean_of(values: &mut [f32], frames: usize, config: &AverageConfig) -> f32 {
    if values.is_empty() || (values.len() as f32) < config.min_valid_ratio * frames as f32 {
        return 0.0;
    }
    values.sort_unstable_by(f32::total_cmp);
    let middle = values[values.len() / 2];
    let gate = config.gate_steps * STEP_PX;
    let (mut sum, mut squares, mut count) = (0.0f32, 0.0f32, 0.0f32);
    for d in values.iter().filter(|&&d| (d - middle).abs() <= gate) {
        let off = d - middle;
        sum += off;
        squares += off * off;
        count += 1.0;
    }
    if count < config.min_valid_ratio * frames as f32 {
        return 0.0;
    }
    let mean = sum / count;
    let variance = (squares / count - mean * mean).max(0.0);
    if variance.sqrt() > config.max_sd_steps * STEP_PX { 0.0 } else { middle + mean }
}

/// Side of the blocks in which motion is looked for, pixels.
const MOTION_BLOCK_PX: usize = 8;
/// Share of the blocks that may change more, so that flickering edges are not motion.
const MOTION_SHARE: f32 = 0.02;

/// How far the scene changed between the first and the last third of the frames, pixels of disparity.
///
/// The median change of every block of pixels; of those, the one that only a few blocks exceed: a product that moved
/// fills only part of the picture.
fn motion(frames: &[DepthImage], table: &[f32]) -> f32 {
    let third = frames.len() / 3;
    if third == 0 {
        return 0.0;
    }
    let mean = |part: &[DepthImage], i: usize| {
        let values = part.iter().map(|f| table[f.data[i] as usize]);
        values.clone().all(|d| d > 0.0).then(|| values.sum::<f32>() / part.len() as f32)
    };
    let change = |i: usize| Some(mean(&frames[frames.len() - third..], i)? - mean(&frames[..third], i)?);
    let (width, height) = (frames[0].width, frames[0].height);
    let block = |x: usize, y: usize| {
        let rows = y..(y + MOTION_BLOCK_PX).min(height);
        let pixels = rows.flat_map(|v| (x..(x + MOTION_BLOCK_PX).min(width)).map(move |u| v * width + u));
        let mut changes: Vec<f32> = pixels.filter_map(change).collect();
        let middle = changes.len() / 2;
        (changes.len() > MOTION_BLOCK_PX * MOTION_BLOCK_PX / 2)
            .then(|| changes.select_nth_unstable_by(middle, f32::total_cmp).1.abs())
    };
    let mut blocks: Vec<f32> = (0..height)
        .step_by(MOTION_BLOCK_PX)
        .flat_map(|y| (0..width).step_by(MOTION_BLOCK_PX).map(move |x| (x, y)))
        .filter_map(|(x, y)| block(x, y))
        .collect();
    if blocks.is_empty() {
        return 0.0;
    }
    let at = ((1.0 - MOTION_SHARE) * (blocks.len() - 1) as f32) as usize;
    *blocks.select_nth_unstable_by(at, f32::total_cmp).1
}

/// Removes pixels that hang between two surfaces: too few of their neighbours are at the same depth.
fn drop_flying_pixels(map: &mut DisparityMap, config: &AverageConfig) {
    let (width, height) = (map.width as isize, map.height as isize);
    let depth: Vec<f32> = (0..map.disparity_px.len()).map(|i| map.metres(i)).collect();
    let supported = |u: isize, v: isize, z: f32| {
        let edge = config.edge_metres * (z * z).max(0.36);
        let near = (-1..=1).flat_map(|dv| (-1..=1).map(move |du| (du, dv))).filter(|&(du, dv)| {
            let (x, y) = (u + du, v + dv);
            let inside = (du, dv) != (0, 0) && x >= 0 && y >= 0 && x < width && y < height;
            inside && {
                let other = depth[(y * width + x) as usize];
                other > 0.0 && (other - z).abs() < edge
            }
        });
        near.count() >= config.min_neighbours
    };
    map.disparity_px.par_chunks_mut(map.width.max(1)).enumerate().for_each(|(row, out)| {
        for (u, d) in out.iter_mut().enumerate() {
            if *d > 0.0 && !supported(u as isize, row as isize, depth[row * width as usize + u]) {
                *d = 0.0;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(frames: usize, noise_mm: u16) -> Vec<DepthImage> {
        let mut rng = fastrand::Rng::with_seed(3);
        let frame = |rng: &mut fastrand::Rng| DepthImage {
            width: 40,
            height: 30,
            data: (0..1200).map(|_| 800 - noise_mm + rng.u16(0..=2 * noise_mm)).collect(),
            units_per_metre: 1000.0,
        };
        (0..frames).map(|_| frame(&mut rng)).collect()
    }

    #[test]
    fn averaging_takes_the_noise_down() {
        let rms = |frames| {
            let map = average(&plane(frames, 3), 525.0, &AverageConfig::default());
            let inside: Vec<f32> = (0..1200).map(|i| map.metres(i)).filter(|&z| z > 0.0).collect();
            assert!(inside.len() > 1190, "only the corners have too few neighbours");
            (inside.iter().map(|z| (z - 0.8).powi(2)).sum::<f32>() / inside.len() as f32).sqrt()
        };
        let (one, many) = (rms(1), rms(16));
        assert!(many < 0.4 * one, "{many} {one}");
    }

    #[test]
    fn a_pixel_seen_too_rarely_is_dropped() {
        let mut frames = plane(5, 0);
        for frame in &mut frames[1..] {
            frame.data[15 * 40 + 20] = 0;
        }
        let map = average(&frames, 525.0, &AverageConfig::default());
        assert_eq!(map.metres(15 * 40 + 20), 0.0);
        assert!(map.metres(15 * 40 + 10) > 0.0);
    }

    #[test]
    fn a_flying_pixel_is_dropped_and_the_edge_stays() {
        let mut frames = plane(1, 0);
        for row in frames[0].data.chunks_exact_mut(40) {
            row[20] = 900;
            row[21..].fill(1000);
        }
        let map = average(&frames, 525.0, &AverageConfig::default());
        assert_eq!(map.metres(10 * 40 + 20), 0.0);
        assert!(map.metres(10 * 40 + 19) > 0.0 && map.metres(10 * 40 + 21) > 0.0);
    }

    #[test]
    fn motion_is_noticed() {
        let mut frames = plane(6, 0);
        for frame in &mut frames[4..] {
            frame.data[..400].iter_mut().for_each(|d| *d += 20);
        }
        let still = average(&plane(6, 1), 525.0, &AverageConfig::default()).motion_px;
        let moved = average(&frames, 525.0, &AverageConfig::default()).motion_px;
        assert!(still < 0.1 && moved > 0.5, "{still} {moved}");
    }
}
