//! How a product lies on the board: as it stands, or laid on its side or upside down and let go until it rests.
//!
//! Let go, a thing rolls until its middle lies as low as anywhere around: a local minimum of the middle's height over all
//! directions that may point down. Product's frame in, z up out, metres.

use std::fmt;

use nalgebra::{Unit, UnitQuaternion, Vector3};
use reconstruct::mesh::Mesh;
use serde::{Deserialize, Serialize};

/// How the product is put on the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Rest {
    /// On its foot
    #[default]
    Standing,
    /// Laid on its side
    Side,
    /// Laid on its other side
    OtherSide,
    /// Put upside down; what cannot stand so rolls over
    UpsideDown,
}

impl fmt::Display for Rest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Standing => "standing",
            Self::Side => "side",
            Self::OtherSide => "other-side",
            Self::UpsideDown => "upside-down",
        })
    }
}

impl Rest {
    /// Number that keeps the random choices of one pose apart from those of the others; none for the first pose.
    pub(super) fn salt(self) -> Option<u64> {
        (self != Self::Standing).then_some(0x9e57 + self as u64)
    }

    /// Turn from the product's own frame to how it lies; its heading is left open.
    pub(super) fn turn(self, mesh: &Mesh) -> UnitQuaternion<f64> {
        // Tilted a little, so that nothing balances on an edge.
        let down = match self {
            Self::Standing => return UnitQuaternion::identity(),
            Self::Side => Vector3::new(0.12, 1.0, -0.05),
            Self::OtherSide => Vector3::new(-1.0, -0.3, -0.08),
            Self::UpsideDown => Vector3::new(0.02, 0.01, 1.0),
        };
        let down = settled(&hull_candidates(mesh), Unit::new_normalize(down));
        UnitQuaternion::rotation_between_axis(&down, &Unit::new_unchecked(-Vector3::z()))
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI))
    }
}

/// Directions in which outermost corners are looked for.
const DIRECTIONS: usize = 3000;

/// Corners relative to the mesh's middle that lie farthest in some direction: all others never touch the board.
fn hull_candidates(mesh: &Mesh) -> Vec<Vector3<f64>> {
    let points: Vec<Vector3<f64>> =
        mesh.vertices.points.iter().map(|p| Vector3::from(*p).cast::<f64>()).collect();
    let middle = middle_of_mass(mesh);
    let mut chosen: Vec<usize> = (0..DIRECTIONS)
        .filter_map(|k| {
            // Evenly over the sphere: a spiral by the golden angle.
            let z = 1.0 - (2.0 * k as f64 + 1.0) / DIRECTIONS as f64;
            let (sin, cos) = (2.399_963_229_728_653 * k as f64).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let towards = Vector3::new(r * cos, r * sin, z);
            (0..points.len()).max_by(|&a, &b| points[a].dot(&towards).total_cmp(&points[b].dot(&towards)))
        })
        .collect();
    chosen.sort_unstable();
    chosen.dedup();
    chosen.into_iter().map(|i| points[i] - middle).collect()
}

/// Middle of the solid, by tetrahedra from the origin to every triangle.
fn middle_of_mass(mesh: &Mesh) -> Vector3<f64> {
    let corner = |i: u32| Vector3::from(mesh.vertices.points[i as usize]).cast::<f64>();
    let (sum, volume) = mesh.triangles.iter().fold((Vector3::zeros(), 0.0), |(sum, volume), &[a, b, c]| {
        let (a, b, c) = (corner(a), corner(b), corner(c));
        let six = a.dot(&b.cross(&c));
        (sum + (a + b + c) * (six / 4.0), volume + six)
    });
    if volume.abs() < 1e-15 { Vector3::zeros() } else { sum / volume }
}

/// The direction that points down when it has rolled as far as it goes.
fn settled(corners: &[Vector3<f64>], start: Unit<Vector3<f64>>) -> Unit<Vector3<f64>> {
    let height = |down: &Vector3<f64>| corners.iter().map(|p| p.dot(down)).fold(f64::MIN, f64::max);
    let mut down = start;
    let mut best = height(&down);
    let mut step = 4.0f64.to_radians();
    while step > 0.02f64.to_radians() {
        let across = if down.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
        let u = down.cross(&across).normalize();
        let v = down.cross(&u);
        let tilted = (0..12).map(|k| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 12.0).sin_cos();
            Unit::new_normalize(down.into_inner() + (u * cos + v * sin) * step.tan())
        });
        let lowest = tilted.map(|d| (height(&d), d)).min_by(|a, b| a.0.total_cmp(&b.0));
        match lowest {
            Some((lower, d)) if lower < best - 1e-9 => (best, down) = (lower, d),
            _ => step *= 0.5,
        }
    }
    down
}

#[cfg(test)]
mod tests {
    use super::super::product::{Kind, Product};
    use super::*;

    fn lies(kind: Kind, rest: Rest) -> (Mesh, UnitQuaternion<f64>) {
        let mesh = Product::new(kind, 1).mesh();
        let turn = rest.turn(&mesh);
        (mesh, turn)
    }

    #[test]
    fn what_lies_touches_the_board_around_its_middle() {
        for kind in Kind::ALL {
            for rest in [Rest::Side, Rest::OtherSide, Rest::UpsideDown] {
                let (mesh, turn) = lies(kind, rest);
                let middle = middle_of_mass(&mesh);
                let points: Vec<Vector3<f64>> = mesh
                    .vertices
                    .points
                    .iter()
                    .map(|p| turn * (Vector3::from(*p).cast::<f64>() - middle))
                    .collect();
                let low = points.iter().map(|p| p.z).fold(f64::MAX, f64::min);
                let feet: Vec<[f64; 2]> =
                    points.iter().filter(|p| p.z < low + 0.0015).map(|p| [p.x, p.y]).collect();
                let hull = reconstruct::segment::convex_hull(&feet);
                // The middle is over the hull of what touches: to the left of every edge, but for a millimetre.
                let over = hull.iter().zip(hull.iter().cycle().skip(1)).all(|(a, b)| {
                    let along = Vector3::new(b[0] - a[0], b[1] - a[1], 0.0);
                    (along.x * -a[1] - along.y * -a[0]) / along.norm().max(1e-9) > -0.0015
                });
                assert!(over, "{kind} {rest} falls over: {hull:?}");
            }
        }
    }

    #[test]
    fn a_box_upside_down_stands_on_its_top_and_on_its_side_does_not() {
        let (_, turn) = lies(Kind::Crackerbox, Rest::UpsideDown);
        assert!((turn * Vector3::z()).z < -0.999, "{turn}");
        let (_, turn) = lies(Kind::Crackerbox, Rest::Side);
        assert!((turn * Vector3::z()).z.abs() < 0.02, "{turn}");
        assert_eq!(lies(Kind::Mug, Rest::Standing).1, UnitQuaternion::identity());
    }
}
