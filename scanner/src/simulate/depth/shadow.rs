//! Where the projector's pattern does not reach: the projector stands beside the camera and sees round the other side of things.

use rayon::prelude::*;
use reconstruct::camera::Intrinsics;

/// How far in front of a surface another one must be to shade it, metres: below it the shadow is thinner than a pixel.
const STEP: f32 = 0.010;

/// Per pixel whether the pattern reaches it. The projector stands `baseline` metres to the camera's right (+x), so things throw
/// their shadow to the left. Camera and projector share their rows: a pixel at depth z is lit from projector column `u - f b / z`.
pub(super) fn lit_by_projector(depth: &[f32], camera: &Intrinsics, baseline: f64) -> Vec<bool> {
    let width = camera.width as usize;
    let fb = (camera.fx * baseline) as f32;
    let mut lit = vec![true; depth.len()];
    lit.par_chunks_mut(width).zip(depth.par_chunks(width)).for_each(|(lit, depth)| {
        let column = |u: usize| u as f32 - fb / depth[u];
        // Nearest surface seen from each projector column; columns left of the image matter too.
        let shift = width;
        let mut nearest = vec![f32::INFINITY; 2 * width];
        let mut put = |at: f32, z: f32| {
            let slot = (at + 0.5).floor() as i64 + shift as i64;
            if let Some(cell) = usize::try_from(slot).ok().and_then(|i| nearest.get_mut(i)) {
                *cell = cell.min(z);
            }
        };
        for u in 0..width {
            if depth[u] <= 0.0 {
                continue;
            }
            put(column(u), depth[u]);
            // A surface that goes on to the next pixel also covers the columns between.
            if u + 1 < width && depth[u + 1] > 0.0 && (depth[u + 1] - depth[u]).abs() < STEP {
                put(0.5 * (column(u) + column(u + 1)), 0.5 * (depth[u] + depth[u + 1]));
            }
        }
        for u in 0..width {
            if depth[u] > 0.0 {
                let slot = ((column(u) + 0.5).floor() as i64 + shift as i64).clamp(0, 2 * width as i64 - 1);
                lit[u] = depth[u] <= nearest[slot as usize] + STEP;
            }
        }
    });
    lit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shadow_lies_left_of_a_thing_and_has_the_right_width() {
        let camera = Intrinsics::pinhole(640, 1, 525.0, 525.0, 319.5, 0.0);
        // A plate at 0.6 m, 60 pixels wide, before a wall at 1 m.
        let depth: Vec<f32> = (0..640).map(|u| if (300..360).contains(&u) { 0.6 } else { 1.0 }).collect();
        let lit = lit_by_projector(&depth, &camera, 0.075);
        let dark: Vec<usize> = (0..640).filter(|&u| !lit[u]).collect();
        let expected = 525.0 * 0.075 * (1.0 / 0.6 - 1.0);
        assert!((dark.len() as f64 - expected).abs() <= 2.0, "{} {expected}", dark.len());
        assert!(dark.iter().all(|u| (270..300).contains(u)), "{dark:?}");
    }
}
