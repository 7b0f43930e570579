//! What OpenNI2's core hands to a driver and expects of it (`OniDriverTypes.h`).

use std::ffi::{c_char, c_int, c_void};

pub(crate) const OK: c_int = 0;
pub(crate) const ERROR: c_int = 1;
pub(crate) const NOT_IMPLEMENTED: c_int = 2;
pub(crate) const NOT_SUPPORTED: c_int = 3;
pub(crate) const BAD_PARAMETER: c_int = 4;

pub(crate) const SENSOR_COLOR: c_int = 2;
pub(crate) const SENSOR_DEPTH: c_int = 3;

pub(crate) const DEVICE_STATE_ERROR: c_int = 1;

pub(crate) const DEVICE_SERIAL: c_int = 3;
pub(crate) const DEVICE_REGISTRATION: c_int = 5;
pub(crate) const STREAM_CROPPING: c_int = 0;
pub(crate) const STREAM_HORIZONTAL_FOV: c_int = 1;
pub(crate) const STREAM_VERTICAL_FOV: c_int = 2;
pub(crate) const STREAM_VIDEO_MODE: c_int = 3;
pub(crate) const STREAM_MAX_VALUE: c_int = 4;
pub(crate) const STREAM_STRIDE: c_int = 6;
pub(crate) const STREAM_MIRRORING: c_int = 7;
pub(crate) const STREAM_AUTO_WHITE_BALANCE: c_int = 100;
pub(crate) const STREAM_AUTO_EXPOSURE: c_int = 101;

#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub(crate) struct VideoMode {
    pub(crate) format: c_int,
    pub(crate) width: c_int,
    pub(crate) height: c_int,
    pub(crate) fps: c_int,
}

#[repr(C)]
pub struct SensorInfo {
    pub(crate) sensor: c_int,
    pub(crate) modes: c_int,
    pub(crate) supported: *const VideoMode,
}

#[repr(C)]
pub struct DeviceInfo {
    pub(crate) uri: [c_char; 256],
    pub(crate) vendor: [c_char; 256],
    pub(crate) name: [c_char; 256],
    pub(crate) usb_vendor: u16,
    pub(crate) usb_product: u16,
}

#[repr(C)]
pub struct Frame {
    pub(crate) size: c_int,
    pub(crate) data: *mut c_void,
    pub(crate) sensor: c_int,
    pub(crate) micros: u64,
    pub(crate) index: c_int,
    pub(crate) width: c_int,
    pub(crate) height: c_int,
    pub(crate) mode: VideoMode,
    pub(crate) is_cropped: c_int,
    pub(crate) crop_x: c_int,
    pub(crate) crop_y: c_int,
    pub(crate) stride: c_int,
}

/// Functions of the core for one stream.
#[repr(C)]
pub struct StreamServices {
    pub(crate) context: *mut c_void,
    pub(crate) default_frame_size: extern "C" fn(*mut c_void) -> c_int,
    pub(crate) acquire: extern "C" fn(*mut c_void) -> *mut Frame,
    pub(crate) add_reference: extern "C" fn(*mut c_void, *mut Frame),
    pub(crate) release: extern "C" fn(*mut c_void, *mut Frame),
}

pub(crate) type DeviceCallback = extern "C" fn(*const DeviceInfo, *mut c_void);
pub(crate) type StateCallback = extern "C" fn(*const DeviceInfo, c_int, *mut c_void);
pub(crate) type FrameCallback = extern "C" fn(*mut c_void, *mut Frame, *mut c_void);
