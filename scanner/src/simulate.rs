//! The simulated Kinect: products made by this code, scanned in a cluttered room, with the exact truth beside the images.
//!
//! [`scan`] renders a whole recording in memory, [`write()`] puts it on disk as `recording.json` with `truth/`, and [`MockDevice`]
//! gives frames one by one as a driver would. A [`SimulatedScan`] can be built without files: it is a [`crate::pipeline::ViewSource`]. Everything follows from the seed; the number of threads changes no byte.
//! World = board frame, metres; colour camera x right, y down, z forward.

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use reconstruct::board::{BoardFile, KnownBoard};
use reconstruct::camera::Intrinsics;
use reconstruct::image::{ColorImage, DepthImage};
use reconstruct::mesh::Mesh;
use reconstruct::pose::Pose;
use reconstruct::recording::{Rig, ViewImages};

pub mod board;
pub mod color;
pub mod depth;
pub mod nets;
pub mod noise;
pub mod product;
pub mod raster;
pub mod rest;
pub mod scene;
pub mod sdf;
mod source;
pub mod spec;
pub mod texture;
pub mod truth;
mod write;

pub use board::{Paper, ring};
pub use depth::NoiseLevel;
pub use product::Kind;
pub use rest::Rest;
pub use spec::{ScanSpec, SimulateError};
pub use write::write;

use board::Sheet;
use color::{Exposure, Lamp, picture};
use depth::{DepthSensor, DepthView, warp_field};
use noise::mix_seed;
use product::Product;
use raster::Hits;
use scene::{Object, Scene, cover_boxes};

/// Samples a pixel along each side.
const SUPERSAMPLE: usize = 3;
/// Time between frames and between views, nanoseconds.
const FRAME_NANOS: u64 = 33_333_333;
const VIEW_NANOS: u64 = 2_000_000_000;

/// A scan with what really was.
#[derive(Debug, Clone)]
pub struct SimulatedScan {
    /// What was asked for.
    pub spec: ScanSpec,
    /// Cameras.
    pub rig: Rig,
    /// The board in the pictures; none in a stream without a board.
    pub board: Option<KnownBoard>,
    /// Images.
    pub views: Vec<ViewImages>,
    /// The truth.
    pub truth: Truth,
    board_file: Option<BoardFile>,
}

/// What really was.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Pose of the colour camera in every view.
    pub world_from_camera: Vec<Pose>,
    /// The product's surface where it stood (but for the knocked view), world.
    pub mesh: Mesh,
    /// View in which the product stood elsewhere.
    pub knocked: Option<usize>,
}

/// One pair of images as a device delivers it.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Colour picture.
    pub color: ColorImage,
    /// Depth image.
    pub depth: DepthImage,
    /// When it was taken.
    pub timestamp_nanos: u64,
}

/// A product on its board before a simulated Kinect, ready to be looked at from every station.
pub struct Simulator {
    spec: ScanSpec,
    rig: Rig,
    sensor: DepthSensor,
    product: Product,
    mesh: Mesh,
    world_from_product: Pose,
    sheet: Option<Sheet>,
    stations: Vec<Pose>,
}

impl Simulator {
    /// Builds the product and places the cameras.
    pub fn new(spec: &ScanSpec) -> Result<Self, SimulateError> {
        spec.check()?;
        let sheet = match (spec.no_board, Sheet::of(&spec.board)) {
            (true, _) => None,
            (false, Some(sheet)) => Some(sheet),
            (false, None) => return Err(SimulateError::Board(spec.board.family.name())),
        };
        let room = room_inside(&spec.board).ok_or(SimulateError::NoRoom)?;
        let (product, world_from_product) = place(spec, room);
        let mesh = product.mesh();
        let world_from_product = lay_down(spec.rest, &mesh, &world_from_product, room);
        let (low, high) = product.bounds();
        let middle = world_from_product * Point3::from(((low + high) * 0.5).cast::<f64>());
        let rig = rig(spec);
        let (width, height) = (rig.depth.width as usize, rig.depth.height as usize);
        let warp_px = warp_field(width, height, spec.warp_px as f32, mix_seed(&[spec.seed, 0x3a49]));
        let sensor =
            DepthSensor { camera: rig.depth, noise: spec.noise, warp_px, scale_error: spec.scale_error };
        // Half-way between the product's middle and the board's, so that both are in the picture.
        let target = Point3::new(0.5 * middle.x, 0.5 * middle.y, 0.6 * middle.z);
        let stations = spec.stations(&target);
        Ok(Self { spec: spec.clone(), rig, sensor, product, mesh, world_from_product, sheet, stations })
    }

    /// Number of views.
    pub fn views(&self) -> usize {
        self.stations.len()
    }

    /// The cameras.
    pub fn rig(&self) -> Rig {
        self.rig
    }

    /// Pose of the colour camera in every view.
    pub fn stations(&self) -> &[Pose] {
        &self.stations
    }

    /// Images of one view.
    pub fn view(&self, index: usize) -> ViewImages {
        self.look(index, |color, depth| ViewImages {
            name: format!("{index:03}"),
            color: color(),
            depths: (0..self.spec.frames).map(|k| depth.frame(k)).collect(),
        })
    }

    /// What really was.
    pub fn truth(&self) -> Truth {
        Truth {
            world_from_camera: self.stations.clone(),
            mesh: Mesh {
                vertices: self.mesh.vertices.transformed(&self.world_from_product),
                triangles: self.mesh.triangles.clone(),
                ..Mesh::default()
            },
            knocked: self.spec.knock,
        }
    }

    /// Draws the scene of a view and hands the cameras to `take`.
    fn look<R>(&self, index: usize, take: impl FnOnce(&dyn Fn() -> ColorImage, &DepthView) -> R) -> R {
        let seed = self.spec.rest_seed(&[0x71e3, index as u64]);
        let covers = self.covers(index);
        let scene = Scene::new(
            &self.product,
            &self.mesh,
            &self.product_pose(index),
            self.sheet.as_ref(),
            &covers,
            self.spec.seed as u32,
        );
        let from_color = Hits::draw(&scene, &self.rig.color, &self.stations[index], SUPERSAMPLE);
        let color =
            || picture(&scene, &from_color, &Lamp::over(&scene, self.spec.seed), &Exposure::of_view(seed));
        if self.spec.unregistered {
            let pose = self.stations[index] * self.rig.color_from_depth;
            let from_depth = Hits::draw(&scene, &self.rig.depth, &pose, SUPERSAMPLE);
            take(&color, &DepthView::new(&scene, &from_depth, &self.sensor, seed))
        } else {
            take(&color, &DepthView::new(&scene, &from_color, &self.sensor, seed))
        }
    }

    fn product_pose(&self, view: usize) -> Pose {
        if self.spec.knock != Some(view) {
            return self.world_from_product;
        }
        let mut rng = fastrand::Rng::with_seed(mix_seed(&[self.spec.seed, 0x60c4]));
        let angle = std::f64::consts::TAU * rng.f64();
        let turn = if rng.bool() { 6.0f64 } else { -6.0 }.to_radians();
        let slide = Translation3::new(0.012 * angle.cos(), 0.012 * angle.sin(), 0.0);
        let turned =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn) * self.world_from_product.rotation;
        Pose::from_parts(slide * self.world_from_product.translation, turned)
    }

    fn covers(&self, view: usize) -> Vec<Object> {
        match &self.sheet {
            Some(sheet) if self.spec.hide_board > 0.0 => {
                let mut rng = fastrand::Rng::with_seed(mix_seed(&[self.spec.seed, 0xc0fe, view as u64]));
                let angle = std::f64::consts::TAU * rng.f64();
                cover_boxes(sheet, &self.spec.board.inner_region_m, self.spec.hide_board, angle, &mut rng)
            }
            _ => Vec::new(),
        }
    }
}

/// The simulated Kinect as a device that stands in one view: an endless iterator of frames.
pub struct MockDevice<'a> {
    simulator: &'a Simulator,
    view: usize,
    next: usize,
}

impl<'a> MockDevice<'a> {
    /// The device at a view's station; views count round and round.
    pub fn at(simulator: &'a Simulator, view: usize) -> Self {
        Self { simulator, view: view % simulator.views(), next: 0 }
    }
}

impl Iterator for MockDevice<'_> {
    type Item = Frame;

    fn next(&mut self) -> Option<Frame> {
        let index = self.next;
        self.next += 1;
        let timestamp_nanos = timestamp(self.view, index);
        Some(self.simulator.look(self.view, |color, depth| Frame {
            color: color(),
            depth: depth.frame(index),
            timestamp_nanos,
        }))
    }
}

/// Simulates a whole scan in memory.
pub fn scan(spec: &ScanSpec) -> Result<SimulatedScan, SimulateError> {
    scan_with(spec, || ())
}

/// As [`scan`]; `view_done` is called after every view, from several threads.
pub fn scan_with(spec: &ScanSpec, view_done: impl Fn() + Sync) -> Result<SimulatedScan, SimulateError> {
    let simulator = Simulator::new(spec)?;
    let views = (0..simulator.views())
        .into_par_iter()
        .map(|index| {
            let view = simulator.view(index);
            view_done();
            view
        })
        .collect();
    let board = (!spec.no_board).then(|| spec.board.clone());
    let board_file = board.clone().map(BoardFile::Known);
    Ok(SimulatedScan {
        spec: spec.clone(),
        rig: simulator.rig,
        board,
        views,
        truth: simulator.truth(),
        board_file,
    })
}

fn timestamp(view: usize, frame: usize) -> u64 {
    view as u64 * VIEW_NANOS + frame as u64 * FRAME_NANOS
}

/// Half width and half depth of the box in the middle of the board.
fn room_inside(board: &KnownBoard) -> Option<[f64; 2]> {
    let half = |k: usize| {
        let values = board.inner_region_m.iter().map(|p| p[k]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        high.min(-low)
    };
    let room = [half(0), half(1)];
    room.iter().all(|v| v.is_finite() && *v > 0.02).then_some(room)
}

/// The product, made small enough for the board's middle, and where it stands there.
fn place(spec: &ScanSpec, room: [f64; 2]) -> (Product, Pose) {
    let mut rng = fastrand::Rng::with_seed(mix_seed(&[spec.seed, 0x91ac]));
    let product = Product::new(spec.product, spec.seed);
    let (low, high) = product.bounds();
    let size = [f64::from(high.x - low.x), f64::from(high.y - low.y)];
    // A long product lies along the board; a compact one stands as it comes.
    let most = if size[0].max(size[1]) > 0.15 { 10.0 } else { 180.0 };
    let yaw = (most * (2.0 * rng.f64() - 1.0f64)).to_radians();
    let (sin, cos) = (yaw.sin().abs(), yaw.cos().abs());
    let reach = [0.5 * (size[0] * cos + size[1] * sin), 0.5 * (size[0] * sin + size[1] * cos)];
    let fit = (0.92 * room[0] / reach[0]).min(0.92 * room[1] / reach[1]).min(1.0);
    let product = product.shrunk(fit as f32);
    let mut offset = |k: usize| (2.0 * rng.f64() - 1.0) * (0.95 * room[k] - fit * reach[k]).clamp(0.0, 0.015);
    let slide = Translation3::new(offset(0), offset(1), 0.0);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    let centre = (low + high) * (0.5 * fit as f32);
    let to_middle = Translation3::new(f64::from(-centre.x), f64::from(-centre.y), 0.0);
    (product, Pose::from_parts(slide, turn) * to_middle)
}

/// Where a product is that does not stand: turned until it rests, its middle over the board's, slid and headed by the seed as if
/// it stood. A long one lies along the board.
fn lay_down(rest: Rest, mesh: &Mesh, standing: &Pose, room: [f64; 2]) -> Pose {
    if rest == Rest::Standing {
        return *standing;
    }
    let turn = rest.turn(mesh);
    let points = || mesh.vertices.points.iter().map(|p| Point3::from(*p).cast::<f64>());
    let across = |turn: &UnitQuaternion<f64>| {
        points().map(|p| turn * p).fold(([f64::MAX; 3], [f64::MIN; 3]), |(low, high), p| {
            (std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k])))
        })
    };
    let headed =
        |degrees: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), degrees.to_radians()) * turn;
    let tightness = |turn: &UnitQuaternion<f64>| {
        let (low, high) = across(turn);
        ((high[0] - low[0]) / room[0]).max((high[1] - low[1]) / room[1])
    };
    let headings = (0..18).map(|k| headed(20.0 * f64::from(k)));
    // Any heading that fits will do; the seed's own is kept where it does.
    let own = headed(standing.rotation.euler_angles().2.to_degrees());
    let turn = if tightness(&own) < 1.8 {
        own
    } else {
        headings.min_by(|a, b| tightness(a).total_cmp(&tightness(b))).unwrap_or(own)
    };
    let (low, high) = across(&turn);
    let to = Translation3::new(-0.5 * (low[0] + high[0]), -0.5 * (low[1] + high[1]), -low[2]);
    Pose::from_parts(to, turn)
}

/// The cameras: depth in the colour camera's geometry, or a depth camera of its own about 25 mm beside it.
fn rig(spec: &ScanSpec) -> Rig {
    let color = Intrinsics::pinhole(640, 480, 525.0, 525.0, 319.5, 239.5);
    if !spec.unregistered {
        return Rig { color, depth: color, color_from_depth: Pose::identity() };
    }
    let depth = Intrinsics::pinhole(640, 480, 580.5, 579.0, 316.2, 243.8);
    let color_from_depth =
        Pose::new(Vector3::new(0.0251, -0.0006, -0.0024), Vector3::new(0.006, -0.009, 0.003));
    Rig { color, depth, color_from_depth }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small(product: Kind) -> ScanSpec {
        ScanSpec { views: 2, frames: 2, ..ScanSpec::new(product, 5) }
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_whatever_the_threads() {
        let spec = ScanSpec { hide_board: 0.5, ..small(Kind::Basket) };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| scan(&spec).unwrap())
        };
        let (one, three) = (with(1), with(3));
        assert_eq!(one.views, three.views);
        assert_eq!(one.truth.mesh, three.truth.mesh);
        let other = scan(&ScanSpec { seed: 6, ..spec }).unwrap();
        assert_ne!(one.views[0].depths[0], other.views[0].depths[0]);
    }

    #[test]
    fn the_truth_is_what_the_camera_sees() {
        for kind in Kind::ALL {
            let spec = small(kind);
            let simulator = Simulator::new(&spec).unwrap();
            let truth = simulator.truth();
            let scene =
                Scene::new(&simulator.product, &simulator.mesh, &simulator.world_from_product, None, &[], 1);
            let hits = Hits::draw(&scene, &simulator.rig.color, &truth.world_from_camera[1], SUPERSAMPLE);
            let (mut agree, mut nearer, mut farther) = (0, 0, 0);
            let eye = truth.world_from_camera[1].translation.vector.cast::<f32>();
            for (p, n) in truth.mesh.vertices.points.iter().zip(&truth.mesh.vertices.normals) {
                let to_eye = (eye - Vector3::from(*p)).normalize();
                if Vector3::from(*n).dot(&to_eye) < 0.3 {
                    continue;
                }
                let q = truth.world_from_camera[1].inverse() * Point3::from(*p).cast::<f64>();
                let pixel = simulator.rig.color.project(&q).unwrap();
                match hits.at(pixel.x, pixel.y).map(|hit| hit.depth - q.z) {
                    Some(gap) if gap.abs() < 0.0015 => agree += 1,
                    Some(gap) if gap < 0.0 => nearer += 1,
                    _ => farther += 1,
                }
            }
            // What faces the camera is seen or hidden by something nearer, but for a few places at outlines.
            assert!(farther * 100 < agree && agree > nearer, "{kind}: {agree} {nearer} {farther}");
        }
    }

    #[test]
    fn a_knock_moves_the_product_by_twelve_millimetres_and_six_degrees() {
        let simulator = Simulator::new(&ScanSpec { knock: Some(1), ..small(Kind::Mug) }).unwrap();
        let (still, knocked) = (simulator.product_pose(0), simulator.product_pose(1));
        let slide = (knocked.translation.vector - still.translation.vector).norm();
        assert!((slide - 0.012).abs() < 1e-9);
        assert!((knocked.rotation.angle_to(&still.rotation).to_degrees() - 6.0).abs() < 1e-6);
        assert_eq!(simulator.truth().knocked, Some(1));
    }

    #[test]
    fn products_stand_in_the_middle_of_every_board() {
        for (k, kind) in Kind::ALL.into_iter().enumerate() {
            for paper in [Paper::A4, Paper::A3, Paper::A2] {
                let board = ring(paper, reconstruct::board::Family::Aruco4x4_50);
                let [x, y] = board.inner_region_m[2].map(|v| v as f32);
                let spec = ScanSpec { board, seed: k as u64, ..small(kind) };
                let (low, high) = Simulator::new(&spec).unwrap().truth().mesh.vertices.bounds().unwrap();
                assert!(
                    low[0] > -x && high[0] < x && low[1] > -y && high[1] < y,
                    "{kind} {paper:?} {low:?} {high:?}"
                );
            }
        }
    }

    #[test]
    fn the_mock_device_delivers_the_frames_of_a_view() {
        let simulator = Simulator::new(&small(Kind::Bowl)).unwrap();
        let view = simulator.view(1);
        let frames: Vec<Frame> = MockDevice::at(&simulator, 1).take(2).collect();
        for (frame, depth) in frames.iter().zip(&view.depths) {
            assert_eq!((&frame.color, &frame.depth), (&view.color, depth));
        }
        assert!(frames[0].timestamp_nanos < frames[1].timestamp_nanos);
    }

    #[test]
    fn nonsense_is_refused() {
        for spec in [
            ScanSpec { views: 0, ..small(Kind::Mug) },
            ScanSpec { elevations_deg: Vec::new(), ..small(Kind::Mug) },
            ScanSpec { scale_error: f64::NAN, ..small(Kind::Mug) },
            ScanSpec { knock: Some(2), ..small(Kind::Mug) },
            ScanSpec { board: KnownBoard { tags: Vec::new(), ..small(Kind::Mug).board }, ..small(Kind::Mug) },
            ScanSpec {
                board: KnownBoard { inner_region_m: Vec::new(), ..small(Kind::Mug).board },
                ..small(Kind::Mug)
            },
        ] {
            assert!(scan(&spec).is_err());
        }
    }
}
