//! The source document's registration, stage by stage (slides 18–26), for comparison with the better choices.
//!
//! Views come already cut and placed by markers. Each next one (the target frame of slide 20) is laid on the model of those
//! before it (the model frame): voxel grid on both → normals and curvature by PCA → key points of large curvature → FPFH →
//! nearest match of every key point → RANSAC of three samples with SVD → ICP on the key points by their positions, with RANSAC
//! against outliers and SVD, until the error no longer falls. World frame, metres.

mod report;

use nalgebra::{Point3, Vector3};
use thiserror::Error;

pub use self::report::{PairReport, SourceReport};
use super::fpfh::{Descriptor, describe};
use super::icp::{IcpConfig, Metric, Registration, Target, register};
use super::keypoints::{KeypointConfig, largest_curvature};
use super::matching::{MatchConfig, match_descriptors};
use super::ransac::{Consensus, RansacConfig, consensus};
use crate::cloud::PointCloud;
use crate::knn::Tree;
use crate::normals::{Neighbourhood, estimate};
use crate::pose::{Pose, rotation_error_radians};
use crate::voxel::{VoxelError, downsample};

/// A view as the chain takes it.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceView {
    /// Name for the report.
    pub name: String,
    /// The product's points, in the world frame by the markers.
    pub cloud_in_world: PointCloud,
    /// Where the camera stood, world frame, metres.
    pub camera_in_world: [f32; 3],
}

/// The chain's parameters, for products of 5 to 50 cm at 0.6 to 1 m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourceConfig {
    /// Edge of the voxel grid's cells, metres.
    pub voxel_metres: f32,
    /// Neighbours of a point for its normal and curvature are within this, metres.
    pub normal_radius: f32,
    /// Key points.
    pub keypoints: KeypointConfig,
    /// Neighbours for FPFH are within this, metres.
    pub feature_radius: f32,
    /// The initial alignment's RANSAC.
    pub initial: RansacConfig,
    /// Key points farther apart than this after the initial alignment are no pairs in ICP, metres.
    pub icp_distance: f32,
    /// RANSAC in every ICP iteration.
    pub icp_ransac: RansacConfig,
    /// ICP iterations at most.
    pub icp_iterations: usize,
    /// ICP has reached its acceptable error when a step moves less than this, metres.
    pub icp_tolerance: f64,
}

impl Default for SourceConfig {
    fn default() -> Self {
        let ransac = RansacConfig::default();
        Self {
            voxel_metres: 0.004,
            normal_radius: 0.012,
            keypoints: KeypointConfig::default(),
            feature_radius: 0.024,
            initial: RansacConfig { iterations: 20_000, inlier_distance: 0.01, ..ransac },
            icp_distance: 0.012,
            icp_ransac: RansacConfig { iterations: 100, inlier_distance: 0.008, ..ransac },
            icp_iterations: 100,
            icp_tolerance: 1e-5,
        }
    }
}

/// What the chain made.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SourceResult {
    /// For every view, what is to be applied on the left of its marker pose.
    pub corrections: Vec<Pose>,
    /// All views in one cloud at full resolution, world frame.
    pub model: PointCloud,
    /// Counts and errors of every stage.
    pub report: SourceReport,
}

/// Why the chain can't run.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SourceError {
    /// No view at all.
    #[error("there is no view to register")]
    NoView,
    /// A cloud can't be down-sampled.
    #[error("view {view}: {error}")]
    Voxel {
        /// Name of the view.
        view: String,
        /// What is wrong.
        error: VoxelError,
    },
}

/// Registers the views one after the other to the growing model.
///
/// A view whose key points give no alignment keeps its marker pose, and its report says why.
pub fn register_views(views: &[SourceView], config: &SourceConfig) -> Result<SourceResult, SourceError> {
    let first = views.first().ok_or(SourceError::NoView)?;
    let mut model = Model::default();
    model.add(&first.cloud_in_world, &first.camera_in_world);
    let mut result = SourceResult { corrections: vec![Pose::identity()], ..SourceResult::default() };
    result.report.points_first_view = first.cloud_in_world.len();
    for view in &views[1..] {
        let (correction, pair) = register_view(view, &model, config)
            .map_err(|error| SourceError::Voxel { view: view.name.clone(), error })?;
        let camera = correction * Point3::from(view.camera_in_world.map(f64::from));
        model.add(&view.cloud_in_world.transformed(&correction), &camera.map(|v| v as f32).into());
        result.corrections.push(correction);
        result.report.pairs.push(pair);
    }
    result.report.points_model = model.cloud.len();
    result.model = model.cloud;
    Ok(result)
}

/// The model so far; each point's "normal" is the direction to the camera that saw it, which is what orients PCA normals.
#[derive(Default)]
struct Model {
    cloud: PointCloud,
    towards_camera: Vec<[f32; 3]>,
}

impl Model {
    fn add(&mut self, cloud: &PointCloud, camera: &[f32; 3]) {
        let camera = Vector3::from(*camera);
        let towards = cloud.points.iter().map(|p| <[f32; 3]>::from((camera - Vector3::from(*p)).normalize()));
        self.towards_camera.extend(towards);
        let bare = PointCloud { normals: Vec::new(), ..cloud.clone() };
        self.cloud.append(&bare);
    }
}

/// A cloud after down-sampling, normals, key points and features.
struct Features {
    cloud: PointCloud,
    keypoints: PointCloud,
    descriptors: Vec<Descriptor>,
}

fn features(
    points: &[[f32; 3]],
    towards_camera: &[[f32; 3]],
    config: &SourceConfig,
) -> Result<Features, VoxelError> {
    let cloud = PointCloud { points: points.to_vec(), colors: Vec::new(), normals: towards_camera.to_vec() };
    let mut cloud = downsample(&cloud, config.voxel_metres)?.cloud;
    let tree = Tree::new(&cloud.points);
    let surface = estimate(&cloud.points, &tree, Neighbourhood::Radius(config.normal_radius), &[0.0; 3]);
    for (normal, towards) in cloud.normals.iter_mut().zip(&surface.normals) {
        let found = Vector3::from(*towards);
        *normal = if found.dot(&Vector3::from(*normal)) < 0.0 { (-found).into() } else { found.into() };
    }
    let chosen = largest_curvature(&cloud.points, &surface.curvatures, &tree, &config.keypoints);
    let descriptors = describe(&cloud, &tree, config.feature_radius, &chosen);
    let keypoints = cloud.select(&chosen);
    Ok(Features { cloud, keypoints, descriptors })
}

fn register_view(
    view: &SourceView,
    model: &Model,
    config: &SourceConfig,
) -> Result<(Pose, PairReport), VoxelError> {
    let mut placed = Model::default();
    placed.add(&view.cloud_in_world, &view.camera_in_world);
    let source = features(&placed.cloud.points, &placed.towards_camera, config)?;
    let target = features(&model.cloud.points, &model.towards_camera, config)?;
    let rule = MatchConfig { mutual: false, ratio: None };
    let matches = match_descriptors(&source.descriptors, &target.descriptors, rule);
    let mut report = PairReport {
        view: view.name.clone(),
        points: view.cloud_in_world.len(),
        model_points: model.cloud.len(),
        points_down_sampled: source.cloud.len(),
        model_points_down_sampled: target.cloud.len(),
        key_points: source.keypoints.len(),
        model_key_points: target.keypoints.len(),
        matches: matches.len(),
        ..PairReport::default()
    };
    let initial = consensus(&source.keypoints.points, &target.keypoints.points, &matches, &config.initial);
    let Some(initial) = initial else {
        report.failure = Some("no three matched key points agree; the marker pose was kept".into());
        return Ok((Pose::identity(), report));
    };
    note_initial(&mut report, &initial);
    let refined = refine(&source.keypoints, &target.keypoints, &initial.target_from_source, config);
    let Some(refined) = refined else {
        report.failure = Some("too few key points for ICP; the marker pose was kept".into());
        return Ok((Pose::identity(), report));
    };
    note_refined(&mut report, &refined, &view.cloud_in_world);
    Ok((refined.target_from_source, report))
}

/// ICP on the key points (slide 25).
fn refine(
    source: &PointCloud,
    target: &PointCloud,
    start: &Pose,
    config: &SourceConfig,
) -> Option<Registration> {
    let icp = IcpConfig {
        metric: Metric::PointToPoint,
        max_distance: config.icp_distance,
        min_normal_cosine: None,
        iterations: config.icp_iterations,
        tolerance_metres: config.icp_tolerance,
        outlier_ransac: Some(config.icp_ransac),
        ..IcpConfig::default()
    };
    register(source, &Target::new(target), start, &icp).ok()
}

fn note_initial(report: &mut PairReport, initial: &Consensus) {
    report.ransac_samples = initial.samples;
    report.ransac_inliers = initial.inliers.len();
    report.ransac_rmse_metres = initial.inlier_rmse_metres;
}

fn note_refined(report: &mut PairReport, refined: &Registration, cloud: &PointCloud) {
    report.icp_iterations = refined.iterations;
    report.icp_converged = refined.converged;
    report.icp_rmse_metres = refined.inlier_rmse_metres;
    report.icp_fitness = refined.fitness;
    let (lo, hi) = cloud.bounds().unwrap_or_default();
    let centre = Point3::from(std::array::from_fn(|k| f64::from(lo[k] + hi[k]) / 2.0));
    report.moved_metres = (refined.target_from_source * centre - centre).norm();
    report.turned_radians = rotation_error_radians(&refined.target_from_source, &Pose::identity());
}

#[cfg(test)]
mod tests;
