//! What to simulate: product, views, errors of the sensor, and what goes wrong.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use reconstruct::board::{Family, KnownBoard};
use reconstruct::pose::Pose;

use super::board::{Paper, ring};
use super::color::look_at;
use super::depth::NoiseLevel;
use super::noise::mix_seed;
use super::product::Kind;
use super::rest::Rest;

/// Why a scan can't be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimulateError {
    /// A number is outside what makes sense.
    #[error("{what} must be between {low} and {high}, not {found}")]
    OutOfRange {
        /// Name of the number.
        what: &'static str,
        /// Smallest allowed value.
        low: f64,
        /// Largest allowed value.
        high: f64,
        /// What was given.
        found: f64,
    },
    /// The board can't be drawn.
    #[error(
        "the board can't be drawn: it needs tags that lie flat on z = 0 within 2.5 m, with ids that {0} has"
    )]
    Board(&'static str),
    /// The board leaves no room.
    #[error("the board's inner region has no area to stand a product on")]
    NoRoom,
}

/// One simulated scan.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanSpec {
    /// What is scanned.
    pub product: Kind,
    /// How it lies: another pose of the same product has the same seed.
    pub rest: Rest,
    /// Everything left to chance follows from it.
    pub seed: u64,
    /// Number of views.
    pub views: usize,
    /// Frames a view.
    pub frames: usize,
    /// Random errors of depth.
    pub noise: NoiseLevel,
    /// Largest smooth error of disparity, pixels.
    pub warp_px: f64,
    /// How much too long depth reads: 0.015 for 1.5 %.
    pub scale_error: f64,
    /// The board; it is left out of the picture with `no_board`.
    pub board: KnownBoard,
    /// Share of the ring that is hidden in every view, on changing sides.
    pub hide_board: f64,
    /// View in which the product has been knocked: 12 mm and 6 degrees.
    pub knock: Option<usize>,
    /// No board: a stream of single frames around the product.
    pub no_board: bool,
    /// Elevations of the cameras in degrees; view `i` takes the `i`-th, round and round.
    pub elevations_deg: Vec<f64>,
    /// Distances from the camera to the product's middle in metres, taken like the elevations.
    pub distances_m: Vec<f64>,
    /// The depth camera is its own, beside the colour camera.
    pub unregistered: bool,
    /// Images are stored flipped left-right.
    pub mirrored: bool,
}

impl ScanSpec {
    /// A scan as a careful seller takes it, without scale error and with a little warp.
    pub fn new(product: Kind, seed: u64) -> Self {
        Self {
            product,
            rest: Rest::Standing,
            seed,
            views: 8,
            frames: 5,
            noise: NoiseLevel::Low,
            warp_px: 0.1,
            scale_error: 0.0,
            board: ring(Paper::A3, Family::Aruco4x4_50),
            hide_board: 0.0,
            knock: None,
            no_board: false,
            elevations_deg: vec![38.0, 42.0, 35.0, 60.0],
            distances_m: vec![0.72, 0.75, 0.70, 0.66],
            unregistered: false,
            mirrored: false,
        }
    }

    /// One of the many scans of the accuracy run: product, sizes, noise level, scale error, warp, board and hiding drawn by seed.
    ///
    /// The views are those of a guided seller: six around at 35 to 45 degrees, one high and near, one low and far.
    pub fn random(seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(mix_seed(&[seed, 0x5ca9]));
        let between = |rng: &mut fastrand::Rng, low: f64, high: f64| low + (high - low) * rng.f64();
        let product = Kind::ALL[rng.usize(0..Kind::ALL.len())];
        let mut spec = Self::new(product, seed);
        spec.noise = if rng.bool() { NoiseLevel::Low } else { NoiseLevel::High };
        spec.warp_px = 0.2;
        spec.scale_error = between(&mut rng, -0.03, 0.03);
        if rng.f64() < 0.25 {
            spec.board = ring(Paper::A2, Family::Tag36h11);
        }
        if rng.bool() {
            spec.hide_board = 0.5;
        }
        let base = between(&mut rng, 36.0, 43.0);
        let distance = between(&mut rng, 0.68, 0.76);
        let view = |rng: &mut fastrand::Rng, k: usize| match k {
            3 => (between(rng, 58.0, 66.0), distance * 0.9),
            7 => (between(rng, 24.0, 29.0), distance * 1.18),
            _ => (base + between(rng, -3.0, 3.0), distance * between(rng, 0.97, 1.03)),
        };
        (spec.elevations_deg, spec.distances_m) = (0..spec.views).map(|k| view(&mut rng, k)).unzip();
        spec
    }

    /// Checks every number.
    pub fn check(&self) -> Result<(), SimulateError> {
        let within = |what, found: f64, low: f64, high: f64| {
            if (low..=high).contains(&found) {
                Ok(())
            } else {
                Err(SimulateError::OutOfRange { what, low, high, found })
            }
        };
        within("the number of views", self.views as f64, 1.0, 720.0)?;
        within("the number of frames", self.frames as f64, 1.0, 100.0)?;
        within("the warp (pixels)", self.warp_px, 0.0, 5.0)?;
        within("the scale error", self.scale_error, -0.2, 0.2)?;
        within("the hidden share of the board", self.hide_board, 0.0, 1.0)?;
        within("the number of elevations", self.elevations_deg.len() as f64, 1.0, 720.0)?;
        within("the number of distances", self.distances_m.len() as f64, 1.0, 720.0)?;
        self.elevations_deg.iter().try_for_each(|&e| within("an elevation (degrees)", e, 5.0, 85.0))?;
        self.distances_m.iter().try_for_each(|&d| within("a distance (metres)", d, 0.45, 3.0))?;
        match self.knock {
            Some(view) => within("the knocked view", view as f64, 0.0, self.views as f64 - 1.0),
            None => Ok(()),
        }
    }

    /// Seed of what differs between recordings of the same product in different poses.
    pub(super) fn rest_seed(&self, parts: &[u64]) -> u64 {
        let all: Vec<u64> =
            std::iter::once(self.seed).chain(parts.iter().copied()).chain(self.rest.salt()).collect();
        mix_seed(&all)
    }

    /// Where the colour camera stands in every view: a walk around the point `middle`, held by hand.
    pub fn stations(&self, middle: &Point3<f64>) -> Vec<Pose> {
        (0..self.views).map(|view| self.station(view, middle)).collect()
    }

    fn station(&self, view: usize, middle: &Point3<f64>) -> Pose {
        let mut rng = fastrand::Rng::with_seed(self.rest_seed(&[0x57a7, view as u64]));
        let mut shaken = |by: f64| by * (2.0 * rng.f64() - 1.0);
        // A stream goes steadily; single views are taken by hand.
        let hand = if self.no_board { 0.3 } else { 1.0 };
        let azimuth = (360.0 * view as f64 / self.views as f64 + shaken(4.0 * hand)).to_radians();
        let elevation =
            (self.elevations_deg[view % self.elevations_deg.len()] + shaken(1.5 * hand)).to_radians();
        let distance = self.distances_m[view % self.distances_m.len()] * (1.0 + shaken(0.02 * hand));
        let target = middle + Vector3::new(shaken(0.012), shaken(0.012), shaken(0.012)) * hand;
        let (sin, cos) = elevation.sin_cos();
        let eye = target + distance * Vector3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin);
        let roll = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), shaken(2.0 * hand).to_radians());
        look_at(&eye, &target) * roll
    }
}
