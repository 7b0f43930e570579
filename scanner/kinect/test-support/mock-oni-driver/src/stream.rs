//! One stream: its state and the thread that sends frames.

use std::ffi::{c_int, c_void};
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::c_types::{FrameCallback, SENSOR_DEPTH, StreamServices, VideoMode};
use crate::driver;
use crate::picture::{self, HEIGHT, UNREGISTERED_MM, WIDTH};

pub(crate) const DEPTH_MODE: VideoMode = VideoMode { format: 100, width: 640, height: 480, fps: 30 };
pub(crate) const COLOR_MODE: VideoMode = VideoMode { format: 200, width: 640, height: 480, fps: 30 };

/// How much later colour is taken than depth.
const COLOR_DELAY_MICROS: u64 = 4000;

/// A stream as the core holds it.
pub struct Stream {
    pub(crate) shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// What the core and the sending thread both touch.
pub(crate) struct Shared {
    sensor: c_int,
    running: AtomicBool,
    pub(crate) is_mirrored: AtomicI32,
    pub(crate) auto_exposure: AtomicI32,
    pub(crate) auto_white_balance: AtomicI32,
    core: Mutex<Core>,
}

/// Pointers of the core, as given.
struct Core {
    stream: usize,
    services: usize,
    callback: Option<FrameCallback>,
    cookie: usize,
}

impl Stream {
    pub(crate) fn new(sensor: c_int) -> *mut Self {
        let core = Mutex::new(Core { stream: 0, services: 0, callback: None, cookie: 0 });
        let shared = Arc::new(Shared {
            sensor,
            running: AtomicBool::new(false),
            is_mirrored: AtomicI32::new(1),
            auto_exposure: AtomicI32::new(1),
            auto_white_balance: AtomicI32::new(1),
            core,
        });
        let stream = Box::into_raw(Box::new(Self { shared: Arc::clone(&shared), thread: None }));
        shared.core.lock().unwrap_or_else(PoisonError::into_inner).stream = stream as usize;
        stream
    }

    pub(crate) fn is_depth(&self) -> bool {
        self.shared.sensor == SENSOR_DEPTH
    }

    pub(crate) fn mode(&self) -> VideoMode {
        if self.is_depth() { DEPTH_MODE } else { COLOR_MODE }
    }

    pub(crate) fn row_bytes(&self) -> c_int {
        WIDTH as c_int * if self.is_depth() { 2 } else { 3 }
    }

    pub(crate) fn set_services(&self, services: *mut StreamServices) {
        self.core().services = services as usize;
    }

    pub(crate) fn set_callback(&self, callback: Option<FrameCallback>, cookie: *mut c_void) {
        let mut core = self.core();
        (core.callback, core.cookie) = (callback, cookie as usize);
    }

    fn core(&self) -> std::sync::MutexGuard<'_, Core> {
        self.shared.core.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn start(&mut self) {
        self.stop();
        self.shared.running.store(true, Ordering::SeqCst);
        let shared = Arc::clone(&self.shared);
        self.thread = Some(std::thread::spawn(move || shared.send_frames()));
    }

    /// The core unloads this library after stopping: no thread may be left.
    pub(crate) fn stop(&mut self) {
        self.shared.running.store(false, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn send_frames(&self) {
        let period: u64 =
            std::env::var("MOCK_KINECT_PERIOD_MICROS").ok().and_then(|v| v.parse().ok()).unwrap_or(33_333);
        let silent = std::env::var_os("MOCK_KINECT_NO_FRAMES").is_some();
        let pictures = std::env::var_os("MOCK_KINECT_PICTURES").and_then(|path| std::fs::read(path).ok());
        let started = Instant::now();
        for index in 0.. {
            let due = started + Duration::from_micros(period * u64::from(index));
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            if !self.running.load(Ordering::SeqCst) || driver::notice_unplugging() {
                return;
            }
            if !silent {
                let micros = period * u64::from(index)
                    + if self.sensor == SENSOR_DEPTH { 0 } else { COLOR_DELAY_MICROS };
                self.send(index, micros, &self.pixels(index, pictures.as_deref()));
            }
        }
    }

    fn send(&self, index: u32, micros: u64, bytes: &[u8]) {
        let (stream, services, callback, cookie) = {
            let core = self.core.lock().unwrap_or_else(PoisonError::into_inner);
            (core.stream, core.services as *const StreamServices, core.callback, core.cookie)
        };
        let Some(callback) = callback else { return };
        // SAFETY: the core sets the services before it starts a stream and keeps them until it has destroyed it.
        let services = unsafe { &*services };
        let frame = (services.acquire)(services.context);
        if frame.is_null() {
            return;
        }
        let is_depth = self.sensor == SENSOR_DEPTH;
        // SAFETY: a frame that was acquired belongs to the driver until it is released, and its data has the size that
        // `oniDriverStreamGetRequiredFrameSize` named, which is the size of `bytes`.
        unsafe {
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), (*frame).data.cast(), bytes.len());
            (*frame).size = bytes.len() as c_int;
            (*frame).sensor = self.sensor;
            (*frame).index = index as c_int + 1;
            (*frame).micros = micros;
            (*frame).width = WIDTH as c_int;
            (*frame).height = HEIGHT as c_int;
            (*frame).mode = if is_depth { DEPTH_MODE } else { COLOR_MODE };
            (*frame).is_cropped = 0;
            (*frame).crop_x = 0;
            (*frame).crop_y = 0;
            (*frame).stride = (bytes.len() / HEIGHT) as c_int;
        }
        callback(stream as *mut c_void, frame, cookie as *mut c_void);
        (services.release)(services.context, frame);
    }

    /// The bytes of a frame in the state the sensor is in.
    fn pixels(&self, index: u32, pictures: Option<&[u8]>) -> Vec<u8> {
        if let Some(bytes) = pictures.and_then(|pictures| self.played(index, pictures)) {
            return bytes;
        }
        let mirrored = self.is_mirrored.load(Ordering::SeqCst) != 0;
        if self.sensor == SENSOR_DEPTH {
            let mut depth = picture::depth(index);
            if !driver::is_registered() {
                depth.iter_mut().for_each(|mm| *mm += UNREGISTERED_MM);
            }
            if mirrored {
                depth.chunks_exact_mut(WIDTH).for_each(<[u16]>::reverse);
            }
            depth.iter().flat_map(|mm| mm.to_le_bytes()).collect()
        } else {
            let is_on = |flag: &AtomicI32| flag.load(Ordering::SeqCst) != 0;
            let mut color =
                picture::color(index, is_on(&self.auto_exposure), is_on(&self.auto_white_balance));
            if mirrored {
                color.chunks_exact_mut(WIDTH).for_each(<[[u8; 3]]>::reverse);
            }
            color.into_flattened()
        }
    }

    fn played(&self, index: u32, pictures: &[u8]) -> Option<Vec<u8>> {
        const DEPTH: usize = WIDTH * HEIGHT * 2;
        const BOTH: usize = WIDTH * HEIGHT * 5;
        let pair = pictures.chunks_exact(BOTH).nth(index as usize % (pictures.len() / BOTH).max(1))?;
        Some(if self.sensor == SENSOR_DEPTH { &pair[..DEPTH] } else { &pair[DEPTH..] }.to_vec())
    }
}
