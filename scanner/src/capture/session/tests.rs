use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use kinect::source::{Ability, Event, Led, SensorInfo, Source, SourceError};
use reconstruct::image::ColorImage;
use reconstruct::recording::{Device, Rig};

use super::*;
use crate::capture::simulated::Simulated;
use crate::unit_calibration::UnitCalibration;

/// What happens to the sensor of a test.
#[derive(Default)]
struct Fate {
    unplugged: AtomicBool,
    fails: AtomicBool,
    moves: AtomicBool,
    /// Frames come slowly, so that there is time to break something between two of them.
    slow: AtomicBool,
    lamp_fails: AtomicBool,
    /// Offers sharper pictures; with what comes of an order.
    stills: Mutex<Option<Stills>>,
    /// What the lamp was told, one after the other.
    lamp: Mutex<Vec<Led>>,
}

/// What becomes of an order for a sharper picture.
#[derive(Clone, Copy, PartialEq)]
enum Stills {
    Come,
    Refused,
    Lost,
}

impl Fate {
    fn lamp(&self) -> Vec<Led> {
        self.lamp.lock().unwrap().clone()
    }
}

struct Fated {
    inner: Simulated,
    info: SensorInfo,
    /// Frames rest until the sharper picture comes.
    still: Option<Instant>,
    fate: Arc<Fate>,
}

impl Source for Fated {
    fn sensor(&self) -> &SensorInfo {
        &self.info
    }

    fn start(&mut self) -> Result<(), SourceError> {
        if self.fate.unplugged.load(Ordering::SeqCst) {
            return Err(SourceError::NotFound("nothing is plugged in".into()));
        }
        self.inner.start()
    }

    fn next_event(&mut self, patience: Duration) -> Event {
        if self.fate.unplugged.load(Ordering::SeqCst) {
            return Event::Unplugged;
        }
        if self.fate.fails.swap(false, Ordering::SeqCst) {
            return Event::Failed("it divided by zero".into());
        }
        if self.fate.moves.swap(false, Ordering::SeqCst) {
            self.inner.control(Control::Station(1.0)).unwrap();
        }
        if self.fate.slow.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(120));
        }
        if let Some(due) = self.still {
            std::thread::sleep(Duration::from_millis(10));
            if Instant::now() < due {
                return Event::Nothing;
            }
            self.still = None;
            if *self.fate.stills.lock().unwrap() == Some(Stills::Come) {
                return Event::Still(Arc::new(ColorImage::filled(1280, 1024, [1, 2, 3])));
            }
        }
        self.inner.next_event(patience)
    }

    fn control(&mut self, control: Control) -> Result<(), SourceError> {
        if control == Control::Still {
            if *self.fate.stills.lock().unwrap() == Some(Stills::Refused) {
                return Err(SourceError::Unable("out of order"));
            }
            self.still = Some(Instant::now() + Duration::from_millis(300));
            return Ok(());
        }
        let Control::Led(led) = control else { return self.inner.control(control) };
        self.fate.lamp.lock().unwrap().push(led);
        if self.fate.lamp_fails.load(Ordering::SeqCst) { Err(SourceError::Unable("dark")) } else { Ok(()) }
    }

    fn stop(&mut self) {
        self.inner.stop();
    }

    fn station(&self) -> Option<f64> {
        self.inner.station()
    }
}

/// A bowl at every address but `mug` and `missing`; perhaps calibrated.
struct OneSensor(Arc<Fate>, Option<UnitCalibration>);

impl Opener for OneSensor {
    fn look(&self) -> Found {
        Found::default()
    }

    fn open(&self, address: &str, board: Option<&KnownBoard>) -> Result<Box<dyn Source>, SourceError> {
        let inner = match address {
            "missing" => return Err(SourceError::NotFound("nothing is plugged in".into())),
            "mug" => Simulated::open("simulated:mug", board)?,
            _ => Simulated::open("simulated:bowl", board)?,
        };
        let mut info = inner.sensor().clone();
        info.abilities.push(Ability::Led);
        if self.0.stills.lock().unwrap().is_some() {
            info.abilities.push(Ability::Stills);
        }
        Ok(Box::new(Fated { inner, info, still: None, fate: Arc::clone(&self.0) }))
    }

    fn calibration(&self, _: &Device, _: &Rig) -> Option<UnitCalibration> {
        self.1.clone()
    }
}

/// A session that is ready for views.
fn ready(home: &Path) -> (Arc<Session>, Arc<Fate>) {
    ready_with(home, None)
}

/// A session at its beginning.
fn unready_with(home: &Path, calibration: Option<UnitCalibration>) -> (Arc<Session>, Arc<Fate>) {
    let fate = Arc::<Fate>::default();
    let session = Session::new(Box::new(OneSensor(Arc::clone(&fate), calibration)), home, None);
    (session, fate)
}

fn ready_with(home: &Path, calibration: Option<UnitCalibration>) -> (Arc<Session>, Arc<Fate>) {
    let (session, fate) = unready_with(home, calibration);
    session.choose_sensor("test").unwrap();
    session.choose_board(&BoardChoice::Paper(Paper::A3)).unwrap();
    (session, fate)
}

/// Waits for a state; the longest that anything here may take is ten seconds.
#[track_caller]
fn wait_for(session: &Session, wanted: impl Fn(&State) -> bool) -> State {
    for _ in 0..1000 {
        let state = session.state();
        if wanted(&state) {
            return state;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    panic!("{:?}", session.state());
}

fn trouble(state: &State) -> Option<&str> {
    state.sensor.as_ref()?.trouble.as_deref()
}

#[test]
fn a_sensor_that_goes_away_comes_back_by_itself() {
    let home = tempfile::tempdir().unwrap();
    let (session, fate) = ready(home.path());
    session.take_view().unwrap();
    fate.unplugged.store(true, Ordering::SeqCst);
    let state = wait_for(&session, |state| trouble(state).is_some());
    assert!(trouble(&state).unwrap().contains("plug it in again") && !state.sensor.unwrap().running);
    let refusal = session.take_view().unwrap_err();
    assert!(matches!(&refusal, Refusal::NotNow(text) if text.contains("does not run")), "{refusal}");
    fate.unplugged.store(false, Ordering::SeqCst);
    let state = wait_for(&session, |state| trouble(state).is_none());
    assert!(state.sensor.unwrap().running && state.views.len() == 1);
    session.take_view().unwrap();

    fate.fails.store(true, Ordering::SeqCst);
    let state = wait_for(&session, |state| trouble(state).is_some());
    assert!(trouble(&state).unwrap().contains("it divided by zero"));
    wait_for(&session, |state| trouble(state).is_none());
    session.close();
    assert!(session.take_view().is_err());
}

/// The frames of an order that is under way.
fn frames(state: &State) -> usize {
    state.taking.as_ref().map_or(0, |taking| taking.frames)
}

#[test]
fn a_view_that_is_cut_short_or_moves_is_not_kept() {
    let home = tempfile::tempdir().unwrap();
    let (session, fate) = ready(home.path());
    fate.slow.store(true, Ordering::SeqCst);
    let broken = |what: &AtomicBool| {
        let taker = Arc::clone(&session);
        let taking = std::thread::spawn(move || taker.take_view());
        wait_for(&session, |state| frames(state) >= 3);
        assert!(matches!(session.go_to(Step::Sensor), Err(Refusal::NotNow(_))), "not while a view is taken");
        what.store(true, Ordering::SeqCst);
        taking.join().unwrap().unwrap_err().to_string()
    };
    let moved = broken(&fate.moves);
    assert!(moved.contains("not kept") && moved.contains("moved"), "{moved}");
    let cut = broken(&fate.unplugged);
    assert!(cut.contains("no pictures"), "{cut}");
    let state = session.state();
    assert_eq!((state.views.len(), &state.taking, state.error), (0, &None, Some(cut)));
    let views = state.folder.unwrap().join("views");
    assert_eq!(std::fs::read_dir(&views).unwrap().count(), 0);
    fate.unplugged.store(false, Ordering::SeqCst);
    wait_for(&session, |state| trouble(state).is_none());
    session.take_view().unwrap();
    assert_eq!((session.state().views.len(), session.state().error), (1, None));
}

#[test]
fn steps_need_what_comes_before_them() {
    let home = tempfile::tempdir().unwrap();
    let session = Session::new(Box::new(OneSensor(Arc::default(), None)), home.path(), None);
    for step in [Step::Board, Step::Views, Step::Result, Step::Building, Step::Published] {
        assert!(matches!(session.go_to(step), Err(Refusal::NotNow(_))), "{step:?}");
    }
    assert!(session.choose_board(&BoardChoice::Paper(Paper::A3)).is_err(), "first the sensor");
    let (session, _) = ready(home.path());
    for step in [Step::Sensor, Step::Board, Step::Views] {
        session.go_to(step).unwrap();
        assert_eq!(session.state().step, step);
    }
    let loose = br#"{"version": 1, "family": "aruco_original", "tag_size_m": 0.1, "layout": "unknown", "ids": [1, 2]}"#;
    let refusal = session.choose_board(&BoardChoice::File(loose.to_vec())).unwrap_err();
    assert!(refusal.to_string().contains("printed board"), "{refusal}");
}

#[test]
fn a_sensor_that_cannot_be_used_leaves_the_present_one_at_work() {
    let home = tempfile::tempdir().unwrap();
    let (session, _) = ready(home.path());
    session.take_view().unwrap();
    for (address, words) in [("mug", "taken with another sensor"), ("missing", "nothing is plugged in")] {
        let refusal = session.choose_sensor(address).unwrap_err();
        assert!(refusal.to_string().contains(words), "{refusal}");
        let state = session.state();
        let sensor = state.sensor.unwrap();
        assert_eq!(
            (sensor.address.as_str(), sensor.running, state.step),
            ("simulated:bowl", true, Step::Views)
        );
        session.take_view().unwrap();
    }
    session.choose_sensor("simulated:bowl").unwrap();
    session.take_view().unwrap();
    session.begin_another().unwrap();
    session.choose_sensor("mug").unwrap();
    assert_eq!(session.state().sensor.unwrap().serial, "mug:1");
}

#[test]
fn where_the_simulated_sensor_stands_is_known_from_the_start() {
    let home = tempfile::tempdir().unwrap();
    let (session, _) = ready(home.path());
    let station = |state: &State| state.sensor.as_ref().and_then(|sensor| sensor.station);
    session.take_view().unwrap();
    let state = session.state();
    let off = crate::capture::preview::angle_between(station(&state).unwrap(), state.views[0].azimuth);
    assert!(off < 0.01, "{state:?}");
    session.control(Control::Station(2.0)).unwrap();
    assert!((station(&session.state()).unwrap() - 2.0).abs() < 0.1);
}

/// Reads everything a percent too near and bent, and was calibrated well.
fn calibration() -> UnitCalibration {
    let mut coefficients = [0.0; reconstruct::calibrate::TERMS];
    (coefficients[0], coefficients[4], coefficients[5]) = (-0.01, 1.0, 1.0);
    UnitCalibration {
        version: 1,
        device: Device { backend: "simulated".into(), serial: "bowl:1".into() },
        width: 640,
        height: 480,
        fx: 525.0,
        coefficients,
        standard_deviations: [1e-6; reconstruct::calibrate::TERMS],
        samples: 100_000,
        residual_px: 0.1,
        error_mm: [15.0, 0.1],
        distances_m: [0.5, 1.1],
    }
}

#[test]
fn live_view_and_preview_are_as_the_unit_was_calibrated() {
    // The board's own pixels pull the view back to where it is, but not all of the way where they do not lie.
    let seen = |calibration: Option<UnitCalibration>| {
        let home = tempfile::tempdir().unwrap();
        let (session, _) = ready_with(home.path(), calibration.clone());
        assert_eq!(session.state().sensor.unwrap().calibrated, calibration.is_some());
        let mut pictures = session.pictures();
        let started = Instant::now();
        let distance = loop {
            assert!(started.elapsed() < Duration::from_secs(20));
            std::thread::sleep(Duration::from_millis(20));
            let Some(picture) = pictures.borrow_and_update().clone() else { continue };
            let length = u32::from_le_bytes(picture[..4].try_into().unwrap()) as usize;
            let header: serde_json::Value = serde_json::from_slice(&picture[4..4 + length]).unwrap();
            if let Some(distance) = header["distance_metres"].as_f64() {
                break distance;
            }
        };
        session.take_view().unwrap();
        let bounds = |session: &Session| session.lock().views[0].cloud.bounds().unwrap();
        let taken = bounds(&session);
        let folder = session.state().folder.unwrap();
        session.close();
        drop(session);
        let (session, _) = unready_with(home.path(), calibration);
        session.resume(&folder, &crate::ui::Ui::silent()).unwrap();
        (distance, taken, bounds(&session))
    };
    let (plain, calibrated) = (seen(None), seen(Some(calibration())));
    let off = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
    assert!((1.003..1.02).contains(&(calibrated.0 / plain.0)), "{plain:?} {calibrated:?}");
    for (plain, calibrated) in [(plain.1, calibrated.1), (plain.2, calibrated.2)] {
        assert!(off(plain.0, calibrated.0).max(off(plain.1, calibrated.1)) > 0.0005);
    }
}

#[test]
fn the_lamp_shows_how_things_are() {
    let home = tempfile::tempdir().unwrap();
    let (session, fate) = ready(home.path());
    let lamp = |wanted: &[Led]| {
        let started = Instant::now();
        while fate.lamp() != wanted {
            assert!(started.elapsed() < Duration::from_secs(20), "{:?} instead of {wanted:?}", fate.lamp());
            std::thread::sleep(Duration::from_millis(10));
        }
    };
    // Nobody looks at the pictures.
    lamp(&[Led::Off]);
    let pictures = session.pictures();
    wait_for_lamp(&fate, Led::Green);
    fate.lamp.lock().unwrap().clear();
    session.take_view().unwrap();
    lamp(&[Led::BlinkGreen, Led::Green]);
    // A board of which nothing is seen.
    session.undo_view("000").unwrap();
    session.begin_another().unwrap();
    fate.lamp.lock().unwrap().clear();
    let other = serde_json::to_vec(&BoardFile::Known(ring(Paper::A3, Family::Tag36h11))).unwrap();
    session.change(|inner| inner.board = Some(board_of(&BoardChoice::File(other)).unwrap()));
    lamp(&[Led::Red]);
    drop(pictures);
    lamp(&[Led::Red, Led::Off]);
}

fn wait_for_lamp(fate: &Fate, wanted: Led) {
    let started = Instant::now();
    while fate.lamp().last() != Some(&wanted) {
        assert!(started.elapsed() < Duration::from_secs(20), "{:?}", fate.lamp());
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_lamp_that_fails_is_left_alone() {
    let home = tempfile::tempdir().unwrap();
    let (session, fate) = ready(home.path());
    wait_for_lamp(&fate, Led::Off);
    fate.lamp_fails.store(true, Ordering::SeqCst);
    session.take_view().unwrap();
    session.take_view().unwrap();
    assert_eq!((fate.lamp(), session.state().error), (vec![Led::Off, Led::BlinkGreen], None));
    // Started again, it is tried again.
    fate.lamp_fails.store(false, Ordering::SeqCst);
    fate.fails.store(true, Ordering::SeqCst);
    wait_for(&session, |state| trouble(state).is_some());
    wait_for(&session, |state| trouble(state).is_none());
    assert_eq!(fate.lamp(), [Led::Off, Led::BlinkGreen, Led::Off]);
}

/// Bytes of all files of the model, and whether a new one is being written.
fn model_files(folder: &Path) -> (Vec<(String, Vec<u8>)>, bool) {
    let Ok(entries) = std::fs::read_dir(folder) else { return (Vec::new(), false) };
    let (mut files, mut is_written) = (Vec::new(), false);
    for entry in entries.map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if name.ends_with(".unfinished") {
            is_written = true;
        } else {
            files.push((name, std::fs::read(entry.path()).unwrap()));
        }
    }
    files.sort();
    (files, is_written)
}

#[test]
fn a_build_cancelled_while_it_is_written_replaces_nothing() {
    let home = tempfile::tempdir().unwrap();
    let (session, _) = ready(home.path());
    for azimuth in [0.0, 1.0, 2.0] {
        session.control(Control::Station(azimuth)).unwrap();
        session.take_view().unwrap();
    }
    session.build().unwrap();
    let built = wait_long(&session, |state| state.build.is_none());
    assert_eq!((built.step, &built.error), (Step::Result, &None));
    let folder = built.folder.unwrap().join("model");
    let (before, _) = model_files(&folder);
    session.go_to(Step::Views).unwrap();
    session.undo_view("002").unwrap();
    let deadline = Instant::now() + Duration::from_mins(1);
    session.build().unwrap();
    while !model_files(&folder).1 {
        assert!(Instant::now() < deadline && session.state().build.is_some());
        std::thread::sleep(Duration::from_millis(2));
    }
    session.cancel_build().unwrap();
    while model_files(&folder).1 {
        assert!(Instant::now() < deadline);
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(before.len(), 5);
    assert!(model_files(&folder).0 == before, "the model was replaced");
    assert_eq!(session.state().step, Step::Views);
    session.build().unwrap();
    wait_long(&session, |state| state.build.is_none());
    assert!(model_files(&folder).0 != before);
}

#[track_caller]
fn wait_long(session: &Session, wanted: impl Fn(&State) -> bool) -> State {
    let deadline = Instant::now() + Duration::from_mins(2);
    loop {
        let state = session.state();
        if wanted(&state) {
            return state;
        }
        assert!(Instant::now() < deadline, "{state:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_sharper_picture_of_every_view_and_none_that_costs_a_view() {
    for stills in [Stills::Come, Stills::Refused, Stills::Lost] {
        let home = tempfile::tempdir().unwrap();
        let (session, fate) = unready_with(home.path(), None);
        *fate.stills.lock().unwrap() = Some(stills);
        session.choose_sensor("test").unwrap();
        session.choose_board(&BoardChoice::Paper(Paper::A3)).unwrap();
        for _ in 0..3 {
            session.take_view().unwrap();
            // No second order is refused because of the first.
            assert_eq!((session.state().taking, session.state().error), (None, None));
        }
        session.undo_view("001").unwrap();
        let folder = session.state().folder.unwrap();
        session.close();
        drop(session);
        let recording = crate::recording::Recording::open(&folder).unwrap();
        assert_eq!(recording.view_names(), ["000", "002"]);
        let named: Vec<_> = recording.file().views.iter().filter_map(|view| view.still.clone()).collect();
        let lie = std::fs::read_dir(folder.join("stills")).map_or(0, Iterator::count);
        if stills == Stills::Come {
            assert_eq!(
                (named.as_slice(), lie),
                (&["stills/000.png".to_owned(), "stills/002.png".to_owned()][..], 2)
            );
            let bytes = std::fs::read(folder.join(&named[1])).unwrap();
            assert!(crate::pictures::decode_color(&bytes, 1280, 1024).unwrap().data[7] == [1, 2, 3]);
            Journal::resume(&folder).unwrap();
            assert_eq!(std::fs::read_dir(folder.join("stills")).unwrap().count(), 2);
        } else {
            assert!(named.is_empty() && lie == 0);
        }
    }
}
