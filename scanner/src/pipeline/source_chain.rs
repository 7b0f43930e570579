//! `--method source`: the views, placed by their markers and cut, go through the source document's own chain.

use nalgebra::Point3;
use reconstruct::cloud::PointCloud;
use reconstruct::register::source_chain::{SourceConfig, SourceReport, SourceView, register_views};
use reconstruct::view::DepthView;

use super::load::{View, Work};

/// Registers view after view to the growing model; gives the model and what every stage did.
pub fn register_as_the_source(scan: &mut Work, seed: u64) -> (PointCloud, Option<SourceReport>) {
    let used: Vec<usize> = (0..scan.views.len()).filter(|&i| source_view(&scan.views[i]).is_some()).collect();
    let views: Vec<SourceView> = used.iter().filter_map(|&i| source_view(&scan.views[i])).collect();
    let mut config = SourceConfig::default();
    config.initial.seed = seed;
    config.icp_ransac.seed = seed;
    let result = match register_views(&views, &config) {
        Ok(result) => result,
        Err(error) => {
            scan.failure.get_or_insert(error.to_string());
            return (PointCloud::default(), None);
        }
    };
    for (&i, correction) in used.iter().zip(&result.corrections) {
        let pose = scan.views[i].world_from_camera.map(|p| correction * p);
        scan.views[i].world_from_camera = pose;
    }
    (union(scan), Some(result.report))
}

/// All product points of all placed views, with the normals the model file needs.
fn union(scan: &Work) -> PointCloud {
    let mut model = PointCloud::default();
    for view in scan.placed_views() {
        let geometry = view.geometry;
        let pixels: Vec<usize> = geometry.product_pixels().collect();
        let in_camera = PointCloud {
            points: pixels.iter().map(|&i| geometry.points[i]).collect(),
            colors: pixels.iter().map(|&i| view.color.data[i]).collect(),
            normals: pixels.iter().map(|&i| geometry.normals[i]).collect(),
        };
        model.append(&in_camera.transformed(&view.world_from_camera));
    }
    model
}

/// The product's points of a used view in the world frame, with their colours.
fn source_view(view: &View) -> Option<SourceView> {
    let geometry: &DepthView = view.geometry.as_ref().filter(|_| view.is_used())?;
    let world_from_camera = view.world_from_camera?;
    let pixels: Vec<usize> = (0..geometry.points.len()).filter(|&i| geometry.mask[i]).collect();
    let in_camera = PointCloud {
        points: pixels.iter().map(|&i| geometry.points[i]).collect(),
        colors: pixels.iter().map(|&i| view.color.data[i]).collect(),
        normals: Vec::new(),
    };
    Some(SourceView {
        name: view.name.clone(),
        cloud_in_world: in_camera.transformed(&world_from_camera),
        camera_in_world: (world_from_camera * Point3::origin()).map(|v| v as f32).into(),
    })
}
