//! Points sorted by cubic cells, to find neighbours within a cell's side.

use std::ops::Range;

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
    pub(crate) fn around(&self, point: &[f32; 3], visit: impl FnMut(usize)) {
        self.walk().around(point, visit);
    }

    /// For many points of which most are near the one before.
    pub(crate) fn walk(&self) -> Walk<'_> {
        Walk { grid: self, cell: [u64::MAX; 3], rows: [const { 0..0 }; 9] }
    }

    /// Rows of three cells around a cell.
    fn rows_around(&self, [x, y, z]: [u64; 3]) -> [Range<usize>; 9] {
        std::array::from_fn(|row| {
            let (cy, cz) = ((y + row as u64 % 3).checked_sub(1), (z + row as u64 / 3).checked_sub(1));
            let (Some(cy), Some(cz)) = (cy, cz) else { return 0..0 };
            let (from, to) = (key([x.saturating_sub(1), cy, cz]), key([x + 1, cy, cz]));
            let start = self.keys.partition_point(|&k| k < from);
            let count = self.keys[start..].iter().take_while(|k| **k <= to).count();
            start..start + count
        })
    }
}

/// Remembers the cells around the last point.
#[derive(Debug)]
pub(crate) struct Walk<'a> {
    grid: &'a Grid,
    cell: [u64; 3],
    rows: [Range<usize>; 9],
}

impl Walk<'_> {
    /// As [`Grid::around`].
    #[inline]
    pub(crate) fn around(&mut self, point: &[f32; 3], mut visit: impl FnMut(usize)) {
        let cell = cell_of(point, &self.grid.low, self.grid.cell);
        if cell != self.cell {
            self.rows = self.grid.rows_around(cell);
            self.cell = cell;
        }
        for row in &self.rows {
            self.grid.order[row.clone()].iter().for_each(|&i| visit(i as usize));
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
