//! What libfreenect imports of libusb, by its names.
//!
//! Devices are numbers in the place of pointers: camera n is `0x1000 + 0x100 n`, motor n `0x2000 + 0x100 n`; a handle is
//! its device with the lowest bit set.

use std::alloc::{Layout, alloc_zeroed};
use std::ffi::{c_char, c_int, c_uint, c_void};
use std::ptr;
use std::thread;
use std::time::Duration;

use crate::bus::{self, Packet, Transfer};
use crate::kinect::note;
use crate::settings::SETTINGS;

const CAMERA: usize = 0x1000;
const MOTOR: usize = 0x2000;
const NO_DEVICE: c_int = -4;
const NOT_FOUND: c_int = -5;

/// libusb's device descriptor.
#[repr(C)]
pub struct Descriptor {
    length: u8,
    kind: u8,
    usb: u16,
    class: u8,
    subclass: u8,
    protocol: u8,
    packet: u8,
    vendor: u16,
    product: u16,
    version: u16,
    manufacturer: u8,
    name: u8,
    serial: u8,
    configurations: u8,
}

fn is_motor(device: usize) -> bool {
    device & 0xf000 == MOTOR
}

fn number(device: usize) -> usize {
    (device & 0xf00) >> 8
}

fn pause() {
    thread::sleep(Duration::from_millis(1));
}

/// # Safety
/// As libusb's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn libusb_init(context: *mut *mut c_void) -> c_int {
    if !context.is_null() {
        // SAFETY: the caller's variable; nobody looks behind the value.
        unsafe { *context = ptr::without_provenance_mut(0x77) };
    }
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_exit(_context: *mut c_void) {}

/// # Safety
/// As libusb's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn libusb_get_device_list(_context: *mut c_void, list: *mut *mut usize) -> isize {
    let mut devices = Vec::new();
    if !bus::with(|bus| bus.dead) {
        for index in 0..SETTINGS.serials.len() {
            devices.push(CAMERA + 0x100 * index);
            if !SETTINGS.no_motor {
                devices.push(MOTOR + 0x100 * index);
            }
        }
    }
    let count = devices.len();
    devices.push(0);
    // SAFETY: the caller's variable. The list stays: a few words a call.
    unsafe { *list = Box::leak(devices.into_boxed_slice()).as_mut_ptr() };
    count as isize
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_free_device_list(_list: *mut usize, _unref: c_int) {}

/// # Safety
/// As libusb's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn libusb_get_device_descriptor(device: usize, out: *mut Descriptor) -> c_int {
    let descriptor = Descriptor {
        length: 18,
        kind: 1,
        usb: 0x200,
        class: 0,
        subclass: 0,
        protocol: 0,
        packet: 64,
        vendor: 0x045e,
        product: if is_motor(device) { 0x02b0 } else { 0x02ae },
        // Model 1414.
        version: 0x010b,
        manufacturer: 1,
        name: 2,
        serial: 3,
        configurations: 1,
    };
    // SAFETY: the caller's variable.
    unsafe { *out = descriptor };
    0
}

/// # Safety
/// As libusb's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn libusb_open(device: usize, handle: *mut usize) -> c_int {
    if SETTINGS.refuse_open != 0 {
        return SETTINGS.refuse_open;
    }
    let dead = bus::with(|bus| {
        bus.kinect.number = number(device) as u32;
        bus.dead
    });
    if dead {
        return NO_DEVICE;
    }
    // SAFETY: the caller's variable.
    unsafe { *handle = device | 1 };
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_close(handle: usize) {
    note(&format!("close {}", if is_motor(handle) { "motor" } else { "camera" }));
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_get_device(handle: usize) -> usize {
    handle & !1
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_get_bus_number(_device: usize) -> u8 {
    1
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_get_parent(_device: usize) -> usize {
    0
}

/// # Safety
/// As libusb's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn libusb_get_string_descriptor_ascii(
    handle: usize,
    _which: u8,
    out: *mut u8,
    room: c_int,
) -> c_int {
    let Some(serial) = SETTINGS.serials.get(number(handle)) else { return NOT_FOUND };
    let length = serial.len().min(usize::try_from(room).unwrap_or(0).saturating_sub(1));
    // SAFETY: the caller's buffer has `room` bytes, one more than are copied.
    unsafe {
        ptr::copy_nonoverlapping(serial.as_ptr(), out, length);
        *out.add(length) = 0;
    }
    length as c_int
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_claim_interface(_handle: usize, _interface: c_int) -> c_int {
    SETTINGS.refuse_claim
}

/// Functions that have nothing to do and say that it went well.
macro_rules! fine {
    ($($name:ident),*) => {
        $(#[unsafe(no_mangle)] pub extern "C" fn $name() -> c_int { 0 })*
    };
}
fine!(
    libusb_release_interface,
    libusb_kernel_driver_active,
    libusb_detach_kernel_driver,
    libusb_attach_kernel_driver,
    libusb_set_interface_alt_setting,
    libusb_reset_device,
    libusb_set_configuration,
    libusb_set_auto_detach_kernel_driver
);

#[unsafe(no_mangle)]
pub extern "C" fn libusb_bulk_transfer() -> c_int {
    NO_DEVICE
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_get_active_config_descriptor() -> c_int {
    NOT_FOUND
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_free_config_descriptor() {}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_get_max_iso_packet_size(_device: usize, endpoint: u8) -> c_int {
    if endpoint == crate::kinect::DEPTH { 1760 } else { 1920 }
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_error_name(code: c_int) -> *const c_char {
    let name = match code {
        -3 => c"LIBUSB_ERROR_ACCESS",
        -4 => c"LIBUSB_ERROR_NO_DEVICE",
        -6 => c"LIBUSB_ERROR_BUSY",
        _ => c"LIBUSB_ERROR_OTHER",
    };
    name.as_ptr()
}

/// # Safety
/// As libusb's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn libusb_control_transfer(
    handle: usize,
    kind: u8,
    request: u8,
    value: u16,
    _index: u16,
    data: *mut u8,
    length: u16,
    _timeout: c_uint,
) -> c_int {
    let into_device = kind & 0x80 == 0;
    let answer = bus::with(|bus| {
        if bus.dead {
            return None;
        }
        if is_motor(handle) {
            return Some(bus.kinect.motor(request, value));
        }
        if into_device {
            // SAFETY: the caller's buffer.
            bus.kinect.command(unsafe { std::slice::from_raw_parts(data, usize::from(length)) });
            return Some(vec![]);
        }
        Some(bus.kinect.reply())
    });
    let Some(answer) = answer else { return NO_DEVICE };
    if into_device {
        return c_int::from(length);
    }
    let count = answer.len().min(usize::from(length));
    // SAFETY: the caller's buffer has `length` bytes, at least as many as are copied.
    unsafe { ptr::copy_nonoverlapping(answer.as_ptr(), data, count) };
    count as c_int
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_alloc_transfer(packets: c_int) -> *mut Transfer {
    let bytes = size_of::<Transfer>() + usize::try_from(packets).unwrap_or(0) * size_of::<Packet>();
    let Ok(layout) = Layout::from_size_align(bytes, align_of::<Transfer>()) else { return ptr::null_mut() };
    // SAFETY: not empty: a transfer alone has a size.
    unsafe { alloc_zeroed(layout) }.cast()
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_free_transfer(_transfer: *mut Transfer) {
    // Kept: a test lives shortly, and a call that comes late would find it.
}

/// # Safety
/// As libusb's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn libusb_submit_transfer(transfer: *mut Transfer) -> c_int {
    // SAFETY: the caller's transfer.
    let endpoint = unsafe { (*transfer).endpoint };
    bus::with(|bus| {
        if bus.dead {
            return NO_DEVICE;
        }
        bus.submit(transfer.expose_provenance(), endpoint);
        0
    })
}

/// # Safety
/// As libusb's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn libusb_cancel_transfer(transfer: *mut Transfer) -> c_int {
    // SAFETY: the caller's transfer.
    let endpoint = unsafe { (*transfer).endpoint };
    if bus::with(|bus| bus.cancel(transfer.expose_provenance(), endpoint)) { 0 } else { NOT_FOUND }
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_handle_events(_context: *mut c_void) -> c_int {
    if !bus::pump() {
        pause();
    }
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn libusb_handle_events_timeout(_context: *mut c_void, _most: *mut c_void) -> c_int {
    if !bus::pump() {
        pause();
    }
    0
}
