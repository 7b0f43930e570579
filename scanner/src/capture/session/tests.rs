use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use kinect::source::{Event, Source, SourceError};

use super::*;
use crate::capture::simulated::Simulated;

/// What happens to the sensor of a test.
#[derive(Default)]
struct Fate {
    unplugged: AtomicBool,
    fails: AtomicBool,
    moves: AtomicBool,
}

struct Fated {
    inner: Simulated,
    fate: Arc<Fate>,
}

impl Source for Fated {
    fn sensor(&self) -> &SensorInfo {
        self.inner.sensor()
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
        self.inner.next_event(patience)
    }

    fn control(&mut self, control: Control) -> Result<(), SourceError> {
        self.inner.control(control)
    }

    fn stop(&mut self) {
        self.inner.stop();
    }
}

struct OneSensor(Arc<Fate>);

impl Opener for OneSensor {
    fn look(&self) -> Found {
        Found::default()
    }

    fn open(&self, _: &str, board: Option<&KnownBoard>) -> Result<Box<dyn Source>, SourceError> {
        let inner = Simulated::open("simulated:bowl", board)?;
        Ok(Box::new(Fated { inner, fate: Arc::clone(&self.0) }))
    }
}

/// A session that is ready for views.
fn ready(home: &Path) -> (Arc<Session>, Arc<Fate>) {
    let fate = Arc::<Fate>::default();
    let session = Session::new(Box::new(OneSensor(Arc::clone(&fate))), home, None);
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
    let session = Session::new(Box::new(OneSensor(Arc::default())), home.path(), None);
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
