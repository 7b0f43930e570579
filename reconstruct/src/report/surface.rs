//! What a report says about the model's surface: how much was measured, how well, and what is missing.

use serde::{Deserialize, Serialize};

use crate::mesh::{Mesh, topology};
use crate::surface::{Hole, HoleKind, Surface};

/// What lies lower and faces the floor this much is the side a product stands on, metres and cosine.
const UNDERSIDE_METRES: f64 = 0.010;
const FACES_DOWN: f64 = -0.6;

/// The surface in `report.json`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SurfaceReport {
    /// Triangles.
    pub triangles: usize,
    /// Measured surface, square metres.
    pub measured_m2: f64,
    /// Invented surface, square metres: small holes, and the side it stands on.
    pub invented_m2: f64,
    /// Share of measured surface in all there is to see: with small holes and large ones, without the side it stands on,
    /// percent.
    pub coverage_percent: f64,
    /// Share of the side it stands on that was measured, percent; only of several recordings, one of which shows it turned over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub underside_measured_percent: Option<f64>,
    /// Whether the surface is closed everywhere.
    pub watertight: bool,
    /// Measured points a square centimetre.
    pub points_per_cm2: f64,
    /// Middle and 95th percentile of the measured vertices' standard deviations, millimetres.
    pub deviation_mm: [f64; 2],
    /// Places without measurement, the largest first.
    pub holes: Vec<Hole>,
}

/// Describes a surface.
pub fn describe(surface: &Surface) -> SurfaceReport {
    let mesh = &surface.mesh;
    let (mut measured, mut invented) = (0.0, 0.0);
    for triangle in &mesh.triangles {
        let of_invented = triangle.iter().any(|&v| mesh.is_invented(v as usize));
        *if of_invented { &mut invented } else { &mut measured } += mesh.area(triangle);
    }
    let area_of = |kinds: &[HoleKind]| -> f64 {
        surface.holes.iter().filter(|h| kinds.contains(&h.kind)).map(|h| h.area_m2).sum()
    };
    let to_see = measured + area_of(&[HoleKind::Closed, HoleKind::Unseen]);
    SurfaceReport {
        triangles: mesh.triangles.len(),
        measured_m2: rounded(measured, 1e7),
        invented_m2: rounded(invented, 1e7),
        coverage_percent: rounded(100.0 * measured / to_see.max(1e-12), 10.0),
        underside_measured_percent: None,
        watertight: !mesh.triangles.is_empty() && topology::borders(&mesh.triangles).is_empty(),
        points_per_cm2: rounded(mesh.measured_count() as f64 / (measured * 1e4).max(1e-12), 10.0),
        deviation_mm: deviations_mm(mesh),
        holes: surface.holes.iter().map(rounded_hole).collect(),
    }
}

/// Share of the surface near the floor (world frame, z up) that faces it and was measured, percent; `None` where there is none.
pub fn underside_measured_percent(surface: &Surface) -> Option<f64> {
    let mesh = &surface.mesh;
    let (mut measured, mut missing) = (0.0, 0.0);
    for triangle in &mesh.triangles {
        let low = triangle.iter().all(|&v| f64::from(mesh.vertices.points[v as usize][2]) < UNDERSIDE_METRES);
        let area = mesh.twice_area_vector(triangle);
        if low && area.z < FACES_DOWN * area.norm() {
            let invented = triangle.iter().any(|&v| mesh.is_invented(v as usize));
            *if invented { &mut missing } else { &mut measured } += 0.5 * area.norm();
        }
    }
    let open = |h: &&Hole| {
        h.kind == HoleKind::Unseen && h.facing[2] < FACES_DOWN && h.center_m[2] < UNDERSIDE_METRES
    };
    missing += surface.holes.iter().filter(open).map(|h| h.area_m2).sum::<f64>();
    (measured + missing > 0.0).then(|| rounded(100.0 * measured / (measured + missing), 10.0))
}

fn deviations_mm(mesh: &Mesh) -> [f64; 2] {
    let mut known: Vec<f32> = mesh.deviations_metres.iter().copied().filter(|d| d.is_finite()).collect();
    known.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| known.get(((known.len() as f64 - 1.0) * share).max(0.0) as usize).copied();
    [0.5, 0.95].map(|share| at(share).map_or(0.0, |d| rounded(f64::from(d) * 1000.0, 1e3)))
}

fn rounded_hole(hole: &Hole) -> Hole {
    Hole {
        kind: hole.kind,
        center_m: hole.center_m.map(|v| rounded(v, 1e4)),
        facing: hole.facing.map(|v| rounded(v, 1e3)),
        rim_m: rounded(hole.rim_m, 1e4),
        area_m2: rounded(hole.area_m2, 1e7),
    }
}

fn rounded(value: f64, steps: f64) -> f64 {
    (value * steps).round() / steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::PointCloud;
    use crate::mesh::INVENTED;

    #[test]
    fn measured_and_invented_surface_are_told_apart() {
        let points = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0]];
        let mesh = Mesh {
            vertices: PointCloud { points, ..PointCloud::default() },
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            deviations_metres: vec![0.0002, 0.0003, 0.0004, INVENTED],
        };
        let hole = Hole {
            kind: HoleKind::Unseen,
            center_m: [0.0; 3],
            facing: [0.0, 0.0, 1.0],
            rim_m: 0.4,
            area_m2: 0.005,
        };
        let report = describe(&Surface { mesh, holes: vec![hole] });
        assert_eq!((report.measured_m2, report.invented_m2), (0.005, 0.005));
        assert_eq!(report.coverage_percent, 50.0);
        assert!(!report.watertight);
        assert_eq!(report.deviation_mm, [0.3, 0.3]);
    }

    #[test]
    fn of_the_underside_what_was_measured_is_told_from_what_was_not() {
        let points = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
        let mut mesh = Mesh {
            vertices: PointCloud { points, ..PointCloud::default() },
            // Two that face down, one of them partly invented, and one that faces sideways.
            triangles: vec![[0, 2, 1], [0, 3, 2], [0, 1, 4]],
            deviations_metres: vec![0.0002, 0.0003, 0.0004, INVENTED, 0.0002],
        };
        let of = |mesh: &Mesh| underside_measured_percent(&Surface { mesh: mesh.clone(), holes: vec![] });
        assert_eq!(of(&mesh), Some(50.0));
        mesh.vertices.points.iter_mut().for_each(|p| p[2] += 0.05);
        assert_eq!(of(&mesh), None);
    }
}
