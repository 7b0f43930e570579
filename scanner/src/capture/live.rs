//! The live picture: what one frame shows, for the page's traffic light and its two pictures.
//!
//! Tags are read in the whole colour picture. Depth is looked at in half the colour camera's resolution, which is enough
//! for the eye and for the cut, and four times cheaper. Pixels are the colour picture's, metres, seconds.

mod encode;
mod motion;

use std::time::Instant;

use kinect::source::Frame;
use nalgebra::Point3;
use reconstruct::average::BASELINE_METRES;
use reconstruct::board::KnownBoard;
use reconstruct::calibrate::{CalibrationPrior, DepthCalibration};
use reconstruct::camera::Intrinsics;
use reconstruct::depth_to_color::{self, Registration};
use reconstruct::image::GrayImage;
use reconstruct::marker::{
    BoardPose, BoardPoseError, DetectConfig, Detection, Dictionary, PoseConfig, board_pose, detect,
};
use reconstruct::pose::Pose;
use reconstruct::recording::Rig;
use reconstruct::segment::{self, Region, SegmentConfig};
use reconstruct::view::DepthView;
use serde::Serialize;

use super::depth_picture;
use super::hints::{self, Board, Hint, Level, Sight};
pub use encode::Picture;
use motion::Motion;

/// Pixels a step when brightness and depth are counted.
const SAMPLE: usize = 5;
/// Grey level from which a pixel is burnt out.
const BURNT: u8 = 252;

/// Looks at the frames of one sensor on one board.
pub struct Live {
    rig: Rig,
    board: Option<KnownBoard>,
    region: Option<Region>,
    half: Intrinsics,
    rays: Vec<[f32; 2]>,
    registration: Option<Registration>,
    calibration: Option<DepthCalibration>,
    motion: Motion,
    packets: Packets,
    rate: Rate,
}

/// What a frame shows.
#[derive(Debug, Clone)]
pub struct Look {
    /// For the page; goes before the pictures.
    pub header: Header,
    /// The worst of the hints.
    pub light: Level,
    /// Where the camera stands, where that is known.
    pub world_from_camera: Option<Pose>,
    /// Depth and cut in half resolution, drawn only for a page that looks on.
    depth: Vec<f32>,
    keep: Vec<bool>,
}

/// JSON at the head of a live picture.
#[derive(Debug, Clone, Serialize)]
pub struct Header {
    pub index: u64,
    pub fps: f64,
    pub width: usize,
    pub height: usize,
    pub color_bytes: usize,
    pub depth_bytes: usize,
    pub tags: Vec<SeenTag>,
    pub region: Vec<[f64; 2]>,
    pub hints: Vec<Hint>,
    pub light: Level,
    pub still_seconds: f64,
    pub valid_depth: f64,
    pub lost_packets: u32,
    pub distance_metres: Option<f64>,
}

/// A tag in the colour picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SeenTag {
    pub id: u32,
    pub corners: [[f64; 2]; 4],
}

impl Live {
    /// For a sensor's cameras, what is known of its depth, and a board, once that is chosen.
    pub fn new(rig: &Rig, depth_prior: Option<&CalibrationPrior>, board: Option<&KnownBoard>) -> Self {
        let half_rig = Rig { color: halved(&rig.color), depth: halved(&rig.depth), ..*rig };
        Self {
            rig: *rig,
            board: board.cloned(),
            region: board.map(|board| Region::of_board(board, &SegmentConfig::default())),
            half: half_rig.color,
            rays: half_rig.color.ray_table(),
            registration: depth_to_color::is_needed(rig).then(|| Registration::new(&half_rig)),
            calibration: depth_prior.map(|prior| {
                DepthCalibration::from_prior(prior, rig.color.width as usize, rig.color.height as usize)
            }),
            motion: Motion::default(),
            packets: Packets::default(),
            rate: Rate::default(),
        }
    }

    /// Whether a frame has the sizes that it is made for.
    pub fn fits(&self, frame: &Frame) -> bool {
        has_sizes_of(frame, &self.rig)
    }

    /// Looks at one frame that came at `now`.
    pub fn look(&mut self, frame: &Frame, now: Instant) -> Look {
        let gray = frame.color.to_gray();
        let depth = self.half_depth(frame);
        let family = self.board.as_ref().map(|board| board.family);
        let tags = family.map_or_else(Vec::new, |family| {
            detect(&gray, Dictionary::of(family), Some(&self.rig.color), &DetectConfig::default())
        });
        let (board, pose) = self.place(&tags);
        let camera_from_board = pose.map(|pose| pose.camera_from_board);
        let region = camera_from_board.map(|pose| self.outline(&pose)).unwrap_or_default();
        let cut = camera_from_board.map(|pose| self.cut(&depth, &pose.inverse()));
        let still_seconds = self.motion.still_seconds(&tags, &gray, now);
        let (brightness, burnt) = brightness(&gray);
        let measured = |z: &&f32| **z > 0.0;
        let valid_depth = depth.iter().filter(measured).count() as f64 / depth.len().max(1) as f64;
        let share = |pixels: usize| pixels as f64 / depth.len().max(1) as f64;
        let sight = Sight {
            board,
            distance: camera_from_board.map(|pose| distance(&depth, cut.as_ref(), &pose)),
            brightness,
            burnt,
            valid_depth,
            valid_on_product: (!region.is_empty()).then(|| valid_inside(&depth, &self.half, &region)),
            product: cut.as_ref().map(|cut| [share(cut.product_pixels), share(cut.outside_pixels)]),
            lost_packets: self.packets.in_last_second(frame.lost_packets, now),
            still_seconds,
        };
        let hints = hints::hints(&sight);
        let light = hints::light_of(&hints);
        let header = Header {
            index: frame.index,
            fps: self.rate.of(frame.index, now),
            width: frame.color.width,
            height: frame.color.height,
            color_bytes: 0,
            depth_bytes: 0,
            tags: tags.iter().map(seen).collect(),
            region,
            hints,
            light,
            still_seconds: rounded(still_seconds, 100.0),
            valid_depth: rounded(valid_depth, 1000.0),
            lost_packets: sight.lost_packets,
            distance_metres: sight.distance.map(|metres| rounded(metres, 1000.0)),
        };
        let world_from_camera = camera_from_board.map(|pose| pose.inverse());
        Look { header, light, world_from_camera, depth, keep: cut.map(|cut| cut.mask).unwrap_or_default() }
    }

    /// The two pictures of a frame with its header, as they are sent.
    pub fn picture(&self, frame: &Frame, look: Look) -> Option<Picture> {
        let (width, height) = (self.half.width as usize, self.half.height as usize);
        let depth = depth_picture::draw(&look.depth, &look.keep, width, height);
        encode::picture(&frame.color, &depth, look.header)
    }

    fn place(&self, tags: &[Detection]) -> (Board, Option<BoardPose>) {
        let Some(board) = &self.board else { return (Board::NotChosen, None) };
        match board_pose(tags, board, &self.rig.color, &PoseConfig::default()) {
            // A few tags of another board can agree by chance.
            Ok(pose) if pose.rejected.len() > pose.used.len() => (
                Board::Unknown("most of its markers do not lie where the chosen board has them".to_owned()),
                None,
            ),
            Ok(pose) => (Board::Placed(pose.used.len(), board.tags.len()), Some(pose)),
            Err(BoardPoseError::NoTags) => (Board::Hidden(0), None),
            Err(BoardPoseError::OneTag(_)) => (Board::Hidden(1), None),
            Err(other) => (Board::Unknown(other.to_string()), None),
        }
    }

    /// Where the product stands, in the picture; nothing where part of it is behind the camera.
    fn outline(&self, camera_from_board: &Pose) -> Vec<[f64; 2]> {
        let corners = self.board.iter().flat_map(|board| &board.inner_region_m);
        let pixel =
            |&[x, y]: &[f64; 2]| self.rig.color.project(&(camera_from_board * Point3::new(x, y, 0.0)));
        let pixels: Option<Vec<[f64; 2]>> =
            corners.map(|corner| pixel(corner).map(|p| [rounded(p.x, 10.0), rounded(p.y, 10.0)])).collect();
        pixels.unwrap_or_default()
    }

    fn cut(&self, depth: &[f32], world_from_camera: &Pose) -> segment::Cut {
        let view = DepthView::new(self.half, &self.rays, depth);
        let nowhere = Region { inner: Vec::new(), outer: Vec::new() };
        let region = self.region.as_ref().unwrap_or(&nowhere);
        segment::cut(&view, world_from_camera, region, &SegmentConfig::default())
    }

    /// Every second row and column of the depth, in the colour camera's geometry, as calibrated, metres, 0 = none.
    fn half_depth(&self, frame: &Frame) -> Vec<f32> {
        let mut depth = self.half_depth_as_measured(frame);
        let Some(calibration) = &self.calibration else { return depth };
        let (width, focal_baseline) = (self.half.width as usize, self.rig.color.fx * BASELINE_METRES);
        for (i, z) in depth.iter_mut().enumerate().filter(|(_, z)| **z > 0.0) {
            let (u, v) = ((2 * (i % width)) as f64, (2 * (i / width)) as f64);
            let disparity = calibration.correct(u, v, focal_baseline / f64::from(*z));
            *z = if disparity > 0.0 { (focal_baseline / disparity) as f32 } else { 0.0 };
        }
        depth
    }

    fn half_depth_as_measured(&self, frame: &Frame) -> Vec<f32> {
        let image = &frame.depth;
        let metres = 1.0 / image.units_per_metre;
        let rows = image.data.chunks_exact(image.width.max(1)).step_by(2).take(image.height / 2);
        let half: Vec<f32> = rows
            .flat_map(|row| row.iter().step_by(2).take(image.width / 2))
            .map(|&raw| (f64::from(raw) * metres) as f32)
            .collect();
        let Some(registration) = &self.registration else { return half };
        registration.register(&half).into_iter().map(|z| if z.is_nan() { 0.0 } else { z }).collect()
    }
}

/// Whether a frame has the sizes that its sensor announced.
pub fn has_sizes_of(frame: &Frame, rig: &Rig) -> bool {
    let size = |camera: &Intrinsics| (camera.width as usize, camera.height as usize);
    let (color, depth) = (&frame.color, &frame.depth);
    (color.width, color.height) == size(&rig.color)
        && (depth.width, depth.height) == size(&rig.depth)
        && color.data.len() == color.width * color.height
        && depth.data.len() == depth.width * depth.height
}

/// The camera whose pixels are every second one of `camera`'s.
fn halved(camera: &Intrinsics) -> Intrinsics {
    Intrinsics {
        width: camera.width / 2,
        height: camera.height / 2,
        fx: camera.fx / 2.0,
        fy: camera.fy / 2.0,
        cx: camera.cx / 2.0,
        cy: camera.cy / 2.0,
        distortion: camera.distortion,
    }
}

fn seen(tag: &Detection) -> SeenTag {
    let corner = |c: &nalgebra::Point2<f64>| [rounded(c.x, 10.0), rounded(c.y, 10.0)];
    SeenTag { id: tag.id, corners: tag.corners.each_ref().map(corner) }
}

/// Median depth of the product, or how far the board's middle is.
fn distance(depth: &[f32], cut: Option<&segment::Cut>, camera_from_board: &Pose) -> f64 {
    let kept = cut.into_iter().flat_map(|cut| depth.iter().zip(&cut.mask)).filter(|(_, keep)| **keep);
    let mut values: Vec<f32> = kept.map(|(z, _)| *z).step_by(3).collect();
    if values.len() < 30 {
        return camera_from_board.translation.vector.norm();
    }
    let middle = values.len() / 2;
    f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// Mean grey level and the share of burnt-out pixels.
fn brightness(gray: &GrayImage) -> (f64, f64) {
    let samples = || gray.data.iter().step_by(SAMPLE);
    let count = samples().count().max(1) as f64;
    let sum: u64 = samples().map(|&v| u64::from(v)).sum();
    (sum as f64 / count, samples().filter(|&&v| v >= BURNT).count() as f64 / count)
}

/// Share of the pixels inside an outline (of the whole picture) that have depth.
fn valid_inside(depth: &[f32], half: &Intrinsics, outline: &[[f64; 2]]) -> f64 {
    let (width, height) = (half.width as usize, half.height as usize);
    let limits = |k: usize, most: usize| {
        let values = outline.iter().map(|corner| corner[k] / 2.0);
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        (low.max(0.0) as usize)..(high.max(0.0) as usize).min(most)
    };
    let (mut inside, mut valid) = (0usize, 0usize);
    for y in limits(1, height).step_by(2) {
        for x in limits(0, width).step_by(2) {
            if contains(outline, 2.0 * x as f64, 2.0 * y as f64) {
                inside += 1;
                valid += usize::from(depth[y * width + x] > 0.0);
            }
        }
    }
    if inside == 0 { 0.0 } else { valid as f64 / inside as f64 }
}

/// Even-odd rule.
fn contains(polygon: &[[f64; 2]], x: f64, y: f64) -> bool {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let crossed = edges
        .filter(|(a, b)| (a[1] > y) != (b[1] > y) && x < (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) + a[0]);
    crossed.count() % 2 == 1
}

fn rounded(value: f64, steps: f64) -> f64 {
    (value * steps).round() / steps
}

/// Packets lost during the last second.
#[derive(Debug, Default)]
struct Packets {
    lost: std::collections::VecDeque<(Instant, u32)>,
}

impl Packets {
    fn in_last_second(&mut self, lost: u32, now: Instant) -> u32 {
        if lost > 0 {
            self.lost.push_back((now, lost));
        }
        while self.lost.front().is_some_and(|(at, _)| now.duration_since(*at).as_secs_f64() > 1.0) {
            self.lost.pop_front();
        }
        self.lost.iter().fold(0, |sum, (_, lost)| sum.saturating_add(*lost))
    }
}

/// Frames a second that the sensor delivers, by its own count.
#[derive(Debug, Default)]
struct Rate {
    seen: std::collections::VecDeque<(Instant, u64)>,
}

impl Rate {
    fn of(&mut self, index: u64, now: Instant) -> f64 {
        // A sensor that started again counts from 0.
        if self.seen.back().is_some_and(|(_, last)| *last > index) {
            self.seen.clear();
        }
        self.seen.push_back((now, index));
        while self.seen.len() > 2 && now.duration_since(self.seen[0].0).as_secs_f64() > 2.0 {
            self.seen.pop_front();
        }
        let (start, first) = self.seen[0];
        let seconds = now.duration_since(start).as_secs_f64();
        if seconds > 0.0 { rounded((index - first) as f64 / seconds, 10.0) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests;
