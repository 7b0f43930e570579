//! A closed surface of an imported model's points.

use reconstruct::cloud::PointCloud;
use reconstruct::knn::Tree;
use reconstruct::mesh::Mesh;
use reconstruct::normals::{self, Neighbourhood};
use reconstruct::surface::poisson::{self, PoissonConfig, Reconstruction};

use super::ImportError;

/// Neighbours that tell a point's normal, and those that it hands its side on to.
const OF_NORMALS: usize = 20;
const OF_SIDES: usize = 12;
/// Less invented surface is not worth a word.
const LITTLE: f64 = 0.001;

/// How a surface is made of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// Screened Poisson: closed; what no point is near is invented and marked
    Poisson,
}

/// The surface of a model's points, by their normals where it has some.
pub fn of_points(model: Mesh, depth: u32) -> Result<Reconstruction, ImportError> {
    let mut cloud = model.vertices;
    if !cloud.has_normals() {
        cloud.normals = estimated_normals(&cloud);
    }
    let config = PoissonConfig { depth, ..PoissonConfig::default() };
    Ok(poisson::reconstruct(&cloud, &config)?)
}

/// Normals by the neighbours, turned to one side.
fn estimated_normals(cloud: &PointCloud) -> Vec<[f32; 3]> {
    let tree = Tree::new(&cloud.points);
    let anywhere = [0.0; 3];
    let surface = normals::estimate(&cloud.points, &tree, Neighbourhood::Nearest(OF_NORMALS), &anywhere);
    let mut normals = surface.normals;
    normals::orient(&cloud.points, &tree, &mut normals, OF_SIDES);
    normals
}

/// What is to be said of it beside its size.
pub fn warnings(made: &Reconstruction, depth: u32) -> Vec<String> {
    let mut warnings = Vec::new();
    if made.invented_share >= LITTLE {
        warnings.push(format!(
            "{:.0} % of the surface is invented: no point is near; it is marked",
            (100.0 * made.invented_share).max(1.0)
        ));
    }
    if made.depth < depth {
        warnings.push(format!("the points are too few for depth {depth}: {} was used", made.depth));
    }
    warnings
}
