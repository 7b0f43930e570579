//! The library itself: found, opened, initialised, and shut down again; and what its callbacks said meanwhile.

use std::ffi::{CStr, OsString, c_void};
use std::mem::ManuallyDrop;
use std::path::PathBuf;
use std::ptr;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::probe::Listed;
use crate::sys::openni2::{
    OniCallbackHandle, OniDeviceCallbacks, OniDeviceInfo, OniDeviceState,
    OniDeviceState_ONI_DEVICE_STATE_EOF as STATE_EOF, OniDeviceState_ONI_DEVICE_STATE_ERROR as STATE_ERROR,
    OniDeviceState_ONI_DEVICE_STATE_NOT_READY as STATE_NOT_READY, OniStatus,
    OniStatus_ONI_STATUS_NO_DEVICE as NO_DEVICE, OniStatus_ONI_STATUS_NOT_SUPPORTED as NOT_SUPPORTED,
    OniStatus_ONI_STATUS_OK as OK, OpenNi2,
};
use crate::wire::Failure;

/// Names under which the library is looked for.
const NAMES: [&str; 4] = ["libOpenNI2.so.0", "libOpenNI2.so", "libOpenNI2.dylib", "OpenNI2.dll"];
/// The path of a library to use instead.
pub(super) const OVERRIDE: &str = "SCAN_OPENNI2_LIB";
/// The interface that the bindings were made of: 2.2.
const API_VERSION: i32 = 2002;

/// The library, initialised. One at a time in a process.
pub(super) struct Library {
    /// Never closed: its drivers have left threads behind that could still be running its code.
    api: ManuallyDrop<OpenNi2>,
    callbacks: OniCallbackHandle,
    /// Boxed, because the callbacks hold its address.
    watch: Box<Watch>,
}

/// What the callbacks said of the device that is open.
#[derive(Debug, Default)]
struct Watch {
    /// Its address as the library spells it.
    uri: Mutex<Vec<u8>>,
    is_gone: AtomicBool,
    is_at_end: AtomicBool,
}

impl Library {
    /// Opens and initialises the library. It changes the process's folder while it looks for drivers; that is undone.
    pub(super) fn open() -> Result<Self, Failure> {
        let api = ManuallyDrop::new(load()?);
        let folder = std::env::current_dir();
        // SAFETY: the first call to the library, from one thread.
        let status = unsafe { (api.oniInitialize)(API_VERSION) };
        if let Ok(folder) = folder {
            // A folder that has gone meanwhile is nothing a sensor needs.
            let _ = std::env::set_current_dir(folder);
        }
        let mut library = Self { api, callbacks: ptr::null_mut(), watch: Box::default() };
        library.check("start", status)?;
        library.register_callbacks()?;
        Ok(library)
    }

    /// The functions.
    pub(super) fn api(&self) -> &OpenNi2 {
        &self.api
    }

    /// Major, minor, maintenance and build number, with dots.
    pub(super) fn version(&self) -> String {
        // SAFETY: no arguments, a plain struct comes back.
        let v = unsafe { (self.api.oniGetVersion)() };
        format!("{}.{}.{}.{}", v.major, v.minor, v.maintenance, v.build)
    }

    fn register_callbacks(&mut self) -> Result<(), Failure> {
        let mut callbacks = OniDeviceCallbacks {
            deviceConnected: None,
            deviceDisconnected: Some(on_disconnected),
            deviceStateChanged: Some(on_state),
        };
        let cookie = ptr::from_ref::<Watch>(&self.watch).cast_mut().cast::<c_void>();
        // SAFETY: the struct is copied by the library; the cookie is the boxed `Watch`, which lives until the callbacks
        // have been unregistered in `drop`.
        let status = unsafe {
            (self.api.oniRegisterDeviceCallbacks)(&raw mut callbacks, cookie, &raw mut self.callbacks)
        };
        self.check("register callbacks", status)
    }

    /// From now on the callbacks' words about the device with this address count.
    pub(super) fn watch_device(&self, uri: &CStr) {
        if let Ok(mut watched) = self.watch.uri.lock() {
            *watched = uri.to_bytes().to_vec();
        }
    }

    /// Whether the device that is watched has been unplugged.
    pub(super) fn is_gone(&self) -> bool {
        self.watch.is_gone.load(Ordering::SeqCst)
    }

    /// Whether the recording that is watched is at its end.
    pub(super) fn is_at_end(&self) -> bool {
        self.watch.is_at_end.load(Ordering::SeqCst)
    }

    /// All devices that the drivers found.
    pub(super) fn devices(&self) -> Result<Vec<Listed>, Failure> {
        let (mut list, mut count) = (ptr::null_mut::<OniDeviceInfo>(), 0);
        // SAFETY: both are written by the library, the list is given back below.
        let status = unsafe { (self.api.oniGetDeviceList)(&raw mut list, &raw mut count) };
        self.check("list its devices", status)?;
        if list.is_null() || count <= 0 {
            return Ok(Vec::new());
        }
        // SAFETY: the library has made a list of `count` entries.
        let devices =
            unsafe { std::slice::from_raw_parts(list, count as usize) }.iter().map(Listed::of).collect();
        // SAFETY: the list came from the library and is not used any more.
        unsafe { (self.api.oniReleaseDeviceList)(list) };
        Ok(devices)
    }

    /// What a status means, with the library's own words.
    pub(super) fn check(&self, what: &str, status: OniStatus) -> Result<(), Failure> {
        if status == OK {
            return Ok(());
        }
        // SAFETY: no arguments; the text stays valid until the next call of this thread.
        let text = unsafe { (self.api.oniGetExtendedError)() };
        let words = if text.is_null() {
            String::new()
        } else {
            // SAFETY: a text of the library ends with a zero.
            unsafe { CStr::from_ptr(text) }.to_string_lossy().split_whitespace().collect::<Vec<_>>().join(" ")
        };
        let reason = match status {
            NO_DEVICE => "no such device",
            NOT_SUPPORTED => "not supported",
            _ => "it gave no reason",
        };
        let reason = if words.is_empty() { reason.to_owned() } else { words };
        Err(Failure::Other(format!("OpenNI2 could not {what}: {reason} (status {status})")))
    }
}

impl Drop for Library {
    fn drop(&mut self) {
        if !self.callbacks.is_null() {
            // SAFETY: registered in `open`; afterwards nothing points to `watch`.
            unsafe { (self.api.oniUnregisterDeviceCallbacks)(self.callbacks) };
        }
        // SAFETY: initialised in `open`; devices and streams borrow the library and are gone by now.
        unsafe { (self.api.oniShutdown)() };
    }
}

impl Listed {
    pub(super) fn of(info: &OniDeviceInfo) -> Self {
        let text = |chars: &[std::ffi::c_char]| {
            let bytes: Vec<u8> = chars.iter().map(|&c| c as u8).take_while(|&b| b != 0).collect();
            String::from_utf8_lossy(&bytes).into_owned()
        };
        let usb = (info.usbVendorId, info.usbProductId);
        Self { uri: text(&info.uri), vendor: text(&info.vendor), name: text(&info.name), usb }
    }
}

fn load() -> Result<OpenNi2, Failure> {
    let named = std::env::var_os(OVERRIDE).filter(|path| !path.is_empty());
    let candidates: Vec<OsString> =
        named.map_or_else(|| NAMES.iter().map(OsString::from).collect(), |path| vec![path]);
    let mut reasons = Vec::new();
    for name in &candidates {
        // SAFETY: the library's initialisers do nothing but set up its own data.
        match unsafe { OpenNi2::new(name) } {
            Ok(api) => return Ok(api),
            Err(error) => reasons.push((PathBuf::from(name), error.to_string())),
        }
    }
    let (path, reason) = reasons.swap_remove(0);
    let advice = if std::env::var_os(OVERRIDE).is_some_and(|path| !path.is_empty()) {
        format!("{OVERRIDE} names {}, which cannot be opened: {reason}", path.display())
    } else {
        "run `apt install libopenni2-0` (Debian and its relatives), or name the library in SCAN_OPENNI2_LIB"
            .to_owned()
    };
    Err(Failure::LibraryMissing(advice))
}

/// The watch behind a callback's cookie, if the callback is about the watched device.
///
/// # Safety
/// The pointers are as the library hands them to callbacks registered by [`Library::open`].
unsafe fn concerned<'a>(info: *const OniDeviceInfo, cookie: *mut c_void) -> Option<&'a Watch> {
    // SAFETY: the cookie is the boxed `Watch` that outlives the registration.
    let watch = unsafe { cookie.cast::<Watch>().as_ref() }?;
    // SAFETY: the library hands over a device's description that is valid during the call.
    let info = unsafe { info.as_ref() }?;
    let uri = watch.uri.lock().ok()?;
    let told: Vec<u8> = info.uri.iter().map(|&c| c as u8).take_while(|&b| b != 0).collect();
    (!uri.is_empty() && *uri == told).then_some(watch)
}

/// The library says that a device is gone.
unsafe extern "C" fn on_disconnected(info: *const OniDeviceInfo, cookie: *mut c_void) {
    // SAFETY: called by the library with what was registered.
    if let Some(watch) = unsafe { concerned(info, cookie) } {
        watch.is_gone.store(true, Ordering::SeqCst);
    }
}

/// The library says how a device is.
unsafe extern "C" fn on_state(info: *const OniDeviceInfo, state: OniDeviceState, cookie: *mut c_void) {
    // SAFETY: called by the library with what was registered.
    let Some(watch) = (unsafe { concerned(info, cookie) }) else { return };
    match state {
        STATE_EOF => watch.is_at_end.store(true, Ordering::SeqCst),
        STATE_ERROR | STATE_NOT_READY => {
            watch.is_gone.store(true, Ordering::SeqCst);
        }
        _ => {}
    }
}
