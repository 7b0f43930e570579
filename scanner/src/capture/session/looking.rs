//! The thread that looks at the newest frame: for the page's live picture, and for views that are taken by themselves.

use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

use reconstruct::board::KnownBoard;
use reconstruct::pose::Pose;

use super::{Inner, Session};
use crate::capture::live::{Live, Look};
use crate::capture::preview::{angle_between, place_of};
use crate::capture::state::Step;

/// How long to wait for a frame before looking whether all is over.
const PATIENCE: Duration = Duration::from_millis(300);
/// A view is a new one where no other was taken from within this angle around the product, radians.
const NEW_AZIMUTH: f64 = 0.21;
/// Or from within this angle above it.
const NEW_ELEVATION: f64 = 0.35;

/// What the frames are looked at with; changes with sensor and board.
struct Eye {
    camera: u64,
    board: Option<KnownBoard>,
    live: Live,
}

/// Starts the thread; it ends when the session does.
pub(super) fn start(session: &Arc<Session>) {
    let (weak, frames) = (Arc::downgrade(session), Arc::clone(&session.frames));
    let run = move || {
        let mut eye = None;
        loop {
            let frame = frames.newest(PATIENCE);
            let Some(session) = weak.upgrade() else { return };
            if session.lock().closed {
                return;
            }
            if let Some(frame) = frame {
                session.look_at(&frame, &mut eye, &weak);
            }
        }
    };
    // Without threads nothing works: the sensor's thread will say so in words.
    let _ = std::thread::Builder::new().name("live".to_owned()).spawn(run);
}

impl Session {
    fn look_at(&self, frame: &kinect::source::Frame, eye: &mut Option<Eye>, weak: &Weak<Self>) {
        let watched = self.pictures.receiver_count() > 0;
        {
            let mut inner = self.lock();
            if !inner.is_looked_at(watched) {
                inner.lamp.see(None, Instant::now());
                inner.show_by_lamp();
                return;
            }
        }
        let Some(eye) = self.lock().eye(eye.take()).map(|fresh| eye.insert(fresh)) else { return };
        if !eye.live.fits(frame) {
            // A frame of a sensor that was just replaced.
            return;
        }
        let look = eye.live.look(frame, Instant::now());
        {
            let mut inner = self.lock();
            inner.lamp.see(Some(look.light), Instant::now());
            inner.show_by_lamp();
        }
        self.trigger(&look, weak);
        if watched && let Some(picture) = eye.live.picture(frame, look) {
            self.pictures.send_replace(Some(Arc::new(picture)));
        }
    }

    /// Takes a view by itself where it is time for it.
    fn trigger(&self, look: &Look, weak: &Weak<Self>) {
        let due = {
            let mut inner = self.lock();
            if !inner.trigger.is_on() || inner.step != Step::Views || inner.taking.is_some() {
                return;
            }
            let is_new = inner.is_new(look.world_from_camera.as_ref());
            let before = inner.trigger.state();
            let due = inner.trigger.look(look.light, look.header.still_seconds, is_new, Instant::now());
            if inner.trigger.state() != before {
                self.changes.send_modify(|count| *count += 1);
            }
            due
        };
        let Some(session) = weak.upgrade().filter(|_| due) else { return };
        // What it has to say, the state says.
        let take = move || drop(session.take_view());
        let _ = std::thread::Builder::new().name("view".to_owned()).spawn(take);
    }
}

impl Inner {
    /// Whether frames are looked at: only where somebody sees the picture or views are taken by themselves.
    fn is_looked_at(&self, watched: bool) -> bool {
        matches!(self.step, Step::Sensor | Step::Board | Step::Views) && (watched || self.trigger.is_on())
    }

    /// The eye for the present sensor and board: the present one where it fits.
    fn eye(&self, present: Option<Eye>) -> Option<Eye> {
        let camera = self.camera.as_ref()?;
        let board = self.board.as_ref().map(|board| &board.known);
        if let Some(eye) = present
            && eye.camera == self.camera_number
            && eye.board.as_ref() == board
        {
            return Some(eye);
        }
        let live = Live::new(&camera.info().rig, self.depth_prior.as_ref(), board);
        Some(Eye { camera: self.camera_number, board: board.cloned(), live })
    }

    /// Whether no view was taken from about there.
    fn is_new(&self, world_from_camera: Option<&Pose>) -> bool {
        let Some(pose) = world_from_camera else { return false };
        let [azimuth, elevation, _] = place_of(pose);
        let near = |view: &super::View| {
            angle_between(view.taken.azimuth, azimuth) < NEW_AZIMUTH
                && (view.taken.elevation - elevation).abs() < NEW_ELEVATION
        };
        !self.views.iter().any(near)
    }
}
