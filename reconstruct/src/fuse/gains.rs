//! Views are brought to a common brightness before their colours are averaged.

use nalgebra::Point3;
use rayon::prelude::*;

use super::PlacedView;
use crate::pose::Pose;
use crate::witness::are_compared;

/// Factors that bring every view's colours to a common brightness, channel by channel: least squares of log colours over
/// spots seen by two views, with a pull to 1.
pub(super) fn color_gains(views: &[PlacedView]) -> Vec<[f32; 3]> {
    let n = views.len();
    let samples: Vec<Vec<Sample>> = views.par_iter().map(samples_of).collect();
    let pairs: Vec<(usize, usize)> = (0..n)
        .flat_map(|i| (i + 1..n).map(move |j| (i, j)))
        .filter(|&(i, j)| are_compared(i, j, n))
        .collect();
    let ratios: Vec<Option<([f64; 3], f64)>> = pairs
        .par_iter()
        .map(|&(i, j)| {
            let b_from_a = views[j].world_from_camera.inverse() * views[i].world_from_camera;
            log_ratio(&samples[i], &views[j], &b_from_a)
        })
        .collect();
    let mut gains = vec![[1.0f32; 3]; n];
    for channel in 0..3 {
        let mut normal = nalgebra::DMatrix::<f64>::identity(n, n) * 0.05;
        let mut right = nalgebra::DVector::<f64>::zeros(n);
        for (&(i, j), ratio) in pairs.iter().zip(&ratios) {
            let Some((log_ratio, weight)) = ratio else { continue };
            let w = weight.min(1.0);
            normal[(i, i)] += w;
            normal[(j, j)] += w;
            normal[(i, j)] -= w;
            normal[(j, i)] -= w;
            right[i] -= w * log_ratio[channel];
            right[j] += w * log_ratio[channel];
        }
        if let Some(solution) = normal.cholesky().map(|c| c.solve(&right)) {
            for (gain, log) in gains.iter_mut().zip(solution.iter()) {
                gain[channel] = log.clamp(-0.5, 0.5).exp() as f32;
            }
        }
    }
    gains
}

/// A point in its camera's frame and its colour.
type Sample = (Point3<f64>, [u8; 3]);

/// Points of a view that are seen well, evenly taken.
fn samples_of(view: &PlacedView) -> Vec<Sample> {
    let geometry = view.geometry;
    let well_seen = geometry.product_pixels().step_by(7).filter(|&s| geometry.incidence_cosine(s) >= 0.5);
    well_seen.map(|s| (Point3::from(geometry.points[s]).cast(), view.color.data[s])).collect()
}

/// Middle of `log(color in a) - log(color in b)` over common spots, and how much it is worth (1 = a thousand spots).
fn log_ratio(of_a: &[Sample], b: &PlacedView, b_from_a: &Pose) -> Option<([f64; 3], f64)> {
    let mut logs: [Vec<f64>; 3] = Default::default();
    for (point, color) in of_a {
        let p = b_from_a * point;
        let Some(t) = b.geometry.pixel_of(&p) else { continue };
        let same = b.geometry.mask[t] && (f64::from(b.geometry.points[t][2]) - p.z).abs() < 0.004;
        if !same || b.geometry.incidence_cosine(t) < 0.5 {
            continue;
        }
        for (k, logs) in logs.iter_mut().enumerate() {
            let (ca, cb) = (color[k], b.color.data[t][k]);
            if (12..250).contains(&ca) && (12..250).contains(&cb) {
                logs.push((f64::from(ca) / f64::from(cb)).ln());
            }
        }
    }
    let weight = logs.iter().map(Vec::len).min()? as f64 / 1000.0;
    if weight < 0.05 {
        return None;
    }
    Some((
        logs.map(|mut l| {
            let m = l.len() / 2;
            *l.select_nth_unstable_by(m, f64::total_cmp).1
        }),
        weight,
    ))
}
