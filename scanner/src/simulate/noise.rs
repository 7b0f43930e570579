//! Random fields for sensor noise: the same seed gives the same field whatever the number of threads.

use std::sync::LazyLock;

use rayon::prelude::*;

/// Standard normal deviates at evenly spread probabilities; drawing one is a look-up.
static NORMAL: LazyLock<Vec<f32>> =
    LazyLock::new(|| (0..65_536).map(|i| quantile((f64::from(i) + 0.5) / 65_536.0)).collect());

/// Inverse of the normal distribution, by bisection of its integral: 65 536 times at start.
fn quantile(probability: f64) -> f32 {
    let (mut low, mut high) = (-6.0f64, 6.0);
    for _ in 0..40 {
        let mid = 0.5 * (low + high);
        if normal_integral(mid) < probability { low = mid } else { high = mid }
    }
    (0.5 * (low + high)) as f32
}

/// Share of the standard normal distribution below `x` (Marsaglia 2004, series about 0).
fn normal_integral(x: f64) -> f64 {
    let (mut sum, mut term, mut i) = (x, x, 1.0);
    while term.abs() > 1e-12 {
        i += 2.0;
        term *= x * x / i;
        sum += term;
    }
    0.5 + sum * (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

/// Mixes words into one seed, so that every use of chance has its own stream.
pub fn mix_seed(words: &[u64]) -> u64 {
    words.iter().fold(0x9e37_79b9_7f4a_7c15, |state, word| {
        let mut h = state ^ word.wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        h ^ (h >> 31)
    })
}

/// One standard normal deviate.
pub fn normal(rng: &mut fastrand::Rng) -> f32 {
    NORMAL[usize::from(rng.u16(..))]
}

/// White noise of unit variance, row-major.
pub fn white(width: usize, height: usize, seed: u64) -> Vec<f32> {
    let table = &*NORMAL;
    let mut field = vec![0.0; width * height];
    field.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, line)| {
        let mut rng = fastrand::Rng::with_seed(mix_seed(&[seed, row as u64]));
        for four in line.chunks_mut(4) {
            let mut bits = rng.u64(..);
            for value in four {
                *value = table[(bits & 0xffff) as usize];
                bits >>= 16;
            }
        }
    });
    field
}

/// Noise of unit variance whose neighbours agree over about `sigma` pixels (white noise through a Gaussian).
pub fn correlated(width: usize, height: usize, sigma: f32, seed: u64) -> Vec<f32> {
    let mut taps = gaussian_taps(sigma);
    // Unit energy, not unit sum: the variance of white noise passes through unchanged.
    let energy = taps.iter().map(|t| t * t).sum::<f32>().sqrt();
    for tap in &mut taps {
        *tap /= energy;
    }
    let reach = taps.len() / 2;
    let (wide, tall) = (width + 2 * reach, height + 2 * reach);
    let field = white(wide, tall, seed);
    let mut rows = vec![0.0; width * tall];
    rows.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, out)| {
        let line = &field[y * wide..(y + 1) * wide];
        for (k, tap) in taps.iter().enumerate() {
            for (o, v) in out.iter_mut().zip(&line[k..]) {
                *o += tap * v;
            }
        }
    });
    let mut result = vec![0.0; width * height];
    result.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, out)| {
        for (k, tap) in taps.iter().enumerate() {
            for (o, v) in out.iter_mut().zip(&rows[(y + k) * width..(y + k + 1) * width]) {
                *o += tap * v;
            }
        }
    });
    result
}

/// Weights of a Gaussian at whole pixels, sum 1, cut at 2.5 sigma.
pub fn gaussian_taps(sigma: f32) -> Vec<f32> {
    let reach = (2.5 * sigma).ceil().max(1.0) as i32;
    let weight = |k: i32| (-0.5 * (k as f32 / sigma.max(1e-3)).powi(2)).exp();
    let sum: f32 = (-reach..=reach).map(weight).sum();
    (-reach..=reach).map(|k| weight(k) / sum).collect()
}

/// Smooths interleaved channels of an image by a Gaussian; borders repeat the outermost pixel.
pub fn blur<const N: usize>(image: &mut Vec<[f32; N]>, width: usize, height: usize, sigma: f32) {
    let taps = gaussian_taps(sigma);
    let reach = taps.len() / 2;
    let pass = |source: &[[f32; N]], at: &(dyn Fn(usize, usize, usize) -> usize + Sync)| {
        let mut out = vec![[0.0; N]; width * height];
        out.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, line)| {
            for (x, pixel) in line.iter_mut().enumerate() {
                for (k, tap) in taps.iter().enumerate() {
                    let value = &source[at(x, y, k)];
                    for c in 0..N {
                        pixel[c] += tap * value[c];
                    }
                }
            }
        });
        out
    };
    let clamp = |v: usize, k: usize, end: usize| (v + k).saturating_sub(reach).min(end - 1);
    let rows = pass(image, &|x, y, k| y * width + clamp(x, k, width));
    *image = pass(&rows, &|x, y, k| clamp(y, k, height) * width + x);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(field: &[f32]) -> (f64, f64) {
        let n = field.len() as f64;
        let mean = field.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        (mean, field.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n)
    }

    #[test]
    fn fields_have_unit_variance() {
        for field in [white(300, 200, 1), correlated(300, 200, 1.2, 2)] {
            let (mean, variance) = moments(&field);
            assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.03, "{mean} {variance}");
        }
    }

    #[test]
    fn neighbours_agree_as_the_gaussian_says() {
        let (w, h, sigma) = (400, 300, 1.2f32);
        let field = correlated(w, h, sigma, 5);
        let pairs = (0..h).flat_map(|y| (0..w - 1).map(move |x| y * w + x));
        let product = pairs.map(|i| f64::from(field[i] * field[i + 1])).sum::<f64>() / ((w - 1) * h) as f64;
        let expected = (-0.25 / f64::from(sigma * sigma)).exp();
        assert!((product - expected).abs() < 0.04, "{product} {expected}");
    }

    #[test]
    fn the_table_is_the_normal_distribution() {
        assert!((quantile(0.975) - 1.959_964).abs() < 1e-4);
        assert!((quantile(0.5)).abs() < 1e-6);
    }
}
