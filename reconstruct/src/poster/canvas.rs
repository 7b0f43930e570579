//! The canvas: depth and gathered light, in bands of rows that threads own, so that the order within a pixel is fixed.

use rayon::prelude::*;

use super::tone;
use crate::image::ColorImage;

/// Rows a band.
const BAND: usize = 32;

pub(super) struct Canvas {
    pub(super) width: usize,
    pub(super) height: usize,
    depth: Vec<f32>,
    /// Light times weight, and weight.
    light: Vec<[f32; 4]>,
}

/// Some rows of the canvas.
pub(super) struct Band<'a> {
    pub(super) width: usize,
    /// First row.
    pub(super) top: usize,
    pub(super) depth: &'a mut [f32],
    pub(super) light: &'a mut [[f32; 4]],
}

impl Band<'_> {
    /// Columns and rows of the band within `radius` of a place.
    pub(super) fn around(
        &self,
        x: f32,
        y: f32,
        radius: f32,
    ) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        self.clip([x - radius, y - radius], [x + radius, y + radius])
    }

    /// Columns and rows of the band within a rectangle.
    pub(super) fn clip(
        &self,
        low: [f32; 2],
        high: [f32; 2],
    ) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let bottom = self.top + self.depth.len() / self.width.max(1);
        let from = |v: f32, least: usize| (v.ceil().max(0.0) as usize).max(least);
        let to = |v: f32, most: usize| ((v.floor() + 1.0).max(0.0) as usize).min(most);
        let (x0, x1) = (from(low[0], 0), to(high[0], self.width));
        let (y0, y1) = (from(low[1], self.top), to(high[1], bottom));
        (x0..x1.max(x0), y0..y1.max(y0))
    }

    /// Number of a pixel in the band's slices.
    pub(super) fn at(&self, x: usize, y: usize) -> usize {
        (y - self.top) * self.width + x
    }
}

impl Canvas {
    pub(super) fn new(width: usize, height: usize) -> Self {
        let pixels = width * height;
        Self { width, height, depth: vec![f32::INFINITY; pixels], light: vec![[0.0; 4]; pixels] }
    }

    /// Numbers of the items that touch each band, in order; `rows` gives an item's first and last row.
    pub(super) fn sort_into_bands(
        &self,
        count: usize,
        rows: impl Fn(usize) -> Option<(f32, f32)>,
    ) -> Vec<Vec<u32>> {
        let bands = self.height.div_ceil(BAND);
        let mut lists = vec![Vec::new(); bands];
        for i in 0..count {
            let Some((low, high)) = rows(i) else { continue };
            if high < 0.0 || low >= self.height as f32 {
                continue;
            }
            let first = low.max(0.0) as usize / BAND;
            let last = (high.max(0.0) as usize / BAND).min(bands - 1);
            (first..=last).for_each(|band| lists[band].push(i as u32));
        }
        lists
    }

    /// Draws all bands at the same time, each from its own list.
    pub(super) fn draw_bands(&mut self, lists: &[Vec<u32>], draw: impl Fn(&mut Band<'_>, &[u32]) + Sync) {
        let (width, size) = (self.width, self.width * BAND);
        let bands = self.depth.par_chunks_mut(size).zip(self.light.par_chunks_mut(size)).enumerate();
        bands.zip(lists).for_each(|((number, (depth, light)), list)| {
            draw(&mut Band { width, top: number * BAND, depth, light }, list);
        });
    }

    /// The picture: `factor` x `factor` pixels averaged in linear light, the ground where nothing was drawn.
    pub(super) fn finish(&self, factor: usize, ground: impl Fn(f32, f32) -> [f32; 3] + Sync) -> ColorImage {
        let (width, height) = (self.width / factor, self.height / factor);
        let pixel = |i: usize| {
            let mut sum = [0.0f32; 3];
            for k in 0..factor * factor {
                let (x, y) = (i % width * factor + k % factor, i / width * factor + k / factor);
                let [r, g, b, weight] = self.light[y * self.width + x];
                let light = if weight > 0.0 {
                    [r / weight, g / weight, b / weight]
                } else {
                    ground(x as f32, y as f32)
                };
                sum = std::array::from_fn(|c| sum[c] + light[c].min(1.0));
            }
            sum.map(|v| tone::srgb(v / (factor * factor) as f32))
        };
        ColorImage { width, height, data: (0..width * height).into_par_iter().map(pixel).collect() }
    }
}
