//! Plane-to-plane maps: of the unit square in closed form, of many points by the normalised direct linear transform.

use nalgebra::{DMatrix, Matrix3, Point2, SymmetricEigen, Vector3};

/// Image of a point; far outside where the map sends it to infinity.
pub(super) fn apply(h: &Matrix3<f64>, p: &Point2<f64>) -> Point2<f64> {
    let v = h * Vector3::new(p.x, p.y, 1.0);
    let w = if v.z.abs() < 1e-12 { 1e-12 } else { v.z };
    Point2::new(v.x / w, v.y / w)
}

/// Map that takes (0,0), (1,0), (1,1), (0,1) to four points (Heckbert 1989); `None` for degenerate ones.
pub(super) fn from_unit_square(p: &[Point2<f64>; 4]) -> Option<Matrix3<f64>> {
    let (d1, d2) = (p[1] - p[2], p[3] - p[2]);
    let s = (p[0] - p[1]) + (p[2] - p[3]);
    let det = d1.perp(&d2);
    if det.abs() < 1e-9 {
        return None;
    }
    let g = s.perp(&d2) / det;
    let h = d1.perp(&s) / det;
    let x = p[1].coords * (1.0 + g) - p[0].coords;
    let y = p[3].coords * (1.0 + h) - p[0].coords;
    let m = Matrix3::new(x.x, y.x, p[0].x, x.y, y.y, p[0].y, g, h, 1.0);
    m.iter().all(|v| v.is_finite()).then_some(m)
}

/// Map from `from` to `to` of least algebraic error (Hartley & Zisserman, algorithm 4.2); needs four pairs.
pub(super) fn fit(from: &[Point2<f64>], to: &[Point2<f64>]) -> Option<Matrix3<f64>> {
    if from.len() != to.len() || from.len() < 4 {
        return None;
    }
    let (a, b) = (normaliser(from)?, normaliser(to)?);
    let mut normal = DMatrix::<f64>::zeros(9, 9);
    for (p, q) in from.iter().zip(to) {
        let (p, q) = (apply(&a, p), apply(&b, q));
        let rows = [
            [p.x, p.y, 1.0, 0.0, 0.0, 0.0, -q.x * p.x, -q.x * p.y, -q.x],
            [0.0, 0.0, 0.0, p.x, p.y, 1.0, -q.y * p.x, -q.y * p.y, -q.y],
        ];
        for row in &rows {
            for i in 0..9 {
                for j in 0..9 {
                    normal[(i, j)] += row[i] * row[j];
                }
            }
        }
    }
    let eigen = SymmetricEigen::try_new(normal, 1e-14, 200)?;
    let smallest = eigen.eigenvalues.imin();
    let v = eigen.eigenvectors.column(smallest);
    let normalised = Matrix3::from_row_iterator(v.iter().copied());
    let h = b.try_inverse()? * normalised * a;
    h.iter().all(|v| v.is_finite()).then_some(h)
}

/// Map that moves points to mean zero and mean distance sqrt 2.
fn normaliser(points: &[Point2<f64>]) -> Option<Matrix3<f64>> {
    let n = points.len() as f64;
    let mean = points.iter().fold(nalgebra::Vector2::zeros(), |sum, p| sum + p.coords) / n;
    let spread = points.iter().map(|p| (p.coords - mean).norm()).sum::<f64>() / n;
    if spread < 1e-12 {
        return None;
    }
    let s = std::f64::consts::SQRT_2 / spread;
    Some(Matrix3::new(s, 0.0, -s * mean.x, 0.0, s, -s * mean.y, 0.0, 0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_of_finding_a_map_agree() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
        let image = [[10.0, 12.0], [50.0, 9.0], [57.0, 48.0], [4.0, 40.0]].map(Point2::from);
        let closed = from_unit_square(&image).unwrap();
        let fitted = fit(&square, &image).unwrap();
        for p in square.iter().chain(&[Point2::new(0.3, 0.6)]) {
            assert!((apply(&closed, p) - apply(&fitted, p)).norm() < 1e-8);
        }
        assert!((apply(&closed, &square[2]) - image[2]).norm() < 1e-9);
    }
}
