//! The smooth part of the sensor's error: a field of disparity over the image that stays for the life of the sensor.

use std::f32::consts::PI;

use super::super::noise::normal;

/// Smooth error of disparity, pixels, row-major: at most `amplitude` anywhere. Low polynomials and two slow waves.
pub fn warp_field(width: usize, height: usize, amplitude: f32, seed: u64) -> Vec<f32> {
    if amplitude == 0.0 {
        return Vec::new();
    }
    let mut rng = fastrand::Rng::with_seed(seed);
    let c: [f32; 6] = std::array::from_fn(|_| normal(&mut rng));
    let waves: [[f32; 4]; 2] = std::array::from_fn(|_| {
        [0.5 * normal(&mut rng), PI * (rng.f32() - 0.5), PI * (rng.f32() - 0.5), 2.0 * PI * rng.f32()]
    });
    let at = |x: usize, y: usize| {
        let u = 2.0 * x as f32 / width as f32 - 1.0;
        let v = 2.0 * y as f32 / height as f32 - 1.0;
        let low = 0.5 * c[0] + c[1] * u + c[2] * v + c[3] * u * u + c[4] * v * v + 0.5 * c[5] * u * v;
        low + waves.iter().map(|[a, fu, fv, phase]| a * (fu * u + fv * v + phase).sin()).sum::<f32>()
    };
    let mut field: Vec<f32> =
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| at(x, y)).collect();
    let largest = field.iter().fold(1e-6f32, |m, v| m.max(v.abs()));
    for value in &mut field {
        *value *= amplitude / largest;
    }
    field
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_field_is_as_large_as_asked_and_smooth() {
        let field = warp_field(640, 480, 0.2, 3);
        let largest = field.iter().fold(0.0f32, |m, v| m.max(v.abs()));
        assert!((largest - 0.2).abs() < 1e-5);
        assert!(field.windows(2).enumerate().all(|(i, w)| (i + 1) % 640 == 0 || (w[0] - w[1]).abs() < 0.005));
    }
}
