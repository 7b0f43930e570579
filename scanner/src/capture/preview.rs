//! The cloud that grows with every view: each view goes through the first stages of a build by itself (markers, depth against
//! the board, cut), without fitting the views to each other, and is thinned. World frame, metres.

use std::f64::consts::TAU;

use reconstruct::board::{BoardFile, KnownBoard};
use reconstruct::calibrate::CalibrationPrior;
use reconstruct::cloud::PointCloud;
use reconstruct::image::DepthImage;
use reconstruct::mesh::Mesh;
use reconstruct::pose::Pose;
use reconstruct::recording::{Rig, ViewImages};
use reconstruct::{stream, voxel};

use super::state::Sector;
use crate::config::Config;
use crate::pipeline::{ViewSource, cut, depth, load, markers};
use crate::recording::RecordingError;
use crate::ui::Ui;

/// Edge of the preview's cells, metres.
const CELL_METRES: f32 = 0.0035;
/// Surface seen more edge-on than this is left to the other views, cosine.
const MIN_COSINE: f32 = 0.25;
/// Sectors around the product.
const SECTORS: usize = 12;
/// A view shows the sides that face it within this angle, radians.
const SEEN_WITHIN: f64 = TAU / 12.0;

/// What one view gives to the preview.
#[derive(Debug, Clone)]
pub struct ViewPreview {
    /// The product's points, thinned.
    pub cloud: PointCloud,
    /// Pixels of the product.
    pub points: usize,
    /// Tags that placed the view.
    pub tags: usize,
    /// The colour camera on the board.
    pub world_from_camera: Pose,
}

/// One view in memory.
pub(crate) struct OneView<'a> {
    pub(crate) rig: Rig,
    pub(crate) board: &'a BoardFile,
    pub(crate) name: &'a str,
    pub(crate) images: ViewImages,
}

impl ViewSource for OneView<'_> {
    fn rig(&self) -> Rig {
        self.rig
    }

    fn board(&self) -> Option<&BoardFile> {
        Some(self.board)
    }

    fn view_names(&self) -> Vec<String> {
        vec![self.name.to_owned()]
    }

    fn load_view(&self, _index: usize) -> Result<ViewImages, RecordingError> {
        let mut images = self.images.clone();
        images.depths.retain(|depth: &DepthImage| depth.data.iter().any(|&raw| raw != 0));
        if images.depths.is_empty() {
            return Err(RecordingError::NoDepth { view: self.name.to_owned() });
        }
        Ok(images)
    }

    fn is_stream(&self) -> bool {
        false
    }
}

/// Places and cuts one view; what is wrong with it otherwise, in words a seller understands. `depth_prior` is what is known
/// of this very sensor.
pub fn of_view(
    rig: Rig,
    board: &KnownBoard,
    depth_prior: Option<CalibrationPrior>,
    images: ViewImages,
) -> Result<ViewPreview, String> {
    let config = Config { depth_prior, ..Config::default() };
    let name = images.name.clone();
    let board = BoardFile::Known(board.clone());
    let source = OneView { rig, board: &board, name: &name, images };
    let ui = Ui::silent();
    let mut work =
        load::load_and_average(&source, &config, &ui.stage("load", 1)).map_err(|e| e.to_string())?;
    markers::place_on_board(&mut work, Some(&board), &config);
    depth::calibrate(&mut work, &config);
    cut::cut_background(&mut work, &config);
    let view = &work.views[0];
    if let Some(reason) = &view.left_out {
        return Err(reason.to_string());
    }
    if let Some(failure) = work.failure {
        return Err(failure);
    }
    let (Some(geometry), Some(world_from_camera), Some(marker_pose)) =
        (&view.geometry, view.world_from_camera, &view.marker_pose)
    else {
        return Err("the view could not be placed on the board".to_owned());
    };
    let pixels: Vec<usize> = geometry.product_pixels().collect();
    let facing: Vec<usize> =
        pixels.iter().copied().filter(|&i| geometry.incidence_cosine(i) > MIN_COSINE).collect();
    let in_camera = PointCloud {
        points: facing.iter().map(|&i| geometry.points[i]).collect(),
        colors: facing.iter().map(|&i| view.color.data[i]).collect(),
        normals: facing.iter().map(|&i| geometry.normals[i]).collect(),
    };
    let cloud = thinned(&in_camera.transformed(&world_from_camera));
    Ok(ViewPreview { cloud, points: pixels.len(), tags: marker_pose.used.len(), world_from_camera })
}

/// All views together as the viewer's stream, and how many points it has; nothing where there is none.
pub fn merged<'a>(clouds: impl Iterator<Item = &'a PointCloud>) -> Option<(Vec<u8>, usize)> {
    let mut all = PointCloud::default();
    clouds.filter(|cloud| !cloud.is_empty()).for_each(|cloud| all.append(cloud));
    let mesh = Mesh::of_points(thinned(&all));
    let bytes = stream::encode(&mesh).ok()?;
    Some((bytes, mesh.vertices.len()))
}

fn thinned(cloud: &PointCloud) -> PointCloud {
    // Refused only for extents that no room has; then there is nothing to show.
    voxel::downsample(cloud, CELL_METRES).map(|thinned| thinned.cloud).unwrap_or_default()
}

/// Where a camera stands: azimuth from the board's x (0 to 2 pi), elevation, distance from the board's middle.
pub fn place_of(world_from_camera: &Pose) -> [f64; 3] {
    let place = world_from_camera.translation.vector;
    [place.y.atan2(place.x).rem_euclid(TAU), place.z.atan2(place.x.hypot(place.y)), place.norm()]
}

/// The sectors around the product, and which of them a view looked at.
pub fn sectors(azimuths: &[f64]) -> Vec<Sector> {
    let width = TAU / SECTORS as f64;
    let seen = |middle: f64| azimuths.iter().any(|a| angle_between(*a, middle) <= SEEN_WITHIN + 1e-9);
    (0..SECTORS)
        .map(|k| k as f64 * width)
        .map(|from| Sector { from, to: from + width, seen: seen(from + 0.5 * width) })
        .collect()
}

/// Angle between two directions, 0 to pi.
pub fn angle_between(a: f64, b: f64) -> f64 {
    let turn = (a - b).rem_euclid(TAU);
    turn.min(TAU - turn)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Kind, ScanSpec, Simulator};

    fn seen(azimuths_deg: &[f64]) -> usize {
        let azimuths: Vec<f64> = azimuths_deg.iter().map(|a| a.to_radians()).collect();
        sectors(&azimuths).iter().filter(|sector| sector.seen).count()
    }

    #[test]
    fn a_view_sees_the_sectors_that_face_it() {
        assert_eq!(seen(&[]), 0);
        assert_eq!(seen(&[0.0]), 2);
        assert_eq!(seen(&[15.0]), 3);
        assert_eq!(seen(&[0.0, 60.0, 120.0, 180.0, 240.0, 300.0]), 12);
        assert_eq!(seen(&[0.0, 90.0, 180.0, 270.0]), 8);
        assert!((angle_between(0.1, TAU - 0.1) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn a_view_lies_where_it_belongs() {
        let spec = ScanSpec { views: 4, frames: 3, ..ScanSpec::new(Kind::Mug, 2) };
        let simulator = Simulator::new(&spec).unwrap();
        let view = of_view(simulator.rig(), &spec.board, None, simulator.view(1)).unwrap();
        let truth = simulator.truth().mesh.vertices.bounds().unwrap();
        let (low, high) = view.cloud.bounds().unwrap();
        for k in 0..3 {
            assert!(low[k] > truth.0[k] - 0.01 && high[k] < truth.1[k] + 0.01, "{low:?} {high:?} {truth:?}");
        }
        let [azimuth, elevation, distance] = place_of(&view.world_from_camera);
        let true_place = place_of(&simulator.stations()[1]);
        assert!((azimuth - true_place[0]).abs() < 0.01 && (elevation - true_place[1]).abs() < 0.01);
        assert!((distance - true_place[2]).abs() < 0.01 && view.tags > 6 && view.points > 3000);
        let (bytes, points) = merged([&view.cloud, &view.cloud].into_iter()).unwrap();
        assert_eq!(stream::decode(&bytes).unwrap().0.points as usize, points);
    }

    #[test]
    fn a_view_without_depth_or_markers_says_why() {
        let spec = ScanSpec { views: 1, frames: 1, ..ScanSpec::new(Kind::Mug, 2) };
        let simulator = Simulator::new(&spec).unwrap();
        let mut images = simulator.view(0);
        images.color.data.fill([90; 3]);
        let reason = of_view(simulator.rig(), &spec.board, None, images.clone()).unwrap_err();
        assert!(reason.contains("no marker could be read"), "{reason}");
        images.depths[0].data.fill(0);
        let reason = of_view(simulator.rig(), &spec.board, None, images).unwrap_err();
        assert!(reason.contains("no depth"), "{reason}");
    }
}
