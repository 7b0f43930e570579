//! Where loose sheets lie: a bundle adjustment over all views in which every tag has a place and a direction on one
//! table. Sheets left free would tilt by degrees; held to one plane, the corners of all views determine them well.

mod adjust;
mod start;

use nalgebra::{Isometry2, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};
use thiserror::Error;

use super::detect::Detection;
use super::pose::Rejection;
use crate::board::{KnownBoard, LooseSheets, Tag};
use crate::camera::Intrinsics;
use crate::pose::Pose;

use adjust::{Observation, Problem};

/// Most sheets and views that are placed together.
const MAX_SHEETS: usize = 200;

/// How sheets are placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayoutConfig {
    /// Residual from which a corner counts less, pixels.
    pub huber_px: f64,
    /// A tag whose corners lie farther off than this in a view (root mean square, pixels) is not used there.
    pub max_tag_error_px: f64,
}

impl Default for LayoutConfig {
    fn default() -> Self {
        Self { huber_px: 1.0, max_tag_error_px: 2.0 }
    }
}

/// Sheets at the places that were worked out.
///
/// World: origin at the centroid of the placed tags' centres, z up, x along the upright tag with the lowest id.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetLayout {
    /// The tags as a board; the inner region is the hull of the tags' centres.
    pub board: KnownBoard,
    /// One entry a view: the camera's frame from the board's; `None` where the view shares no tag with the others.
    pub camera_from_board: Vec<Option<Pose>>,
    /// Root mean square distance of all used corners, pixels.
    pub reprojection_px: f64,
    /// View index, id and reason of every tag that was not used.
    pub rejected: Vec<(usize, u32, Rejection)>,
}

/// Why sheets could not be placed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum LayoutError {
    /// Nothing was found.
    #[error("no tag was found in any view")]
    NoTags,
    /// One sheet alone is not a board.
    #[error("only one tag was found (id {0}); at least two must be seen together")]
    OneTag(u32),
    /// No two sheets are seen together or fit together.
    #[error("the tags that were seen do not fit on one table")]
    NoLayout,
    /// Sizes or intrinsics are not numbers of a sheet or a camera.
    #[error("the tag size or the intrinsics hold impossible numbers")]
    Unusable,
    /// More than the adjustment is made for.
    #[error("{0} different tags were seen; at most {MAX_SHEETS} loose sheets can be placed")]
    TooMany(usize),
}

/// Places the sheets seen in `views` (one list of detections a view, all by one camera).
///
/// Ids that were not printed are left out where the file names the printed ones.
pub fn place_sheets(
    views: &[Vec<Detection>],
    sheets: &LooseSheets,
    camera: &Intrinsics,
    config: &LayoutConfig,
) -> Result<SheetLayout, LayoutError> {
    let size = sheets.tag_size_m;
    if !camera.is_valid() || !(0.001..10.0).contains(&size) {
        return Err(LayoutError::Unusable);
    }
    let (mut observations, mut rejected) = collect(views, sheets);
    let ids = ids_of(&observations);
    match ids[..] {
        [] => return Err(LayoutError::NoTags),
        [id] => return Err(LayoutError::OneTag(id)),
        _ if ids.len() > MAX_SHEETS => return Err(LayoutError::TooMany(ids.len())),
        _ => {}
    }
    for _ in 0..4 {
        let problem = start::place(&observations, views.len(), size, camera, config)
            .and_then(|problem| problem.adjust(camera, config.huber_px))
            .ok_or(LayoutError::NoLayout)?;
        let worst = problem.disagreeing(camera, config.max_tag_error_px);
        let Some((view, id)) = worst else { return finish(&problem, sheets, camera, rejected) };
        rejected.push((view, id, Rejection::Disagrees));
        observations.retain(|o| (o.view, o.id) != (view, id));
    }
    Err(LayoutError::NoLayout)
}

/// Usable detections as observations.
fn collect(
    views: &[Vec<Detection>],
    sheets: &LooseSheets,
) -> (Vec<Observation>, Vec<(usize, u32, Rejection)>) {
    let (mut observations, mut rejected) = (Vec::new(), Vec::new());
    for (view, detections) in views.iter().enumerate() {
        for d in detections {
            let count = detections.iter().filter(|other| other.id == d.id).count();
            let corners = d.corner_sigma_px.iter().filter(|s| s.is_finite()).count();
            if !sheets.ids.is_empty() && !sheets.ids.contains(&d.id) {
                rejected.push((view, d.id, Rejection::NotOnBoard));
            } else if count > 1 {
                rejected.push((view, d.id, Rejection::SeenTwice));
            } else if corners < 2 {
                rejected.push((view, d.id, Rejection::CutOff));
            } else {
                let (corners, sigma_px) = (d.corners, d.corner_sigma_px);
                observations.push(Observation { view, id: d.id, corners, sigma_px });
            }
        }
    }
    rejected.dedup();
    (observations, rejected)
}

/// Ids that occur, ascending, once each.
fn ids_of(observations: &[Observation]) -> Vec<u32> {
    let mut ids: Vec<u32> = observations.iter().map(|o| o.id).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

/// Corners of the upright tag about its centre, metres.
fn local_corners(size: f64) -> [Point2<f64>; 4] {
    let h = 0.5 * size;
    [[-h, h], [h, h], [h, -h], [-h, -h]].map(Point2::from)
}

/// Moves the world to its place among the tags and dresses the result.
fn finish(
    problem: &Problem,
    sheets: &LooseSheets,
    camera: &Intrinsics,
    rejected: Vec<(usize, u32, Rejection)>,
) -> Result<SheetLayout, LayoutError> {
    if problem.ids.len() < 2 {
        return Err(LayoutError::NoLayout);
    }
    let count = problem.places.len() as f64;
    let centroid = problem.places.iter().fold(Vector2::zeros(), |s, p| s + p.translation.vector) / count;
    // Ids ascend: the first is the lowest.
    let table_from_world = Isometry2::new(centroid, problem.places[0].rotation.angle());
    let tags: Vec<Tag> = problem
        .ids
        .iter()
        .zip(&problem.places)
        .map(|(&id, place)| {
            let world_from_tag = table_from_world.inverse() * place;
            let corner = |c: Point2<f64>| {
                let p = world_from_tag * c;
                [p.x, p.y, 0.0]
            };
            Tag { id, corners_m: local_corners(sheets.tag_size_m).map(corner) }
        })
        .collect();
    let lifted = lift(&table_from_world);
    let camera_from_board = problem.views.iter().map(|v| v.map(|pose| pose * lifted)).collect();
    let inner_region_m = hull(&tags);
    let board = KnownBoard { version: 1, family: sheets.family, tags, inner_region_m };
    let reprojection_px = problem.rms_px(camera).ok_or(LayoutError::NoLayout)?;
    Ok(SheetLayout { board, camera_from_board, reprojection_px, rejected })
}

/// The movement on the table as one in space.
fn lift(flat: &Isometry2<f64>) -> Pose {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), flat.rotation.angle());
    let shift = flat.translation.vector.push(0.0);
    Pose::from_parts(Translation3::from(shift), UnitQuaternion::from_rotation_matrix(&turn))
}

/// Convex hull of the tags' centres, counter-clockwise (Andrew's monotone chain).
fn hull(tags: &[Tag]) -> Vec<[f64; 2]> {
    let centre = |t: &Tag| {
        let sum = t.corners_m.iter().fold(Vector3::zeros(), |s, c| s + Point3::from(*c).coords) / 4.0;
        Point2::new(sum.x, sum.y)
    };
    let mut points: Vec<Point2<f64>> = tags.iter().map(centre).collect();
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let chain = |ordered: &mut dyn Iterator<Item = &Point2<f64>>| {
        let mut kept: Vec<Point2<f64>> = Vec::new();
        for p in ordered {
            while let [.., a, b] = kept[..]
                && (b - a).perp(&(p - b)) <= 0.0
            {
                kept.pop();
            }
            kept.push(*p);
        }
        kept.pop();
        kept
    };
    let mut outline = chain(&mut points.iter());
    outline.extend(chain(&mut points.iter().rev()));
    outline.into_iter().map(Into::into).collect()
}

#[cfg(test)]
mod tests;
