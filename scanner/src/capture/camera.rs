//! The sensor's own thread: pulls frames, carries out orders, and finds the sensor again by itself when it went away.
//!
//! The newest frame goes to whoever looks on; while a view is taken, every frame goes to its taker as well.

use std::sync::mpsc::{self, Receiver, Sender, SyncSender, TrySendError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use kinect::source::{Ability, Control, Event, Frame, Led, SensorInfo, Source, SourceError};
use reconstruct::image::ColorImage;

/// How long to wait for an event before looking at orders.
const PATIENCE: Duration = Duration::from_millis(50);
/// Between attempts to start a sensor again.
const PAUSE: Duration = Duration::from_millis(700);
/// A sensor that sends nothing for this long is in trouble.
const SILENCE: Duration = Duration::from_secs(3);
/// An order that takes longer is given up waiting for.
const ORDER_TIME: Duration = Duration::from_secs(20);

/// The newest frame, and whoever takes all of them.
#[derive(Debug, Default)]
pub struct Frames {
    slot: Mutex<Slot>,
    arrived: Condvar,
}

#[derive(Debug, Default)]
struct Slot {
    newest: Option<Arc<Frame>>,
    taker: Option<SyncSender<Arc<Frame>>>,
    /// Frames that the taker was too slow for.
    dropped: u32,
    stopped: bool,
}

impl Frames {
    fn lock(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The newest frame that was not looked at yet; none after `patience`, or once all is over.
    pub fn newest(&self, patience: Duration) -> Option<Arc<Frame>> {
        let waiting = |slot: &mut Slot| slot.newest.is_none() && !slot.stopped;
        let waited = self.arrived.wait_timeout_while(self.lock(), patience, waiting);
        let (mut slot, _) = waited.unwrap_or_else(PoisonError::into_inner);
        slot.newest.take()
    }

    /// From now on every frame, up to `room` of them unfetched.
    pub fn take_all(&self, room: usize) -> Receiver<Arc<Frame>> {
        let (taker, frames) = mpsc::sync_channel(room);
        let mut slot = self.lock();
        slot.dropped = 0;
        slot.taker = (!slot.stopped).then_some(taker);
        frames
    }

    /// No longer; says how many frames got lost because they were fetched too slowly.
    pub fn enough(&self) -> u32 {
        let mut slot = self.lock();
        slot.taker = None;
        slot.dropped
    }

    /// Whether nobody has to wait any more.
    pub fn is_stopped(&self) -> bool {
        self.lock().stopped
    }

    /// Nobody has to wait for frames any more.
    pub fn stop(&self) {
        let mut slot = self.lock();
        (slot.stopped, slot.taker) = (true, None);
        drop(slot);
        self.arrived.notify_all();
    }

    fn put(&self, frame: Arc<Frame>) {
        let mut slot = self.lock();
        let sent = slot.taker.as_ref().map(|taker| taker.try_send(Arc::clone(&frame)));
        match sent {
            Some(Err(TrySendError::Full(_))) => slot.dropped += 1,
            Some(Err(TrySendError::Disconnected(_))) => slot.taker = None,
            _ => {}
        }
        slot.newest = Some(frame);
        drop(slot);
        self.arrived.notify_all();
    }
}

/// How the sensor is.
#[derive(Debug, Clone, PartialEq)]
pub struct Health {
    pub running: bool,
    /// What is wrong, in a sentence.
    pub trouble: Option<String>,
    /// Where it stands, where it stands where it is told to.
    pub station: Option<f64>,
}

enum Order {
    Control(Control, Sender<Result<(), SourceError>>),
    /// Nobody waits for it.
    Lamp(Led),
    /// A sharper picture, to be sent there; where there will be none, the sender goes.
    Still(Sender<Arc<ColorImage>>),
    Stop,
}

/// A sensor at work. Dropped, it stops.
#[derive(Debug)]
pub struct Camera {
    info: SensorInfo,
    station: Option<f64>,
    orders: Sender<Order>,
    thread: Option<JoinHandle<()>>,
}

impl Camera {
    /// Starts a sensor; `report` is told how it is whenever that changes.
    pub fn start(
        mut source: Box<dyn Source>,
        frames: Arc<Frames>,
        report: impl Fn(Health) + Send + 'static,
    ) -> Result<Self, SourceError> {
        source.start()?;
        let (info, station) = (source.sensor().clone(), source.station());
        let (orders, inbox) = mpsc::channel();
        let lamp = Lamp::default();
        let mut watch =
            Watch { source, frames, report, last: Instant::now(), health: None, lamp, still: None };
        let thread = std::thread::Builder::new()
            .name("sensor".to_owned())
            .spawn(move || watch.run(&inbox))
            .map_err(|e| SourceError::Driver(e.to_string()))?;
        Ok(Self { info, station, orders, thread: Some(thread) })
    }

    /// What it is.
    pub fn info(&self) -> &SensorInfo {
        &self.info
    }

    /// Where it stood when it was started.
    pub fn station(&self) -> Option<f64> {
        self.station
    }

    /// Shows something by the lamp, where there is one that works; nobody has to wait for it.
    pub fn show(&self, led: Led) {
        // A sensor that was closed shows nothing.
        let _ = self.orders.send(Order::Lamp(led));
    }

    /// Where orders go: usable without holding the camera.
    pub fn remote(&self) -> Remote {
        Remote { orders: self.orders.clone() }
    }
}

/// Gives orders to a camera.
#[derive(Debug, Clone)]
pub struct Remote {
    orders: Sender<Order>,
}

impl Remote {
    /// Orders a sharper picture; frames rest until it has come.
    pub fn still(&self) -> Receiver<Arc<ColorImage>> {
        let (picture, coming) = mpsc::channel();
        // Of a sensor that was closed nothing comes.
        let _ = self.orders.send(Order::Still(picture));
        coming
    }

    /// Asks the sensor for something and waits until it is done.
    pub fn control(&self, control: Control) -> Result<(), SourceError> {
        let (answer, done) = mpsc::channel();
        let gone = || SourceError::Driver("it was closed".to_owned());
        self.orders.send(Order::Control(control, answer)).map_err(|_closed| gone())?;
        done.recv_timeout(ORDER_TIME).unwrap_or_else(|_late| Err(gone()))
    }
}

impl Drop for Camera {
    fn drop(&mut self) {
        let _ = self.orders.send(Order::Stop);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Watch<R> {
    source: Box<dyn Source>,
    frames: Arc<Frames>,
    report: R,
    last: Instant,
    health: Option<Health>,
    lamp: Lamp,
    /// Who waits for a sharper picture.
    still: Option<Sender<Arc<ColorImage>>>,
}

/// What the lamp is to show.
#[derive(Debug, Default)]
struct Lamp {
    wanted: Option<Led>,
    shown: Option<Led>,
    /// It failed: it is left alone until the sensor starts again.
    is_broken: bool,
}

impl<R: Fn(Health)> Watch<R> {
    fn run(&mut self, inbox: &Receiver<Order>) {
        self.tell(true, None);
        loop {
            match inbox.try_recv() {
                Ok(Order::Control(control, answer)) => {
                    let done = self.source.control(control);
                    if done.is_ok() && matches!(control, Control::Station(_)) {
                        self.tell(true, None);
                    }
                    let _ = answer.send(done);
                    continue;
                }
                Ok(Order::Lamp(led)) => {
                    self.lamp.wanted = Some(led);
                    self.show();
                    continue;
                }
                Ok(Order::Still(picture)) => {
                    self.still = self.source.control(Control::Still).is_ok().then_some(picture);
                    continue;
                }
                Ok(Order::Stop) | Err(mpsc::TryRecvError::Disconnected) => break,
                Err(mpsc::TryRecvError::Empty) => {}
            }
            if self.happened() {
                continue;
            }
            // Orders are waited for, so that stopping takes no longer than it must.
            match inbox.recv_timeout(PAUSE) {
                Ok(Order::Control(_, answer)) => {
                    let _ = answer.send(Err(SourceError::Refused("it is not running".to_owned())));
                }
                Ok(Order::Lamp(led)) => self.lamp.wanted = Some(led),
                Ok(Order::Stop) | Err(mpsc::RecvTimeoutError::Disconnected) => break,
                Ok(Order::Still(_)) | Err(mpsc::RecvTimeoutError::Timeout) => {}
            }
            self.still = None;
            if self.source.start().is_ok() {
                self.last = Instant::now();
                (self.lamp.shown, self.lamp.is_broken) = (None, false);
                self.show();
            }
        }
        self.source.stop();
    }

    /// Lets the lamp show what is wanted, unless it does.
    fn show(&mut self) {
        let Lamp { wanted: Some(wanted), shown, is_broken: false } = self.lamp else { return };
        if shown != Some(wanted) && self.source.sensor().abilities.contains(&Ability::Led) {
            // A lamp that fails stops nobody from taking views.
            self.lamp.is_broken = self.source.control(Control::Led(wanted)).is_err();
            self.lamp.shown = Some(wanted);
        }
    }

    /// Waits for the next event; says whether the sensor still runs.
    fn happened(&mut self) -> bool {
        match self.source.next_event(PATIENCE) {
            Event::Frame(frame) => {
                self.last = Instant::now();
                self.frames.put(frame);
                self.tell(true, None);
                true
            }
            Event::Still(picture) => {
                self.last = Instant::now();
                // Nobody waits for one that comes too late.
                self.still.take().map(|still| still.send(picture));
                true
            }
            Event::Nothing => {
                if self.last.elapsed() > SILENCE {
                    self.tell(false, Some("The sensor sends no pictures; it is started again. Unplug it and plug it in again if that does not help."));
                    return false;
                }
                true
            }
            Event::Unplugged => {
                self.tell(
                    false,
                    Some("The sensor is gone: plug it in again. The views that were taken are kept."),
                );
                false
            }
            Event::Failed(what) => {
                let text = format!(
                    "The sensor's driver stopped ({what}); it is started again. The views that were taken are kept."
                );
                self.tell(false, Some(&text));
                false
            }
            Event::Ended => {
                self.tell(false, Some("The recording that is played is at its end; it begins again."));
                false
            }
        }
    }

    fn tell(&mut self, running: bool, trouble: Option<&str>) {
        let station = self.source.station();
        let is_same =
            |h: &Health| h.running == running && h.trouble.as_deref() == trouble && h.station == station;
        if !self.health.as_ref().is_some_and(is_same) {
            let health = Health { running, trouble: trouble.map(str::to_owned), station };
            (self.report)(health.clone());
            self.health = Some(health);
        }
    }
}
