//! Finds the holes of a surface, tells small ones, the base, and openings apart, and closes what may be closed.

use nalgebra::{Point3, Vector3};

use super::attributes::vertex_normals;
use super::{Hole, HoleKind, SurfaceConfig, base, fill, zip};
use crate::fuse::PlacedView;
use crate::mesh::{INVENTED, Mesh, topology};

/// A hole faces the floor where its direction points down at least this much.
const FACES_DOWN: f64 = -0.6;
/// Share of a base's rim that must lie low.
const LOW_SHARE: f64 = 0.8;
/// Smaller bases are small holes, square metres.
const LEAST_BASE_AREA: f64 = 0.5e-4;
/// Shorter rims are the raggedness of the surface's edge: closed without being named, metres.
const UNNAMED_RIM_METRES: f64 = 0.012;

/// Share of a crack's rim that has the rim's other side near; its two ends have none.
const CRACK_SHARE: f64 = 0.65;
/// Longer rims are no cracks: every corner is compared with every other.
const MOST_CRACK_CORNERS: usize = 4000;

/// Closes what may be closed; returns all holes worth naming, the largest first.
pub(super) fn close(
    mesh: &mut Mesh,
    views: &[PlacedView],
    stands_on_floor: bool,
    config: &SurfaceConfig,
) -> Vec<Hole> {
    let borders = topology::borders(&mesh.triangles);
    let taken = zip::edges_between_borders(mesh, &borders);
    let mut found: Vec<(Hole, Vec<u32>)> = borders
        .into_iter()
        .map(|border| (look_at(mesh, &border, views, stands_on_floor, config), border))
        .collect();
    let bases: Vec<usize> = (0..found.len()).filter(|&i| found[i].0.kind == HoleKind::Base).collect();
    let rims: Vec<Vec<u32>> = bases.iter().map(|&i| found[i].1.clone()).collect();
    for (&i, closed) in bases.iter().zip(base::close(mesh, &rims)) {
        if !closed {
            found[i].0.kind = HoleKind::Unseen;
        }
    }
    for (hole, border) in &found {
        if hole.kind == HoleKind::Closed {
            if is_long(hole) {
                zip::zip(mesh, border, &taken);
            } else {
                fill::fill(mesh, border);
            }
        }
    }
    normals_of_invented(mesh);
    let named = |h: &Hole| h.kind != HoleKind::Closed || h.rim_m > UNNAMED_RIM_METRES;
    let mut holes: Vec<Hole> = found.into_iter().map(|(hole, _)| hole).filter(named).collect();
    holes.sort_by(|a, b| b.area_m2.total_cmp(&a.area_m2));
    holes
}

/// Whether the two sides of a rim run close to each other: within `width_metres` along nearly all of it. The ragged rim of
/// something large runs close to itself as well, but spans more area than half its length times that width; the area does not tell alone,
/// for a band round a product spans none to any one side.
fn is_crack(rim: &[Vector3<f64>], area_m2: f64, width_metres: f64) -> bool {
    let mut along = vec![0.0];
    for (a, b) in rim.iter().zip(rim.iter().cycle().skip(1)) {
        along.push(along[along.len() - 1] + (b - a).norm());
    }
    let whole = along[rim.len()];
    if rim.len() > MOST_CRACK_CORNERS || area_m2 > 0.5 * whole * width_metres {
        return false;
    }
    let has_other_side = |i: usize| {
        (0..rim.len()).any(|j| {
            let apart = (along[i] - along[j]).abs();
            apart.min(whole - apart) > 2.0 * width_metres && (rim[i] - rim[j]).norm() < width_metres
        })
    };
    (0..rim.len()).filter(|&i| has_other_side(i)).count() as f64 >= CRACK_SHARE * rim.len() as f64
}

/// Whether a hole is much longer than wide.
fn is_long(hole: &Hole) -> bool {
    hole.rim_m * hole.rim_m > 25.0 * hole.area_m2
}

/// Size and kind of the hole inside a border.
fn look_at(
    mesh: &Mesh,
    border: &[u32],
    views: &[PlacedView],
    stands_on_floor: bool,
    config: &SurfaceConfig,
) -> Hole {
    let points: Vec<Vector3<f64>> =
        border.iter().map(|&v| Vector3::from(mesh.vertices.points[v as usize]).cast()).collect();
    let center = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let ends = || points.iter().zip(points.iter().cycle().skip(1));
    let rim_m = ends().map(|(a, b)| (b - a).norm()).sum::<f64>();
    // The border runs as its own triangles see it: the patch that would close it runs the other way.
    let area_vector = ends().map(|(a, b)| (b - center).cross(&(a - center))).sum::<Vector3<f64>>() * 0.5;
    let area_m2 = area_vector.norm();
    let facing = area_vector.try_normalize(1e-12).unwrap_or_else(Vector3::z);
    let low = points.iter().filter(|p| p.z < config.base_metres).count() as f64 / points.len() as f64;
    let is_base = stands_on_floor && facing.z < FACES_DOWN && low >= LOW_SHARE && area_m2 > LEAST_BASE_AREA;
    let kind = if is_base {
        HoleKind::Base
    } else if is_crack(&points, area_m2, config.crack_metres) {
        HoleKind::Closed
    } else if is_seen_through(&center, &points, views, config) {
        HoleKind::Opening
    } else if rim_m <= config.closed_rim_metres {
        HoleKind::Closed
    } else {
        HoleKind::Unseen
    };
    Hole { kind, center_m: center.into(), facing: facing.into(), rim_m, area_m2 }
}

/// Whether views look through most of a hole: its middle, and half-way to its rim.
fn is_seen_through(
    center: &Vector3<f64>,
    rim: &[Vector3<f64>],
    views: &[PlacedView],
    config: &SurfaceConfig,
) -> bool {
    const PROBES: usize = 8;
    let half_way = (0..PROBES).map(|i| (rim[i * rim.len() / PROBES] + center) * 0.5);
    let probes: Vec<Vector3<f64>> = std::iter::once(*center).chain(half_way).collect();
    let through = |p: &Vector3<f64>| {
        views.iter().any(|view| {
            let in_camera = view.world_from_camera.inverse_transform_point(&Point3::from(*p));
            view.geometry.nearest_gap(&in_camera).is_some_and(|gap| gap > config.see_through_metres)
        })
    };
    2 * probes.iter().filter(|p| through(p)).count() > probes.len()
}

/// Invented vertices face as their triangles do.
fn normals_of_invented(mesh: &mut Mesh) {
    let normals = vertex_normals(mesh);
    for (i, normal) in normals.into_iter().enumerate() {
        if mesh.deviations_metres[i] == INVENTED {
            mesh.vertices.normals[i] = normal;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rim of a strip of teeth 3 mm wide and 20 mm long, every second one of which is open, below an opening `open_metres` high.
    fn comb(open_metres: f64) -> Vec<Vector3<f64>> {
        const TEETH: usize = 20;
        let mut corners = vec![(0.0, open_metres + 0.02)];
        for tooth in 0..TEETH {
            let x = 0.006 * tooth as f64;
            corners.extend([(x, 0.0), (x + 0.003, 0.0), (x + 0.003, 0.02), (x + 0.006, 0.02)]);
        }
        corners.push((0.006 * TEETH as f64, open_metres + 0.02));
        let ends = corners.iter().zip(corners.iter().cycle().skip(1));
        ends.flat_map(|(a, b)| {
            let steps = ((b.0 - a.0).hypot(b.1 - a.1) / 0.001).ceil().max(1.0) as usize;
            (0..steps).map(move |k| {
                let share = k as f64 / steps as f64;
                Vector3::new(a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1), 0.0)
            })
        })
        .collect()
    }

    #[test]
    fn a_slit_is_a_crack_and_the_ragged_rim_of_something_large_is_none() {
        let teeth = 20.0 * 0.003 * 0.02;
        assert!(is_crack(&comb(0.002), teeth + 0.12 * 0.002, 0.005));
        assert!(!is_crack(&comb(0.1), teeth + 0.12 * 0.1, 0.005));
    }
}
