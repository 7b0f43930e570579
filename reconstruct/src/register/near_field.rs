//! For every cell of a box around a cloud, the point nearest to the cell's middle: one look-up instead of a search in a tree.
//!
//! Exact at the middles of cells, off by at most a cell's diagonal elsewhere, which costs nothing where residuals are taken along
//! normals. Any frame, metres.

/// Most cells; a larger box gets coarser cells.
const MOST_CELLS: f32 = 6e6;
/// Marks a cell with nothing near.
const NOTHING: u32 = u32::MAX;

/// Nearest points on a grid.
#[derive(Debug, Clone)]
pub(crate) struct NearField {
    origin: [f32; 3],
    per_metre: f32,
    sizes: [usize; 3],
    cells: Vec<u32>,
}

impl NearField {
    /// A field over every `stride`-th of `points` with cells of `cell` metres that knows what is within `reach` metres; points
    /// that are not finite are left out.
    pub(crate) fn new(points: &[[f32; 3]], stride: usize, cell: f32, reach: f32) -> Self {
        let finite = |p: &&[f32; 3]| p.iter().all(|v| v.is_finite());
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in points.iter().filter(finite) {
            for k in 0..3 {
                lo[k] = lo[k].min(p[k]);
                hi[k] = hi[k].max(p[k]);
            }
        }
        let usable = (0..3).all(|k| (hi[k] - lo[k]).is_finite() && hi[k] >= lo[k])
            && cell > 0.0
            && reach > 0.0
            && (cell + reach).is_finite();
        if !usable {
            return Self { origin: [0.0; 3], per_metre: 1.0, sizes: [0; 3], cells: Vec::new() };
        }
        let origin = lo.map(|v| v - reach);
        let extents: [f32; 3] = std::array::from_fn(|k| hi[k] - lo[k] + 2.0 * reach);
        let volume = |cell: f32| extents.iter().map(|e| e / cell + 1.0).product::<f32>();
        let mut cell = cell;
        while volume(cell) > MOST_CELLS {
            cell *= 1.25;
        }
        let sizes = extents.map(|e| (e / cell).ceil() as usize + 1);
        let mut field =
            Self { origin, per_metre: 1.0 / cell, sizes, cells: vec![NOTHING; sizes.iter().product()] };
        field.stamp(points, stride, reach / cell);
        field
    }

    /// Writes every point into the cells within `reach` cells where nothing is nearer.
    fn stamp(&mut self, points: &[[f32; 3]], stride: usize, reach: f32) {
        let mut distances = vec![reach * reach; self.cells.len()];
        for (index, p) in
            (0u32..).zip(points).step_by(stride).filter(|(_, p)| p.iter().all(|v| v.is_finite()))
        {
            let at: [f32; 3] = std::array::from_fn(|k| (p[k] - self.origin[k]) * self.per_metre - 0.5);
            let first = at.map(|v| (v - reach).ceil().max(0.0) as usize);
            let last: [usize; 3] =
                std::array::from_fn(|k| ((at[k] + reach).floor() as usize).min(self.sizes[k] - 1));
            for z in first[2]..=last[2] {
                let dz = (z as f32 - at[2]).powi(2);
                for y in first[1]..=last[1] {
                    let dyz = dz + (y as f32 - at[1]).powi(2);
                    if dyz >= reach * reach {
                        continue;
                    }
                    let row = (z * self.sizes[1] + y) * self.sizes[0];
                    let span = row + first[0]..row + last[0] + 1;
                    let mut x = first[0] as f32 - at[0];
                    for (distance, cell) in distances[span.clone()].iter_mut().zip(&mut self.cells[span]) {
                        let d = dyz + x * x;
                        let nearer = d < *distance;
                        *distance = if nearer { d } else { *distance };
                        *cell = if nearer { index } else { *cell };
                        x += 1.0;
                    }
                }
            }
        }
    }

    /// The point nearest to the middle of the cell that holds `p`.
    #[inline]
    pub(crate) fn nearest(&self, p: &[f32; 3]) -> Option<usize> {
        let at: [f32; 3] = std::array::from_fn(|k| (p[k] - self.origin[k]) * self.per_metre);
        if !(at[0] >= 0.0 && at[1] >= 0.0 && at[2] >= 0.0) {
            return None;
        }
        let [x, y, z] = at.map(|v| v as usize);
        if x >= self.sizes[0] || y >= self.sizes[1] || z >= self.sizes[2] {
            return None;
        }
        let found = self.cells[(z * self.sizes[1] + y) * self.sizes[0] + x];
        (found != NOTHING).then_some(found as usize)
    }
}
