//! A device that is open, with its two streams: set up in the order that works, and taken down in the order that does not
//! crash.

use std::ffi::{CStr, CString, c_int, c_void};
use std::ptr;
use std::sync::mpsc::{self, Receiver};
use std::time::Duration;

use super::library::Library;
use super::stream::{Kind, Pixels, Stream};
use crate::probe::Listed;
use crate::sys::openni2::{
    ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION, ONI_DEVICE_PROPERTY_PLAYBACK_REPEAT_ENABLED,
    ONI_DEVICE_PROPERTY_PLAYBACK_SPEED, ONI_DEVICE_PROPERTY_SERIAL_NUMBER, OniDeviceHandle, OniDeviceInfo,
    OniImageRegistrationMode_ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR as DEPTH_TO_COLOR, OniStreamHandle,
};
use crate::sys::openni2::{
    ONI_STREAM_PROPERTY_AUTO_EXPOSURE, ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE, OniStatus_ONI_STATUS_TIME_OUT,
};
use crate::wire::Failure;

/// How long the player of files needs to leave its streams alone after they were stopped. Destroyed at once, they crash
/// it in about one of eight runs; with this pause none of hundreds did.
const REST: Duration = Duration::from_millis(30);

/// Images of a sensor that may wait to be sent: half a second, 25 MB.
const WAITING: usize = 30;

/// A device with a depth and a colour stream.
pub(super) struct Device<'a> {
    library: &'a Library,
    handle: OniDeviceHandle,
    /// Whether this is a recording rather than a sensor.
    pub(super) is_file: bool,
    /// What it is, as the library says.
    pub(super) listed: Listed,
    /// Serial number, where it has one.
    pub(super) serial: String,
    /// Whether its depth is delivered in the colour camera's geometry.
    pub(super) is_registered: bool,
    streams: Vec<Stream<'a>>,
    /// Frames of a sensor, as its streams put them here.
    frames: Option<Receiver<Pixels>>,
    is_streaming: bool,
}

impl<'a> Device<'a> {
    /// Opens the device of an address and makes its streams; `uri` empty is any sensor there is.
    pub(super) fn open(library: &'a Library, uri: &CStr) -> Result<Self, Failure> {
        let mut handle = ptr::null_mut();
        let uri_pointer = if uri.is_empty() { ptr::null() } else { uri.as_ptr() };
        // SAFETY: the address ends with a zero (or is null, which means any device), the handle is written.
        let status = unsafe { (library.api().oniDeviceOpen)(uri_pointer, &raw mut handle) };
        library.check("open it", status)?;
        // From here on `drop` closes it.
        let mut device = Self {
            library,
            handle,
            is_file: false,
            listed: Listed { uri: String::new(), vendor: String::new(), name: String::new(), usb: (0, 0) },
            serial: String::new(),
            is_registered: false,
            streams: Vec::new(),
            frames: None,
            is_streaming: false,
        };
        device.identify()?;
        device.set_playback()?;
        // Depth first: a driver for the Kinect looks at its depth stream when it is asked about registration.
        for kind in [Kind::Depth, Kind::Color] {
            let stream = Stream::create(library, device.handle, kind, !device.is_file)?;
            device.streams.push(stream);
        }
        device.set_registration();
        if !device.is_file {
            let (sender, frames) = mpsc::sync_channel(WAITING);
            device.streams.iter_mut().try_for_each(|stream| stream.tap(sender.clone()))?;
            device.frames = Some(frames);
        }
        Ok(device)
    }

    fn identify(&mut self) -> Result<(), Failure> {
        let mut info = OniDeviceInfo {
            uri: [0; 256],
            vendor: [0; 256],
            name: [0; 256],
            usbVendorId: 0,
            usbProductId: 0,
        };
        // SAFETY: the device is open, the struct is written.
        let status = unsafe { (self.library.api().oniDeviceGetInfo)(self.handle, &raw mut info) };
        self.library.check("say what the device is", status)?;
        info.uri[255] = 0;
        // SAFETY: ends with a zero at the latest where one was put.
        self.library.watch_device(unsafe { CStr::from_ptr(info.uri.as_ptr()) });
        self.listed = Listed::of(&info);
        self.serial = self.serial_number();
        Ok(())
    }

    /// Frames of a file come one by one as they are read, once.
    fn set_playback(&mut self) -> Result<(), Failure> {
        self.is_file = self.is_supported(ONI_DEVICE_PROPERTY_PLAYBACK_SPEED);
        if self.is_file {
            // At any other speed frames that are not read in time are gone.
            let as_read: f32 = -1.0;
            self.set(ONI_DEVICE_PROPERTY_PLAYBACK_SPEED, &as_read, "play the file frame by frame")?;
            // Four bytes: the library refuses one.
            let once: c_int = 0;
            self.set(ONI_DEVICE_PROPERTY_PLAYBACK_REPEAT_ENABLED, &once, "play the file once")?;
        }
        Ok(())
    }

    /// Asks a sensor for depth in the colour camera's geometry. A file holds what was recorded, whatever is set.
    fn set_registration(&mut self) {
        // SAFETY: the device is open.
        let supported = unsafe {
            (self.library.api().oniDeviceIsImageRegistrationModeSupported)(self.handle, DEPTH_TO_COLOR) != 0
        };
        if self.is_file || !supported {
            return;
        }
        let wanted = DEPTH_TO_COLOR as c_int;
        let set = self.set(ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION, &wanted, "register depth to colour");
        self.is_registered =
            set.is_ok() && self.get(ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION, 0 as c_int) == Some(wanted);
    }

    /// What the depth stream delivers.
    pub(super) fn depth(&self) -> &Stream<'a> {
        &self.streams[0]
    }

    /// What the colour stream delivers.
    pub(super) fn color(&self) -> &Stream<'a> {
        &self.streams[1]
    }

    /// Whether exposure and white balance can be held.
    pub(super) fn can_lock_exposure(&self) -> bool {
        let color = self.color();
        !self.is_file
            && color.is_supported(ONI_STREAM_PROPERTY_AUTO_EXPOSURE)
            && color.is_supported(ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE)
    }

    /// Holds exposure and white balance as they are, or lets them go.
    pub(super) fn lock_exposure(&self, lock: bool) -> Result<(), Failure> {
        let automatic: c_int = (!lock).into();
        for (property, words) in [
            (ONI_STREAM_PROPERTY_AUTO_EXPOSURE, "hold the exposure"),
            (ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE, "hold the white balance"),
        ] {
            self.library.check(words, self.color().set(property, &automatic))?;
        }
        Ok(())
    }

    /// Starts both streams.
    pub(super) fn start(&mut self) -> Result<(), Failure> {
        self.is_streaming = true;
        self.streams.iter().try_for_each(Stream::start)
    }

    /// Stops both streams: at once at the end of a file, whose player otherwise keeps a core busy.
    pub(super) fn stop(&mut self) {
        if std::mem::take(&mut self.is_streaming) {
            self.streams.iter().for_each(Stream::stop);
        }
    }

    /// Waits for a frame of either stream and takes it; `None` where none came in time.
    pub(super) fn read(&self, patience: Duration) -> Result<Option<Pixels>, Failure> {
        match &self.frames {
            Some(frames) => Ok(frames.recv_timeout(patience).ok()),
            None => self.read_file(patience),
        }
    }

    fn read_file(&self, patience: Duration) -> Result<Option<Pixels>, Failure> {
        let mut handles: Vec<OniStreamHandle> = self.streams.iter().map(Stream::handle).collect();
        let mut ready: c_int = -1;
        let millis = patience.as_millis().min(60_000) as c_int;
        // SAFETY: the handles are those of living streams, as many as said.
        let status = unsafe {
            (self.library.api().oniWaitForAnyStream)(
                handles.as_mut_ptr(),
                handles.len() as c_int,
                &raw mut ready,
                millis,
            )
        };
        if status == OniStatus_ONI_STATUS_TIME_OUT {
            return Ok(None);
        }
        self.library.check("wait for a frame", status)?;
        match usize::try_from(ready).ok().and_then(|ready| self.streams.get(ready)) {
            Some(stream) => stream.read(),
            None => Ok(None),
        }
    }

    fn is_supported(&self, property: u32) -> bool {
        // SAFETY: the device is open.
        unsafe { (self.library.api().oniDeviceIsPropertySupported)(self.handle, property as c_int) != 0 }
    }

    fn set<T>(&self, property: u32, value: &T, what: &str) -> Result<(), Failure> {
        let data = ptr::from_ref(value).cast::<c_void>();
        // SAFETY: the device is open, the data has the size that is said.
        let status = unsafe {
            (self.library.api().oniDeviceSetProperty)(
                self.handle,
                property as c_int,
                data,
                size_of::<T>() as c_int,
            )
        };
        self.library.check(what, status)
    }

    fn get<T: Copy>(&self, property: u32, empty: T) -> Option<T> {
        let (mut value, mut size) = (empty, size_of::<T>() as c_int);
        // SAFETY: the device is open, the library writes up to `size` bytes.
        let status = unsafe {
            (self.library.api().oniDeviceGetProperty)(
                self.handle,
                property as c_int,
                (&raw mut value).cast(),
                &raw mut size,
            )
        };
        (status == 0 && size as usize == size_of::<T>()).then_some(value)
    }

    /// Of whatever length the driver gives.
    fn serial_number(&self) -> String {
        let (mut text, mut size) = ([0u8; 256], 256 as c_int);
        // SAFETY: the device is open, the library writes up to `size` bytes.
        let status = unsafe {
            (self.library.api().oniDeviceGetProperty)(
                self.handle,
                ONI_DEVICE_PROPERTY_SERIAL_NUMBER as c_int,
                text.as_mut_ptr().cast(),
                &raw mut size,
            )
        };
        let length = text.iter().position(|&b| b == 0).unwrap_or(text.len());
        if status == 0 { String::from_utf8_lossy(&text[..length]).trim().to_owned() } else { String::new() }
    }
}

impl Drop for Device<'_> {
    fn drop(&mut self) {
        self.stop();
        std::thread::sleep(REST);
        self.streams.clear();
        // SAFETY: opened in `open`; its streams have been destroyed.
        unsafe { (self.library.api().oniDeviceClose)(self.handle) };
    }
}

/// An address as the library wants it.
///
/// # Errors
/// Where it is longer than the library can hold, with advice.
pub(super) fn c_address(address: &str) -> Result<CString, Failure> {
    let most = crate::sys::openni2::ONI_MAX_STR as usize;
    if address.len() >= most {
        return Err(Failure::Refused(format!(
            "its path has {} bytes and OpenNI2 takes {} at most; copy the file to a folder with a shorter path",
            address.len(),
            most - 1
        )));
    }
    CString::new(address).map_err(|_zero| Failure::NotFound("its name has a zero byte in it".to_owned()))
}
