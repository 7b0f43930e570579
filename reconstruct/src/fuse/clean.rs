//! What is not the product is dropped: the board's noise near the floor, and small clusters in the air.

use super::FuseConfig;
use super::grid::Grid;
use super::samples::dot;
use super::spot::Smoothed;

/// Drops low points that are the board's noise: they stay only under or inside the product's outline.
pub(super) fn drop_board_remains(samples: Vec<Smoothed>, config: &FuseConfig) -> Vec<Smoothed> {
    const CELL: f32 = 0.002;
    const SURELY_PRODUCT_METRES: f32 = 0.006;
    let Some(first) = samples.first() else { return samples };
    let bounds = samples.iter().fold((first.point, first.point), |(lo, hi), s| {
        (
            std::array::from_fn(|k| f32::min(lo[k], s.point[k])),
            std::array::from_fn(|k| f32::max(hi[k], s.point[k])),
        )
    });
    let (low, high): ([f32; 3], [f32; 3]) = bounds;
    let margin = 3usize;
    let size: [usize; 2] =
        std::array::from_fn(|k| (((high[k] - low[k]) / CELL) as usize).min(4000) + 1 + 2 * margin);
    let cell = |p: &[f32; 3]| {
        let c: [usize; 2] =
            std::array::from_fn(|k| ((((p[k] - low[k]) / CELL) as usize) + margin).min(size[k] - 1));
        c[1] * size[0] + c[0]
    };
    let mut high_up = vec![false; size[0] * size[1]];
    samples
        .iter()
        .filter(|s| s.point[2] > SURELY_PRODUCT_METRES)
        .for_each(|s| high_up[cell(&s.point)] = true);
    let inside = filled(&dilated(&high_up, size, 1), size);
    samples
        .into_iter()
        .filter(|s| {
            s.point[2] > SURELY_PRODUCT_METRES || (s.point[2] > config.floor_metres && inside[cell(&s.point)])
        })
        .collect()
}

fn dilated(cells: &[bool], size: [usize; 2], by: usize) -> Vec<bool> {
    let mut out = cells.to_vec();
    for y in by..size[1] - by {
        for x in by..size[0] - by {
            if cells[y * size[0] + x] {
                for v in y - by..=y + by {
                    out[v * size[0] + x - by..=v * size[0] + x + by].fill(true);
                }
            }
        }
    }
    out
}

/// The cells and all that they enclose: what cannot be reached from the border.
fn filled(cells: &[bool], size: [usize; 2]) -> Vec<bool> {
    let mut outside = vec![false; cells.len()];
    let mut queue: Vec<usize> = (0..cells.len())
        .filter(|i| {
            let (x, y) = (i % size[0], i / size[0]);
            x == 0 || y == 0 || x + 1 == size[0] || y + 1 == size[1]
        })
        .collect();
    while let Some(i) = queue.pop() {
        if outside[i] || cells[i] {
            continue;
        }
        outside[i] = true;
        let (x, y) = (i % size[0], i / size[0]);
        if x > 0 {
            queue.push(i - 1);
        }
        if x + 1 < size[0] {
            queue.push(i + 1);
        }
        if y > 0 {
            queue.push(i - size[0]);
        }
        if y + 1 < size[1] {
            queue.push(i + size[0]);
        }
    }
    outside.into_iter().map(|o| !o).collect()
}

/// Drops clusters smaller than one percent of the largest (Euclidean clustering, 5 mm: the source's own future work).
pub(super) fn drop_small_clusters(samples: Vec<Smoothed>) -> Vec<Smoothed> {
    const LINK: f32 = 0.005;
    let points: Vec<[f32; 3]> = samples.iter().map(|s| s.point).collect();
    let grid = Grid::new(&points, LINK);
    let mut cluster = vec![u32::MAX; samples.len()];
    let mut sizes = Vec::new();
    let mut queue = Vec::new();
    for start in 0..samples.len() {
        if cluster[start] != u32::MAX {
            continue;
        }
        let label = sizes.len() as u32;
        cluster[start] = label;
        queue.push(start);
        let mut size = 0usize;
        while let Some(i) = queue.pop() {
            size += 1;
            let here = samples[i].point;
            grid.around(&here, |j| {
                let off: [f32; 3] = std::array::from_fn(|k| samples[j].point[k] - here[k]);
                if cluster[j] == u32::MAX && dot(&off, &off) < LINK * LINK {
                    cluster[j] = label;
                    queue.push(j);
                }
            });
        }
        sizes.push(size);
    }
    let least = sizes.iter().copied().max().unwrap_or(0) / 100;
    samples.into_iter().zip(cluster).filter(|(_, c)| sizes[*c as usize] >= least).map(|(s, _)| s).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_encloses_its_inside() {
        let size = [7, 7];
        let ring: Vec<bool> = (0..49i32)
            .map(|i| {
                let (x, y) = (i % 7 - 3, i / 7 - 3);
                x.abs().max(y.abs()) == 2
            })
            .collect();
        let inside = filled(&ring, size);
        assert!(inside[24] && !inside[0]);
        assert_eq!(inside.iter().filter(|&&i| i).count(), 25);
    }
}
