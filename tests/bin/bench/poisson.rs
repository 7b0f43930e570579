//! Screened Poisson on the peers' input (eight noisy views, oriented), judged by its distance to the true mesh: what the
//! comparison's `score()` takes of the surface, in millimetres.

use std::path::Path;

use anyhow::Context;
use nalgebra::Vector3;
use reconstruct::knn::Tree;
use reconstruct::mesh::Mesh;
use reconstruct::mesh::topology::{borders, defects, pieces};
use reconstruct::model_file::{self, Kind, Limits};
use reconstruct::surface::poisson::{PoissonConfig, PoissonError, Reconstruction, reconstruct};

use crate::clock::Bench;
use crate::inputs::cloud;

/// Places on the surface that are measured, as the peers' score takes.
const PLACES: usize = 100_000;

pub(crate) fn run(bench: &Bench) -> anyhow::Result<()> {
    let path = bench.data.join("syn/bunny/poisson_in.ply");
    if !["poisson depth8", "poisson depth9"].iter().any(|stage| bench.wants(stage)) {
        return Ok(());
    }
    if !path.exists() {
        println!("# {} is absent: py/poisson.py of the comparison makes it", path.display());
        return Ok(());
    }
    let input = cloud(&path)?;
    let truth = mesh(&bench.data.join("syn/bunny/mesh.ply"))?;
    let distances = ToMesh::new(&truth);
    for depth in [8, 9] {
        let config = PoissonConfig { depth, ..PoissonConfig::default() };
        let judge = |made: &Result<Reconstruction, PoissonError>| match made {
            Err(error) => format!("failed: {error}"),
            Ok(made) => format!("npts={} {}", input.len(), judged(made, &distances)),
        };
        bench.stage(&format!("poisson depth{depth}"), || reconstruct(&input, &config), judge);
    }
    Ok(())
}

fn mesh(path: &Path) -> anyhow::Result<Mesh> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).with_context(|| name.clone())?;
    model_file::read(Kind::Ply, bytes.as_slice(), &Limits::default()).context(name)
}

fn judged(made: &Reconstruction, truth: &ToMesh) -> String {
    let mesh = &made.mesh;
    let mut off: Vec<f64> = on_surface(mesh).iter().map(|p| 1e3 * truth.distance(p)).collect();
    off.sort_by(f64::total_cmp);
    let at = |share: f64| off.get((share * off.len() as f64) as usize).copied().unwrap_or(f64::NAN);
    let found = defects(mesh);
    format!(
        "tris={} acc_med={:.3}mm acc_p90={:.3} acc_p95={:.3} invented={:.3} pieces={} borders={} defects={}",
        mesh.triangles.len(),
        at(0.5),
        at(0.9),
        at(0.95),
        made.invented_share,
        pieces(mesh.vertices.len(), &mesh.triangles).1,
        borders(&mesh.triangles).len(),
        found.crowded_edges + found.split_vertices + found.degenerate,
    )
}

/// Places spread evenly over a surface's area.
fn on_surface(mesh: &Mesh) -> Vec<Vector3<f64>> {
    let whole: f64 = mesh.triangles.iter().map(|t| mesh.area(t)).sum();
    let step = whole / PLACES as f64;
    let (mut places, mut before): (Vec<Vector3<f64>>, f64) = (Vec::with_capacity(PLACES), 0.5 * step);
    for t in &mesh.triangles {
        before += mesh.area(t);
        let [a, b, c] = t.map(|v| Vector3::from(mesh.vertices.points[v as usize]).cast::<f64>());
        while before >= step {
            before -= step;
            // two irrational steps fill the triangles evenly
            let at = places.len() as f64;
            let (u, v) = ((at * 0.754_877_666).fract().sqrt(), (at * 0.569_840_291).fract());
            places.push(a * (1.0 - u) + b * (u * (1.0 - v)) + c * (u * v));
        }
    }
    places
}

/// Distances to a mesh: of the triangles whose middles are near enough, the nearest.
struct ToMesh {
    corners: Vec<[Vector3<f64>; 3]>,
    middles: Tree,
    /// Farthest corner from a triangle's middle.
    radius: f32,
}

impl ToMesh {
    fn new(mesh: &Mesh) -> Self {
        let corner = |v: u32| Vector3::from(mesh.vertices.points[v as usize]).cast::<f64>();
        let corners: Vec<_> = mesh.triangles.iter().map(|t| t.map(corner)).collect();
        let middle = |t: &[Vector3<f64>; 3]| (t[0] + t[1] + t[2]) / 3.0;
        let radius =
            corners.iter().flat_map(|t| t.iter().map(move |c| (c - middle(t)).norm())).fold(0.0, f64::max);
        let middles: Vec<[f32; 3]> = corners.iter().map(|t| middle(t).cast::<f32>().into()).collect();
        Self { corners, middles: Tree::new(&middles), radius: radius as f32 }
    }

    fn distance(&self, p: &Vector3<f64>) -> f64 {
        let query: [f32; 3] = p.cast::<f32>().into();
        let Some(nearest) = self.middles.nearest(&query) else { return f64::INFINITY };
        let reach = nearest.sq_dist.sqrt() + self.radius + 1e-6;
        let near = self.middles.within_radius_unsorted(&query, reach);
        near.iter().map(|n| to_triangle(p, &self.corners[n.index])).fold(f64::INFINITY, f64::min)
    }
}

/// Distance of a place to a triangle: over its inside to the plane, else to the nearest side.
fn to_triangle(p: &Vector3<f64>, [a, b, c]: &[Vector3<f64>; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    let sides = [(a, b), (b, c), (c, a)];
    if normal.norm() > 0.0
        && sides.iter().all(|(from, to)| (*to - *from).cross(&(p - *from)).dot(&normal) >= 0.0)
    {
        return (p - a).dot(&normal).abs() / normal.norm();
    }
    let to_side = |from: &Vector3<f64>, to: &Vector3<f64>| {
        let along = to - from;
        let t = (p - from).dot(&along) / along.norm_squared().max(1e-30);
        (p - (from + along * t.clamp(0.0, 1.0))).norm()
    };
    sides.iter().map(|(from, to)| to_side(from, to)).fold(f64::INFINITY, f64::min)
}
