//! The k nearest of a whole cloud's shifted points, as the peers' search trees are measured.

use rayon::prelude::*;
use reconstruct::knn::Tree;

use crate::clock::Bench;
use crate::inputs::{CLOUDS, cloud};
use crate::reference;

/// Shift of the queries along every axis, metres.
const SHIFT: f32 = 0.0007;
/// Queries that are compared with plain search.
const JUDGED: usize = 500;

pub(crate) fn run(bench: &Bench) -> anyhow::Result<()> {
    for name in &CLOUDS[1..3] {
        let points = cloud(&bench.data.join(name))?.points;
        bench.stage(
            &format!("kdtree build {name}"),
            || Tree::new(&points),
            |tree| format!("n={}", tree.len()),
        );
        let tree = Tree::new(&points);
        let queries: Vec<[f32; 3]> = points.iter().map(|p| p.map(|v| v + SHIFT)).collect();
        for k in [1, 10, 30] {
            let farthest = || -> Vec<f64> {
                if k == 1 {
                    let nearest = |q| tree.nearest(q).map_or(f64::NAN, |n| f64::from(n.sq_dist));
                    return queries.par_iter().with_min_len(512).map(nearest).collect();
                }
                let rows = tree.nearest_n_each(&queries, k);
                rows.chunks_exact(k).map(|row| f64::from(row[k - 1].sq_dist)).collect()
            };
            bench.stage(&format!("knn k{k} {name}"), farthest, |found| {
                let sum: f64 = found.iter().sum();
                format!("n={} sum={sum:.6} exact={}", found.len(), exact(&tree, &points, &queries, k))
            });
        }
    }
    Ok(())
}

/// Whether a sample's neighbours are those of plain search, index by index.
fn exact(tree: &Tree, points: &[[f32; 3]], queries: &[[f32; 3]], k: usize) -> bool {
    let sample: Vec<[f32; 3]> = queries.iter().copied().step_by((queries.len() / JUDGED).max(1)).collect();
    let rows = tree.nearest_n_each(&sample, k);
    sample.iter().zip(rows.chunks_exact(k)).all(|(q, found)| {
        let expected = reference::nearest(points, q, k);
        found.len() == expected.len()
            && found.iter().zip(&expected).all(|(a, b)| a.index == b.0 && a.sq_dist == b.1)
    })
}
