//! libfreenect's handles, safe to use: what is open is closed, what streams is stopped, in the order the library needs.
//!
//! Neither handle leaves its thread: the library's callbacks belong to it (see [`super::inbox`]).

use std::ffi::{CStr, CString, c_int};
use std::ptr::{self, NonNull};
use std::rc::Rc;
use std::time::Duration;

use super::depth::{Constants, Polynomial};
use super::inbox::{self, Stream};
use super::mode::Format;
use crate::source::Led;
use crate::sys::freenect::Library;
use crate::sys::freenect::bindings as c;

/// Serial numbers that are looked at.
const MOST_SENSORS: usize = 16;

/// The library cannot do something or refused it; what that was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("libfreenect does not give {0}")]
pub struct Unavailable(pub &'static str);

/// Calls a function of the library where it has it.
macro_rules! call {
    ($library:expr, $function:ident ( $($argument:expr),* )) => {
        match &$library.functions.$function {
            // SAFETY: the type is the header's. Handles are live: they belong to `self`, which closes them last;
            // pointers to results outlive the call.
            Ok(function) => Ok(unsafe { function($($argument),*) }),
            Err(_absent) => Err(Unavailable(stringify!($function))),
        }
    };
}

/// The library, ready to look for sensors.
pub struct Context {
    library: Library,
    handle: NonNull<c::freenect_context>,
}

/// What is to be opened of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parts {
    /// The cameras alone.
    Cameras,
    /// Cameras, motor, lamp and accelerometer.
    CamerasAndMotor,
}

impl Context {
    /// Starts the library.
    ///
    /// # Errors
    /// Where it refuses, which it does without USB.
    pub(crate) fn new(library: Library) -> Result<Rc<Self>, Unavailable> {
        let mut handle = ptr::null_mut();
        let started = call!(library, freenect_init(&raw mut handle, ptr::null_mut()))?;
        let handle = NonNull::new(handle).filter(|_| started >= 0).ok_or(Unavailable("a start"))?;
        let context = Self { library, handle };
        // Without them it works, only silently.
        let _ = call!(
            context.library,
            freenect_set_log_level(context.raw(), c::freenect_loglevel::FREENECT_LOG_DEBUG)
        );
        let _ = call!(context.library, freenect_set_log_callback(context.raw(), Some(inbox::on_log)));
        Ok(Rc::new(context))
    }

    /// Whether a dump is played instead of a sensor.
    pub fn is_replay(&self) -> bool {
        self.library.is_replay
    }

    /// Sensors there are.
    pub fn count(&self) -> usize {
        let count = call!(self.library, freenect_num_devices(self.raw())).unwrap_or(0);
        usize::try_from(count).unwrap_or(0).min(MOST_SENSORS)
    }

    /// Serial numbers of the sensors that have one and may be opened.
    pub fn serials(&self) -> Vec<String> {
        let mut list: *mut c::freenect_device_attributes = ptr::null_mut();
        let count =
            call!(self.library, freenect_list_device_attributes(self.raw(), &raw mut list)).unwrap_or(0);
        let mut serials = Vec::new();
        let mut next = list;
        while count > 0 && !next.is_null() && serials.len() < MOST_SENSORS {
            // SAFETY: the library made the list, and frees it only below.
            let item = unsafe { *next };
            if !item.camera_serial.is_null() {
                // SAFETY: a string that ends, as above.
                let serial = unsafe { CStr::from_ptr(item.camera_serial) };
                serials.push(serial.to_string_lossy().trim().to_owned());
            }
            next = item.next;
        }
        if !list.is_null() {
            // Where it cannot be freed it is lost, once.
            let _ = call!(self.library, freenect_free_device_attributes(list));
        }
        serials
    }

    /// Opens a sensor by its serial number, or by its number from 0 on; `None` where the library refuses.
    ///
    /// # Errors
    /// Where the library cannot do that at all.
    pub fn open(self: &Rc<Self>, which: &Which, parts: Parts) -> Result<Option<Sensor>, Unavailable> {
        let mut wanted = c::freenect_device_flags::FREENECT_DEVICE_CAMERA;
        if parts == Parts::CamerasAndMotor {
            wanted.0 |= c::freenect_device_flags::FREENECT_DEVICE_MOTOR.0;
        }
        // Opening changes what is selected: it is set each time.
        call!(self.library, freenect_select_subdevices(self.raw(), wanted))?;
        let mut handle = ptr::null_mut();
        let opened = match which {
            Which::Number(number) => {
                let number = c_int::try_from(*number).map_err(|_large| Unavailable("so many sensors"))?;
                call!(self.library, freenect_open_device(self.raw(), &raw mut handle, number))?
            }
            Which::Serial(serial) => {
                let serial =
                    CString::new(serial.as_str()).map_err(|_zero| Unavailable("such a serial number"))?;
                call!(
                    self.library,
                    freenect_open_device_by_camera_serial(self.raw(), &raw mut handle, serial.as_ptr())
                )?
            }
        };
        let handle = NonNull::new(handle).filter(|_| opened >= 0);
        Ok(handle.map(|handle| Sensor { context: Rc::clone(self), handle, running: [false; 2] }))
    }

    /// Lets the library work for at most this long (the replay: until its next image). `false` where the sensor is gone or
    /// the dump at its end.
    pub fn process(&self, most: Duration) -> bool {
        let mut most = c::timeval { tv_sec: 0, tv_usec: i64::from(most.subsec_micros()) };
        let went = match call!(self.library, freenect_process_events_timeout(self.raw(), &raw mut most)) {
            Ok(went) => went,
            Err(_) => call!(self.library, freenect_process_events(self.raw())).unwrap_or(-1),
        };
        went >= 0
    }

    fn raw(&self) -> *mut c::freenect_context {
        self.handle.as_ptr()
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        let _ = call!(self.library, freenect_shutdown(self.raw()));
    }
}

/// Which sensor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Which {
    /// The n-th, from 0 on.
    Number(usize),
    /// The one with this serial number.
    Serial(String),
}

/// An open sensor; dropping it stops its streams, which puts the projector out, and closes it.
pub struct Sensor {
    context: Rc<Context>,
    handle: NonNull<c::freenect_device>,
    running: [bool; 2],
}

impl Sensor {
    /// Starts a stream in a format; what comes is in the inbox. Started again it changes the format.
    ///
    /// # Errors
    /// Where the library does not offer the format, or the sensor refuses.
    pub fn start(&mut self, format: Format) -> Result<(), Unavailable> {
        let stream = format.stream();
        self.stop(stream);
        let mode = format.find(&self.context.library)?.ok_or(Unavailable("this image format"))?;
        let library = &self.context.library;
        let device = self.raw();
        let set = match stream {
            Stream::Depth => call!(library, freenect_set_depth_mode(device, mode))?,
            Stream::Video => call!(library, freenect_set_video_mode(device, mode))?,
        };
        if set < 0 {
            return Err(Unavailable("this image format now"));
        }
        inbox::expect(stream, format.bytes());
        let started = match stream {
            Stream::Depth => {
                call!(library, freenect_set_depth_callback(device, Some(inbox::on_depth)))?;
                call!(library, freenect_start_depth(device))?
            }
            Stream::Video => {
                call!(library, freenect_set_video_callback(device, Some(inbox::on_video)))?;
                call!(library, freenect_start_video(device))?
            }
        };
        self.running[stream as usize] = started >= 0;
        if started >= 0 { Ok(()) } else { Err(Unavailable("a stream")) }
    }

    /// Stops a stream; stopping what does not run is no error.
    pub fn stop(&mut self, stream: Stream) {
        if std::mem::take(&mut self.running[stream as usize]) {
            // A sensor that is gone cannot be stopped, and need not be.
            let _ = match stream {
                Stream::Depth => call!(self.context.library, freenect_stop_depth(self.raw())),
                Stream::Video => call!(self.context.library, freenect_stop_video(self.raw())),
            };
        }
        inbox::expect(stream, 0);
    }

    /// Holds exposure and white balance, or lets them go; only while colour streams.
    ///
    /// # Errors
    /// Where the library or the sensor refuses.
    pub fn lock_exposure(&self, lock: bool) -> Result<(), Unavailable> {
        let value =
            if lock { c::freenect_flag_value::FREENECT_OFF } else { c::freenect_flag_value::FREENECT_ON };
        for flag in [c::freenect_flag::FREENECT_AUTO_EXPOSURE, c::freenect_flag::FREENECT_AUTO_WHITE_BALANCE]
        {
            // What it returns is the length of the sensor's reply.
            if call!(self.context.library, freenect_set_flag(self.raw(), flag, value))? < 0 {
                return Err(Unavailable("a hold on exposure"));
            }
        }
        Ok(())
    }

    /// Whether the library knows how to hold exposure.
    pub fn can_lock_exposure(&self) -> bool {
        self.context.library.functions.freenect_set_flag.is_ok()
    }

    /// Whether it offers a format.
    pub fn offers(&self, format: Format) -> bool {
        format.find(&self.context.library).is_ok_and(|mode| mode.is_some())
    }

    /// Tilts the head to this angle above the horizon, degrees.
    ///
    /// # Errors
    /// Where the library or the motor refuses.
    pub fn tilt(&self, degrees: f64) -> Result<(), Unavailable> {
        accepted(call!(self.context.library, freenect_set_tilt_degs(self.raw(), degrees))?, "a tilt")
    }

    /// Shows the lamp.
    ///
    /// # Errors
    /// Where the library or the sensor refuses.
    pub fn led(&self, led: Led) -> Result<(), Unavailable> {
        let state = match led {
            Led::Off => c::freenect_led_options::LED_OFF,
            Led::Green => c::freenect_led_options::LED_GREEN,
            Led::BlinkGreen => c::freenect_led_options::LED_BLINK_GREEN,
            Led::Yellow => c::freenect_led_options::LED_YELLOW,
            Led::Red => c::freenect_led_options::LED_RED,
        };
        accepted(call!(self.context.library, freenect_set_led(self.raw(), state))?, "the lamp")
    }

    /// What the accelerometer says, metres per square second in its own axes: about +9.8 along y where it stands level.
    pub fn accelerometer(&self) -> Option<[f64; 3]> {
        let library = &self.context.library;
        let updated = call!(library, freenect_update_tilt_state(self.raw())).ok()?;
        let state = call!(library, freenect_get_tilt_state(self.raw())).ok()?;
        if updated < 0 || state.is_null() {
            return None;
        }
        let (mut x, mut y, mut z) = (0.0, 0.0, 0.0);
        call!(library, freenect_get_mks_accel(state, &raw mut x, &raw mut y, &raw mut z)).ok()?;
        [x, y, z].iter().all(|v| v.is_finite()).then_some([x, y, z])
    }

    /// What the device says of its geometry; `None` where the library does not pass it on.
    pub fn constants(&self) -> Option<Constants> {
        let library = &self.context.library;
        let mut registration = call!(library, freenect_copy_registration(self.raw())).ok()?;
        let constants = constants_of(&registration);
        // Its tables are ours to free; ours are worked out from the constants.
        let _ = call!(library, freenect_destroy_registration(&raw mut registration));
        Some(constants)
    }

    fn raw(&self) -> *mut c::freenect_device {
        self.handle.as_ptr()
    }
}

impl Drop for Sensor {
    fn drop(&mut self) {
        // Closing stops only one of the two by itself.
        self.stop(Stream::Depth);
        self.stop(Stream::Video);
        let _ = call!(self.context.library, freenect_close_device(self.raw()));
    }
}

fn accepted(result: c_int, what: &'static str) -> Result<(), Unavailable> {
    if result >= 0 { Ok(()) } else { Err(Unavailable(what)) }
}

fn constants_of(registration: &c::freenect_registration) -> Constants {
    let (info, plane) = (&registration.reg_info, &registration.zero_plane_info);
    Constants {
        emitter_cm: plane.dcmos_emitter_dist,
        color_camera_cm: plane.dcmos_rcmos_dist,
        reference_distance: plane.reference_distance,
        reference_pixel: plane.reference_pixel_size,
        constant_shift: registration.const_shift,
        start_lines: registration.reg_pad_info.start_lines,
        across: Polynomial {
            start: info.dx_start,
            dx: info.dxdx_start,
            dy: info.dydx_start,
            dxdx: info.dxdxdx_start,
            dydx: info.dydxdx_start,
            dydy: info.dydydx_start,
            third_xxx: info.ax,
            third_xxy: info.cx,
            third_xyy: info.dx,
            third_yyy: info.bx,
        },
        down: Polynomial {
            start: info.dy_start,
            dx: info.dxdy_start,
            dy: info.dydy_start,
            dxdx: info.dxdxdy_start,
            dydx: info.dydxdy_start,
            dydy: info.dydydy_start,
            third_xxx: info.ay,
            third_xxy: info.cy,
            third_xyy: info.dy,
            third_yyy: info.by,
        },
    }
}
