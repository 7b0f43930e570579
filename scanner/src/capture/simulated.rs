//! The simulated Kinect as a live sensor: 30 pictures a second of a product on its board, from a place that it is told.
//!
//! A station is drawn once (about 0.3 s of CPU) with a handful of noisy depth frames, which are then delivered in turn.
//! Everything follows from the seed. Addresses: `simulated`, `simulated:shoe`, `simulated:shoe:7` (product, seed).

use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use kinect::source::{Ability, Control, Event, Frame, SensorInfo, Source, SourceError};
use reconstruct::board::{Family, KnownBoard};
use reconstruct::image::{ColorImage, DepthImage};

use crate::simulate::{Kind, Paper, ScanSpec, Simulator, ring};

/// Places around the product where the sensor can stand.
const STATIONS: usize = 72;
/// Depth frames drawn of a station.
const FRAMES: usize = 6;
const FRAME_TIME: Duration = Duration::from_nanos(33_333_333);
/// What stands on the board unless the address says otherwise.
const PRODUCT: Kind = Kind::Camera;

/// A sensor that stands where it is told to.
pub struct Simulated {
    info: SensorInfo,
    simulator: Simulator,
    station: usize,
    color: Arc<ColorImage>,
    depths: Vec<Arc<DepthImage>>,
    running: Option<Running>,
}

/// Streaming since when.
struct Running {
    next: Instant,
    index: u64,
    /// Frame times that have passed since the start, delivered or not.
    ticks: u64,
}

/// What an address asks for.
struct Wish {
    product: Kind,
    seed: u64,
}

impl Simulated {
    /// Opens the sensor of an address; it sees `board`, or the usual one of A3 paper.
    pub fn open(address: &str, board: Option<&KnownBoard>) -> Result<Self, SourceError> {
        let wish = parse(address).ok_or_else(|| SourceError::NotFound(address.to_owned()))?;
        let mut spec = ScanSpec::new(wish.product, wish.seed);
        (spec.views, spec.frames) = (STATIONS, FRAMES);
        spec.board = board.cloned().unwrap_or_else(usual_board);
        let simulator = Simulator::new(&spec).map_err(|e| SourceError::Refused(e.to_string()))?;
        let info = SensorInfo {
            backend: "simulated".to_owned(),
            address: address.to_owned(),
            model: format!("Simulated Kinect before a {}", wish.product),
            serial: format!("{}:{}", wish.product, wish.seed),
            rig: simulator.rig(),
            units_per_metre: 1000.0,
            abilities: vec![Ability::Station],
        };
        let mut sensor =
            Self { info, simulator, station: 0, color: Arc::default(), depths: Vec::new(), running: None };
        sensor.stand_at(0);
        Ok(sensor)
    }

    fn stand_at(&mut self, station: usize) {
        let images = self.simulator.view(station);
        self.station = station;
        self.color = Arc::new(images.color);
        self.depths = images.depths.into_iter().map(Arc::new).collect();
    }

    /// The station whose camera stands nearest to an azimuth.
    fn nearest(&self, azimuth: f64) -> usize {
        let off = |station: &usize| {
            let place = self.simulator.stations()[*station].translation.vector;
            ((place.y.atan2(place.x) - azimuth + PI).rem_euclid(TAU) - PI).abs()
        };
        (0..STATIONS).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)
    }
}

/// The board it sees where none was chosen.
pub fn usual_board() -> KnownBoard {
    ring(Paper::A3, Family::Aruco4x4_50)
}

/// Whether an address is one of the simulated sensor's.
pub fn is_simulated(address: &str) -> bool {
    parse(address).is_some()
}

fn parse(address: &str) -> Option<Wish> {
    let mut parts = address.split(':');
    if parts.next() != Some("simulated") {
        return None;
    }
    let product = match parts.next() {
        None => PRODUCT,
        Some(name) => Kind::from_str(name, false).ok()?,
    };
    let seed = parts.next().map_or(Some(1), |seed| seed.parse().ok())?;
    parts.next().is_none().then_some(Wish { product, seed })
}

impl Source for Simulated {
    fn sensor(&self) -> &SensorInfo {
        &self.info
    }

    fn start(&mut self) -> Result<(), SourceError> {
        self.running = Some(Running { next: Instant::now(), index: 0, ticks: 0 });
        Ok(())
    }

    fn next_event(&mut self, patience: Duration) -> Event {
        let Some(running) = self.running.as_mut() else {
            std::thread::sleep(patience);
            return Event::Nothing;
        };
        let wait = running.next.saturating_duration_since(Instant::now());
        if wait > patience {
            std::thread::sleep(patience);
            return Event::Nothing;
        }
        std::thread::sleep(wait);
        let late = running.next.elapsed().as_nanos() / FRAME_TIME.as_nanos();
        let skipped = u32::try_from(late).unwrap_or(u32::MAX);
        running.ticks += u64::from(skipped);
        running.next += FRAME_TIME * skipped.saturating_add(1);
        let (index, tick) = (running.index, running.ticks);
        running.index += 1;
        running.ticks += 1;
        let timestamp = tick * FRAME_TIME.as_nanos() as u64;
        Event::Frame(Arc::new(Frame {
            index,
            color: Arc::clone(&self.color),
            depth: Arc::clone(&self.depths[index as usize % self.depths.len()]),
            color_timestamp_nanos: timestamp,
            depth_timestamp_nanos: timestamp,
            lost_packets: 0,
            skipped,
            gravity: None,
        }))
    }

    fn control(&mut self, control: Control) -> Result<(), SourceError> {
        let Control::Station(azimuth) = control else {
            return Err(SourceError::Unable("it only moves to another station"));
        };
        if !azimuth.is_finite() {
            return Err(SourceError::Unable("an azimuth is a number of radians"));
        }
        let station = self.nearest(azimuth);
        if station != self.station {
            self.stand_at(station);
            // What would have come meanwhile was not missed: nobody looked from there.
            if let Some(running) = self.running.as_mut() {
                running.next = Instant::now();
            }
        }
        Ok(())
    }

    fn stop(&mut self) {
        self.running = None;
    }

    fn station(&self) -> Option<f64> {
        let place = self.simulator.stations()[self.station].translation.vector;
        Some(place.y.atan2(place.x).rem_euclid(TAU))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(sensor: &mut Simulated) -> Arc<Frame> {
        match sensor.next_event(Duration::from_secs(1)) {
            Event::Frame(frame) => frame,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn frames_follow_from_the_seed_and_the_station() {
        let mut a = Simulated::open("simulated:bowl:4", None).unwrap();
        let mut b = Simulated::open("simulated:bowl:4", None).unwrap();
        a.start().unwrap();
        b.start().unwrap();
        let (first, same) = (frame(&mut a), frame(&mut b));
        assert_eq!((&first.color, &first.depth), (&same.color, &same.depth));
        assert_ne!(frame(&mut a).depth, first.depth, "noise differs from frame to frame");
        a.control(Control::Station(PI)).unwrap();
        let place = a.simulator.stations()[a.station].translation.vector;
        assert!(place.x < 0.0 && place.y.abs() < 0.1, "{place}");
        assert!((a.station().unwrap() - PI).abs() < 0.1);
        assert_ne!(frame(&mut a).color, first.color);
        assert!(a.control(Control::Tilt(0.1)).is_err() && a.control(Control::Station(f64::NAN)).is_err());
        a.stop();
        assert!(matches!(a.next_event(Duration::ZERO), Event::Nothing));
    }

    #[test]
    fn addresses() {
        for good in ["simulated", "simulated:mug", "simulated:shoe:12"] {
            assert!(is_simulated(good), "{good}");
        }
        for bad in ["simulate", "simulated:car", "simulated:mug:x", "simulated:mug:1:2", "freenect:0", ""] {
            assert!(!is_simulated(bad), "{bad}");
        }
    }
}
