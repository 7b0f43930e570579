//! All distances between some rows and all columns, in registers: the nearest and second nearest column of every row, and
//! the nearest of these rows of every column.

use pulp::bytemuck::{Zeroable, cast_slice};
use pulp::{Simd, WithSimd};

/// Rows compared at once with two registers of columns: their eight sums fill half of the registers.
const ROWS: usize = 4;
/// Registers of columns compared at once.
const WIDE: usize = 2;

/// Columns as the sweep reads them: registers of one dimension of neighbouring columns, dimension by dimension.
pub(super) struct ColumnTable {
    /// `count / lanes / WIDE` blocks of `N` dimensions of `WIDE * lanes` columns.
    values: Vec<f32>,
    /// Squared lengths; infinite where the last block is not full.
    squares: Vec<f32>,
    count: usize,
}

/// Makes a [`ColumnTable`] for the registers at hand.
pub(super) struct Columns<'a, const N: usize>(pub(super) &'a [[f32; N]]);

impl<const N: usize> WithSimd for Columns<'_, N> {
    type Output = ColumnTable;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> ColumnTable {
        let width = WIDE * S::F32_LANES;
        let mut values = Vec::with_capacity(self.0.len().next_multiple_of(width) * N);
        let mut squares: Vec<f32> = self.0.iter().map(square).collect();
        squares.resize(self.0.len().next_multiple_of(width), f32::INFINITY);
        for block in self.0.chunks(width) {
            for k in 0..N {
                values.extend(block.iter().map(|column| column[k]));
                values.resize(values.len() + width - block.len(), 0.0);
            }
        }
        ColumnTable { values, squares, count: self.0.len() }
    }
}

fn square<const N: usize>(descriptor: &[f32; N]) -> f32 {
    descriptor.iter().map(|v| v * v).sum()
}

/// The nearest column of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Best {
    pub(super) index: usize,
    /// Squared distance.
    pub(super) distance: f32,
    /// Squared distance of the second nearest.
    pub(super) second: f32,
}

/// What some rows and all columns have found.
pub(super) struct Nearest {
    pub(super) by_row: Vec<Best>,
    /// Squared distance (up to the column's own length) and row.
    pub(super) by_column: Vec<(f32, usize)>,
}

/// Compares rows with all columns.
pub(super) struct Sweep<'a, const N: usize> {
    pub(super) rows: &'a [[f32; N]],
    /// Number of the first row.
    pub(super) first: usize,
    pub(super) columns: &'a ColumnTable,
}

/// The best of each lane.
#[derive(Clone, Copy)]
struct Lanes<S: Simd> {
    best: S::f32s,
    second: S::f32s,
    /// Number of the register.
    at: S::u32s,
}

impl<const N: usize> WithSimd for Sweep<'_, N> {
    type Output = Nearest;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Nearest {
        let registers = self.columns.squares.len() / S::F32_LANES;
        let far = simd.splat_f32s(f32::INFINITY);
        let mut column_best = vec![far; registers];
        let mut column_row = vec![S::u32s::zeroed(); registers];
        let mut by_row = Vec::with_capacity(self.rows.len());
        for (group, rows) in self.rows.chunks(ROWS).enumerate() {
            // The last rows of a group that is not full are the first one again.
            let row = |r: usize| rows.get(r).unwrap_or(&rows[0]);
            let factors: [[f32; N]; ROWS] = std::array::from_fn(|r| row(r).map(|v| -2.0 * v));
            let squares: [f32; ROWS] = std::array::from_fn(|r| square(row(r)));
            let mut lanes = [Lanes::<S> { best: far, second: far, at: S::u32s::zeroed() }; ROWS];
            let values = S::as_simd_f32s(&self.columns.values).0;
            let column_squares = S::as_simd_f32s(&self.columns.squares).0;
            for (block, values) in values.chunks_exact(WIDE * N).enumerate() {
                let at = block * WIDE;
                let sums = block_sums(simd, &factors, values, &column_squares[at..at + WIDE]);
                for w in 0..WIDE {
                    let register = simd.splat_u32s((at + w) as u32);
                    let (mut best, mut best_row) = (column_best[at + w], column_row[at + w]);
                    for r in 0..ROWS {
                        lanes[r] = offered(simd, lanes[r], sums[r][w], register);
                        let distance = simd.add_f32s(sums[r][w], simd.splat_f32s(squares[r]));
                        let nearer = simd.less_than_f32s(distance, best);
                        best = simd.select_f32s(nearer, distance, best);
                        let number = simd.splat_u32s((self.first + group * ROWS + r) as u32);
                        best_row = simd.select_u32s(nearer, number, best_row);
                    }
                    (column_best[at + w], column_row[at + w]) = (best, best_row);
                }
            }
            for r in 0..rows.len() {
                by_row.push(reduced::<S>(&lanes[r], squares[r]));
            }
        }
        let distances: &[f32] = cast_slice(&column_best);
        let rows: &[u32] = cast_slice(&column_row);
        let by_column = distances.iter().zip(rows).take(self.columns.count).map(|(d, r)| (*d, *r as usize));
        Nearest { by_row, by_column: by_column.collect() }
    }
}

/// `|b|² - 2ab` of some rows and columns.
#[inline(always)]
fn block_sums<S: Simd, const N: usize>(
    simd: S,
    factors: &[[f32; N]; ROWS],
    values: &[S::f32s],
    squares: &[S::f32s],
) -> [[S::f32s; WIDE]; ROWS] {
    let mut sums = [[squares[0], squares[1]]; ROWS];
    for k in 0..N {
        let b = [values[WIDE * k], values[WIDE * k + 1]];
        for r in 0..ROWS {
            let a = simd.splat_f32s(factors[r][k]);
            sums[r] = [simd.mul_add_e_f32s(a, b[0], sums[r][0]), simd.mul_add_e_f32s(a, b[1], sums[r][1])];
        }
    }
    sums
}

#[inline(always)]
fn offered<S: Simd>(simd: S, lanes: Lanes<S>, distance: S::f32s, register: S::u32s) -> Lanes<S> {
    let nearer = simd.less_than_f32s(distance, lanes.best);
    Lanes {
        best: simd.min_f32s(distance, lanes.best),
        second: simd.min_f32s(lanes.second, simd.max_f32s(distance, lanes.best)),
        at: simd.select_u32s(nearer, register, lanes.at),
    }
}

/// The best of all lanes, of equal ones the lowest column.
#[inline(always)]
fn reduced<S: Simd>(lanes: &Lanes<S>, square: f32) -> Best {
    let best: &[f32] = cast_slice(std::slice::from_ref(&lanes.best));
    let second: &[f32] = cast_slice(std::slice::from_ref(&lanes.second));
    let at: &[u32] = cast_slice(std::slice::from_ref(&lanes.at));
    let column = |lane: usize| at[lane] as usize * S::F32_LANES + lane;
    let order = |a: &usize, b: &usize| best[*a].total_cmp(&best[*b]).then(column(*a).cmp(&column(*b)));
    let first = (0..S::F32_LANES).min_by(order).unwrap_or(0);
    let others = (0..S::F32_LANES).filter(|lane| *lane != first).map(|lane| best[lane]);
    let second = others.fold(second[first], f32::min);
    let distance = |v: f32| (v + square).max(0.0);
    Best { index: column(first), distance: distance(best[first]), second: distance(second) }
}
