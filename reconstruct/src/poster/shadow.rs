//! The soft shadow where the product stands: how much of the product is low above a place of the ground.

use super::camera::Camera;
use crate::mesh::Mesh;

/// Cells a side.
const CELLS: usize = 128;
/// Darkest shadow, as part of the light taken away.
const DARKEST: f32 = 0.5;
/// Height above which a part throws little shadow, in parts of the product's longest side.
const REACH: f32 = 0.2;

pub(super) struct Ground {
    level: f32,
    low: [f32; 2],
    cell: f32,
    dark: Vec<f32>,
}

impl Ground {
    /// The ground under the lowest points; `None` without extent.
    pub(super) fn under(mesh: &Mesh) -> Option<Self> {
        let points = &mesh.vertices.points;
        let (low, high) = mesh.vertices.bounds()?;
        let mut heights: Vec<f32> = points.iter().map(|p| p[2]).collect();
        let place = heights.len() / 200;
        let level = *heights.select_nth_unstable_by(place, f32::total_cmp).1;
        let side = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
        if side <= 0.0 {
            return None;
        }
        // Twice the product's size, the product in the middle.
        let cell = 2.0 * side / CELLS as f32;
        let low = [0, 1].map(|k| f32::midpoint(low[k], high[k]) - side);
        let mut ground = Self { level, low, cell, dark: vec![0.0; CELLS * CELLS] };
        for point in points {
            ground.mark(*point, side * REACH);
        }
        for triangle in &mesh.triangles {
            let corner = |k: usize| points.get(triangle[k] as usize).copied().unwrap_or_default();
            let [a, b, c] = [corner(0), corner(1), corner(2)];
            ground.mark(std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0), side * REACH);
        }
        let near = blurred(&ground.dark, 2);
        let far = blurred(&near, 7);
        ground.dark = near.iter().zip(&far).map(|(n, f)| DARKEST * (0.45 * n + 0.55 * f)).collect();
        Some(ground)
    }

    fn mark(&mut self, point: [f32; 3], reach: f32) {
        let [x, y] = [0, 1].map(|k| ((point[k] - self.low[k]) / self.cell) as usize);
        if x < CELLS && y < CELLS {
            let height = (point[2] - self.level).max(0.0);
            let dark = &mut self.dark[y * CELLS + x];
            *dark = dark.max((-height / reach).exp());
        }
    }

    /// Part of the light taken away where the ray of a pixel meets the ground.
    pub(super) fn darkness(&self, camera: &Camera, x: f32, y: f32) -> f32 {
        let Some(place) = camera.on_level([x, y], self.level) else { return 0.0 };
        let [u, v] = [0, 1].map(|k| (place[k] - self.low[k]) / self.cell - 0.5);
        let last = (CELLS - 1) as f32;
        if !(u >= 0.0 && v >= 0.0 && u < last && v < last) {
            return 0.0;
        }
        let (i, j, s, t) = (u as usize, v as usize, u.fract(), v.fract());
        let at = |i: usize, j: usize| self.dark[j * CELLS + i];
        let row = |j: usize| at(i, j) * (1.0 - s) + at(i + 1, j) * s;
        row(j) * (1.0 - t) + row(j + 1) * t
    }
}

/// Three box filters, nearly a Gaussian.
fn blurred(cells: &[f32], radius: usize) -> Vec<f32> {
    let mut cells = cells.to_vec();
    for _ in 0..3 {
        cells = transposed(&rows_averaged(&cells, radius));
        cells = transposed(&rows_averaged(&cells, radius));
    }
    cells
}

fn rows_averaged(cells: &[f32], radius: usize) -> Vec<f32> {
    let average = |i: usize| {
        let (x, row) = (i % CELLS, i - i % CELLS);
        let part = &cells[row + x.saturating_sub(radius)..=row + (x + radius).min(CELLS - 1)];
        part.iter().sum::<f32>() / (2 * radius + 1) as f32
    };
    (0..cells.len()).map(average).collect()
}

fn transposed(cells: &[f32]) -> Vec<f32> {
    (0..cells.len()).map(|i| cells[i % CELLS * CELLS + i / CELLS]).collect()
}
