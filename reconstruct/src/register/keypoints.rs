//! Key points: where the surface curves most (source slide 22), thinned so that none has a stronger one beside it.

use std::cmp::Ordering;

use crate::knn::Tree;

/// How to choose key points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeypointConfig {
    /// Surface variation below which a point is no key point, 0 to 1/3.
    pub min_curvature: f32,
    /// No two key points are closer than this, metres.
    pub min_spacing: f32,
    /// At most so many, the most curved first.
    pub max_count: usize,
}

impl Default for KeypointConfig {
    fn default() -> Self {
        Self { min_curvature: 0.01, min_spacing: 0.004, max_count: 2000 }
    }
}

/// Indices of the key points, the most curved first; equal curvatures in the order of the points.
pub fn largest_curvature(
    points: &[[f32; 3]],
    curvatures: &[f32],
    tree: &Tree,
    config: &KeypointConfig,
) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..points.len().min(curvatures.len())).filter(|i| curvatures[*i] >= config.min_curvature).collect();
    order.sort_by(|a, b| {
        curvatures[*b].partial_cmp(&curvatures[*a]).unwrap_or(Ordering::Equal).then(a.cmp(b))
    });
    let mut suppressed = vec![false; points.len()];
    let mut chosen = Vec::new();
    for i in order {
        if chosen.len() >= config.max_count {
            break;
        }
        if suppressed[i] {
            continue;
        }
        chosen.push(i);
        for near in tree.within_radius_unsorted(&points[i], config.min_spacing) {
            suppressed[near.index] = true;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_win_and_keep_their_distance() {
        let points: Vec<[f32; 3]> = (0..100).map(|i| [i as f32 * 0.001, 0.0, 0.0]).collect();
        let curvatures: Vec<f32> = (0..100).map(|i| 0.2 - 0.002 * (i as f32 - 40.0).abs()).collect();
        let config = KeypointConfig { min_curvature: 0.15, min_spacing: 0.0045, max_count: 100 };
        let chosen = largest_curvature(&points, &curvatures, &Tree::new(&points), &config);
        assert_eq!(chosen[0], 40);
        assert!(chosen.iter().all(|i| curvatures[*i] >= 0.15));
        for (k, a) in chosen.iter().enumerate() {
            assert!(chosen[..k].iter().all(|b| a.abs_diff(*b) >= 5));
        }
        let two = largest_curvature(
            &points,
            &curvatures,
            &Tree::new(&points),
            &KeypointConfig { max_count: 2, ..config },
        );
        assert_eq!(two, chosen[..2]);
    }

    #[test]
    fn a_flat_cloud_has_none() {
        let points = vec![[0.0; 3]; 9];
        let config = KeypointConfig::default();
        assert!(largest_curvature(&points, &[0.0; 9], &Tree::new(&points), &config).is_empty());
        assert!(largest_curvature(&points, &[f32::NAN; 9], &Tree::new(&points), &config).is_empty());
    }
}
