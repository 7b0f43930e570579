//! Points sorted by cubic cells, to find neighbours within a cell's side.

use rayon::prelude::*;

/// Points sorted by cell, so that a row of cells along x is one run.
#[derive(Debug, Clone)]
pub(crate) struct Grid {
    cell: f32,
    low: [f32; 3],
    keys: Vec<u64>,
    order: Vec<u32>,
}

impl Grid {
    /// Of points in cells of side `cell`.
    pub(crate) fn new(points: &[[f32; 3]], cell: f32) -> Self {
        let low = lowest(points);
        let mut keyed: Vec<(u64, u32)> =
            points.par_iter().enumerate().map(|(i, p)| (key(cell_of(p, &low, cell)), i as u32)).collect();
        keyed.par_sort_unstable();
        let (keys, order) = keyed.into_iter().unzip();
        Self { cell, low, keys, order }
    }

    /// The same grid for the same points in the order of their cells, and that order.
    pub(crate) fn in_order(self) -> (Self, Vec<u32>) {
        let Self { cell, low, keys, order } = self;
        let itself = (0..order.len() as u32).collect();
        (Self { cell, low, keys, order: itself }, order)
    }

    /// Calls `visit` with the index of every sample in the 27 cells around a point.
    pub(crate) fn around(&self, point: &[f32; 3], mut visit: impl FnMut(usize)) {
        let [x, y, z] = cell_of(point, &self.low, self.cell);
        for cz in z.saturating_sub(1)..=z + 1 {
            for cy in y.saturating_sub(1)..=y + 1 {
                let (from, to) = (key([x.saturating_sub(1), cy, cz]), key([x + 1, cy, cz]));
                let start = self.keys.partition_point(|&k| k < from);
                for (k, &i) in self.keys[start..].iter().zip(&self.order[start..]) {
                    if *k > to {
                        break;
                    }
                    visit(i as usize);
                }
            }
        }
    }
}

/// Cell of a point; far outliers are clamped to 21 bits an axis.
pub(crate) fn cell_of(point: &[f32; 3], low: &[f32; 3], cell: f32) -> [u64; 3] {
    std::array::from_fn(|k| (((point[k] - low[k]) / cell).max(0.0) as u64).min((1 << 21) - 2))
}

pub(crate) fn key([x, y, z]: [u64; 3]) -> u64 {
    (z << 42) | (y << 21) | x
}

/// Lowest coordinates.
pub(crate) fn lowest(points: &[[f32; 3]]) -> [f32; 3] {
    points.iter().fold([f32::MAX; 3], |low, p| std::array::from_fn(|k| low[k].min(p[k])))
}
