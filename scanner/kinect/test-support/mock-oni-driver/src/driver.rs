//! The functions OpenNI2 looks for; a driver that lacks one of them is passed over without a word.
#![allow(non_snake_case)]

use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};

use crate::c_types::{
    BAD_PARAMETER, DEVICE_REGISTRATION, DEVICE_SERIAL, DEVICE_STATE_ERROR, DeviceCallback, DeviceInfo, ERROR,
    FrameCallback, NOT_IMPLEMENTED, NOT_SUPPORTED, OK, SENSOR_COLOR, SENSOR_DEPTH, STREAM_AUTO_EXPOSURE,
    STREAM_AUTO_WHITE_BALANCE, STREAM_CROPPING, STREAM_HORIZONTAL_FOV, STREAM_MAX_VALUE, STREAM_MIRRORING,
    STREAM_STRIDE, STREAM_VERTICAL_FOV, STREAM_VIDEO_MODE, SensorInfo, StateCallback, StreamServices,
    VideoMode,
};
use crate::stream::{COLOR_MODE, DEPTH_MODE, Stream};
use crate::{SECOND_URI, SERIALS, URI};

/// How to tell the core that the sensor is gone.
struct Core {
    disconnected: DeviceCallback,
    state_changed: StateCallback,
    cookie: usize,
    infos: Vec<usize>,
}

static CORE: Mutex<Option<Core>> = Mutex::new(None);
static REGISTRATION: AtomicI32 = AtomicI32::new(0);
static GONE: AtomicBool = AtomicBool::new(false);

pub(crate) fn is_registered() -> bool {
    REGISTRATION.load(Ordering::SeqCst) != 0
}

fn is_plugged_in() -> bool {
    std::env::var_os("MOCK_KINECT_PRESENT").is_none_or(|path| std::path::Path::new(&path).exists())
}

/// Whether the sensor is gone; the first to notice tells the core.
pub(crate) fn notice_unplugging() -> bool {
    if is_plugged_in() && !GONE.load(Ordering::SeqCst) {
        return false;
    }
    if !GONE.swap(true, Ordering::SeqCst)
        && let Ok(core) = CORE.lock()
        && let Some(core) = core.as_ref()
    {
        for info in &core.infos {
            let (info, cookie) = (*info as *const DeviceInfo, core.cookie as *mut c_void);
            (core.state_changed)(info, DEVICE_STATE_ERROR, cookie);
            (core.disconnected)(info, cookie);
        }
    }
    true
}

/// The addresses of the sensors there are.
fn addresses() -> &'static [&'static str] {
    if std::env::var_os("MOCK_KINECT_SECOND").is_some() { &[URI, SECOND_URI] } else { &[URI] }
}

fn info_of(uri: &str) -> &'static DeviceInfo {
    let mut info = Box::new(DeviceInfo {
        uri: [0; 256],
        vendor: [0; 256],
        name: [0; 256],
        usb_vendor: 0x1d27,
        usb_product: 0x0601,
    });
    copy_text(&mut info.uri, uri);
    copy_text(&mut info.vendor, "Mock");
    copy_text(&mut info.name, "Kinect for tests");
    // Lives as long as the process: the core keeps the pointer.
    Box::leak(info)
}

fn copy_text(to: &mut [c_char; 256], text: &str) {
    to.iter_mut().zip(text.bytes()).for_each(|(to, byte)| *to = byte as c_char);
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverCreate(_services: *mut c_void) {}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDestroy() {}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverInitialize(
    connected: DeviceCallback,
    disconnected: DeviceCallback,
    state_changed: StateCallback,
    cookie: *mut c_void,
) -> c_int {
    let infos: Vec<&DeviceInfo> = addresses().iter().map(|uri| info_of(uri)).collect();
    let pointers = infos.iter().map(|info| ptr::from_ref(*info) as usize).collect();
    let core = Core { disconnected, state_changed, cookie: cookie as usize, infos: pointers };
    let Ok(mut place) = CORE.lock() else { return ERROR };
    *place = Some(core);
    drop(place);
    if is_plugged_in() {
        infos.into_iter().for_each(|info| connected(info, cookie));
    }
    OK
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverTryDevice(_uri: *const c_char) -> c_int {
    ERROR
}

/// # Safety
/// `uri` is a text that ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverDeviceOpen(uri: *const c_char, _mode: *const c_char) -> *mut c_void {
    // SAFETY: the caller's promise.
    let uri = unsafe { CStr::from_ptr(uri) };
    let number = addresses().iter().position(|known| known.as_bytes() == uri.to_bytes());
    match number.filter(|_| is_plugged_in()) {
        // Only compared, never looked into.
        Some(number) => ptr::without_provenance_mut(number + 1),
        None => ptr::null_mut(),
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDeviceClose(_device: *mut c_void) {}

/// # Safety
/// `sensors` and `count` can be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverDeviceGetSensorInfoList(
    _device: *mut c_void,
    sensors: *mut *mut SensorInfo,
    count: *mut c_int,
) -> c_int {
    static DEPTH: VideoMode = DEPTH_MODE;
    static COLOR: VideoMode = COLOR_MODE;
    let list = Box::leak(Box::new([
        SensorInfo { sensor: SENSOR_DEPTH, modes: 1, supported: &raw const DEPTH },
        SensorInfo { sensor: SENSOR_COLOR, modes: 1, supported: &raw const COLOR },
    ]));
    // SAFETY: the caller's promise.
    unsafe {
        *sensors = list.as_mut_ptr();
        *count = 2;
    }
    OK
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDeviceCreateStream(_device: *mut c_void, sensor: c_int) -> *mut Stream {
    Stream::new(sensor)
}

/// # Safety
/// `stream` came from `oniDriverDeviceCreateStream` and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverDeviceDestroyStream(_device: *mut c_void, stream: *mut Stream) {
    // SAFETY: the caller's promise.
    let mut stream = unsafe { Box::from_raw(stream) };
    stream.stop();
}

/// # Safety
/// `data` has `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverDeviceSetProperty(
    _device: *mut c_void,
    id: c_int,
    data: *const c_void,
    size: c_int,
) -> c_int {
    // SAFETY: the caller's promise.
    match unsafe { read_int(data, size) } {
        Some(value) if id == DEVICE_REGISTRATION => {
            REGISTRATION.store(value, Ordering::SeqCst);
            OK
        }
        _ => NOT_SUPPORTED,
    }
}

/// # Safety
/// `data` has `*size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverDeviceGetProperty(
    device: *mut c_void,
    id: c_int,
    data: *mut c_void,
    size: *mut c_int,
) -> c_int {
    if id == DEVICE_SERIAL {
        let serial = SERIALS[(device.addr() - 1).min(1)];
        // SAFETY: the caller's promise; it has more room than a serial number needs, or is told that it has not.
        return unsafe { put_text(serial, data, size) };
    }
    if id != DEVICE_REGISTRATION {
        return NOT_SUPPORTED;
    }
    // SAFETY: the caller's promise.
    unsafe { put(REGISTRATION.load(Ordering::SeqCst), data, size) }
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDeviceIsPropertySupported(_device: *mut c_void, id: c_int) -> c_int {
    matches!(id, DEVICE_REGISTRATION | DEVICE_SERIAL).into()
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDeviceSetPropertyChangedCallback(
    _device: *mut c_void,
    _callback: *mut c_void,
    _cookie: *mut c_void,
) {
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDeviceNotifyAllProperties(_device: *mut c_void) {}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDeviceInvoke(
    _device: *mut c_void,
    _command: c_int,
    _data: *mut c_void,
    _size: c_int,
) -> c_int {
    NOT_IMPLEMENTED
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDeviceIsCommandSupported(_device: *mut c_void, _command: c_int) -> c_int {
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDeviceTryManualTrigger(_device: *mut c_void) -> c_int {
    OK
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDeviceIsImageRegistrationModeSupported(
    _device: *mut c_void,
    mode: c_int,
) -> c_int {
    (mode == 0 || mode == 1).into()
}

/// # Safety
/// `stream` came from `oniDriverDeviceCreateStream`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverStreamSetServices(stream: *mut Stream, services: *mut StreamServices) {
    // SAFETY: the caller's promise.
    unsafe { &*stream }.set_services(services);
}

/// # Safety
/// `stream` came from `oniDriverDeviceCreateStream`, `data` has `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverStreamSetProperty(
    stream: *mut Stream,
    id: c_int,
    data: *const c_void,
    size: c_int,
) -> c_int {
    // SAFETY: the caller's promise.
    let (shared, value) = unsafe { (&(*stream).shared, read_int(data, size)) };
    let flag = match id {
        STREAM_MIRRORING => &shared.is_mirrored,
        STREAM_AUTO_EXPOSURE => &shared.auto_exposure,
        STREAM_AUTO_WHITE_BALANCE => &shared.auto_white_balance,
        // There is one mode, and it is on.
        STREAM_VIDEO_MODE => return OK,
        _ => return NOT_SUPPORTED,
    };
    let Some(value) = value else { return BAD_PARAMETER };
    flag.store(value, Ordering::SeqCst);
    OK
}

/// # Safety
/// `stream` came from `oniDriverDeviceCreateStream`, `data` has `*size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverStreamGetProperty(
    stream: *mut Stream,
    id: c_int,
    data: *mut c_void,
    size: *mut c_int,
) -> c_int {
    // SAFETY: the caller's promise, here and for all that is put.
    let stream = unsafe { &*stream };
    // SAFETY: as above.
    unsafe {
        match id {
            STREAM_VIDEO_MODE => put(stream.mode(), data, size),
            STREAM_HORIZONTAL_FOV => put(1.014_468_7_f32, data, size),
            STREAM_VERTICAL_FOV => put(0.789_809_f32, data, size),
            STREAM_MAX_VALUE if stream.is_depth() => put(10_000, data, size),
            STREAM_STRIDE => put(stream.row_bytes(), data, size),
            STREAM_MIRRORING => put(stream.shared.is_mirrored.load(Ordering::SeqCst), data, size),
            STREAM_AUTO_EXPOSURE => put(stream.shared.auto_exposure.load(Ordering::SeqCst), data, size),
            STREAM_AUTO_WHITE_BALANCE => {
                put(stream.shared.auto_white_balance.load(Ordering::SeqCst), data, size)
            }
            STREAM_CROPPING => put([0, 0, 0, 640, 480], data, size),
            _ => NOT_SUPPORTED,
        }
    }
}

/// # Safety
/// `stream` came from `oniDriverDeviceCreateStream`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverStreamIsPropertySupported(stream: *mut Stream, id: c_int) -> c_int {
    // SAFETY: the caller's promise.
    let is_depth = unsafe { &*stream }.is_depth();
    let supported = match id {
        STREAM_AUTO_EXPOSURE | STREAM_AUTO_WHITE_BALANCE => !is_depth,
        STREAM_MAX_VALUE => is_depth,
        id => (STREAM_CROPPING..=STREAM_MIRRORING).contains(&id),
    };
    supported.into()
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverStreamSetPropertyChangedCallback(
    _stream: *mut Stream,
    _callback: *mut c_void,
    _cookie: *mut c_void,
) {
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverStreamNotifyAllProperties(_stream: *mut Stream) {}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverStreamInvoke(
    _stream: *mut Stream,
    _command: c_int,
    _data: *mut c_void,
    _size: c_int,
) -> c_int {
    NOT_IMPLEMENTED
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverStreamIsCommandSupported(_stream: *mut Stream, _command: c_int) -> c_int {
    0
}

/// # Safety
/// `stream` came from `oniDriverDeviceCreateStream`; the core calls one function of a stream at a time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverStreamStart(stream: *mut Stream) -> c_int {
    // SAFETY: the caller's promise.
    unsafe { &mut *stream }.start();
    OK
}

/// # Safety
/// `stream` came from `oniDriverDeviceCreateStream`; the core calls one function of a stream at a time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverStreamStop(stream: *mut Stream) {
    // SAFETY: the caller's promise.
    unsafe { &mut *stream }.stop();
}

/// # Safety
/// `stream` came from `oniDriverDeviceCreateStream`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverStreamGetRequiredFrameSize(stream: *mut Stream) -> c_int {
    // SAFETY: the caller's promise.
    let stream = unsafe { &*stream };
    stream.row_bytes() * stream.mode().height
}

/// # Safety
/// `stream` came from `oniDriverDeviceCreateStream`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn oniDriverStreamSetNewFrameCallback(
    stream: *mut Stream,
    callback: Option<FrameCallback>,
    cookie: *mut c_void,
) {
    // SAFETY: the caller's promise.
    unsafe { &*stream }.set_callback(callback, cookie);
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverStreamConvertDepthToColorCoordinates(
    _depth: *mut Stream,
    _color: *mut Stream,
    _x: c_int,
    _y: c_int,
    _z: u16,
    _color_x: *mut c_int,
    _color_y: *mut c_int,
) -> c_int {
    NOT_SUPPORTED
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverEnableFrameSync(_streams: *mut *mut Stream, _count: c_int) -> *mut c_void {
    ptr::null_mut()
}

#[unsafe(no_mangle)]
pub extern "C" fn oniDriverDisableFrameSync(_group: *mut c_void) {}

/// # Safety
/// `data` has `size` bytes.
unsafe fn read_int(data: *const c_void, size: c_int) -> Option<c_int> {
    // SAFETY: four bytes are there, by the caller's promise and the size.
    (size == 4).then(|| unsafe { data.cast::<c_int>().read_unaligned() })
}

/// Writes a property where the size is right.
///
/// # Safety
/// `data` has `*size` bytes.
unsafe fn put<T>(value: T, data: *mut c_void, size: *mut c_int) -> c_int {
    // SAFETY: the caller's promise.
    if unsafe { *size } as usize != size_of::<T>() {
        return BAD_PARAMETER;
    }
    // SAFETY: as many bytes as the value has are there.
    unsafe { data.cast::<T>().write_unaligned(value) };
    OK
}

/// Writes a text with a zero at its end, where there is room.
///
/// # Safety
/// `data` has `*size` bytes.
unsafe fn put_text(text: &str, data: *mut c_void, size: *mut c_int) -> c_int {
    // SAFETY: the caller's promise.
    if (unsafe { *size } as usize) <= text.len() {
        return BAD_PARAMETER;
    }
    // SAFETY: as just seen, all of the text and the zero fit.
    unsafe {
        ptr::copy_nonoverlapping(text.as_ptr(), data.cast::<u8>(), text.len());
        data.cast::<u8>().add(text.len()).write(0);
        *size = text.len() as c_int + 1;
    }
    OK
}
