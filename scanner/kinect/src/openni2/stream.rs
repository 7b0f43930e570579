//! One stream of a device: its mode, its camera, and its frames as checked copies.

use std::ffi::{c_int, c_void};
use std::ptr;
use std::sync::mpsc::SyncSender;

use reconstruct::camera::Intrinsics;
use reconstruct::image::{ColorImage, DepthImage};

use super::library::Library;
use super::tap::Tap;
use crate::sys::openni2::{
    ONI_STREAM_PROPERTY_HORIZONTAL_FOV, ONI_STREAM_PROPERTY_MIRRORING, ONI_STREAM_PROPERTY_VERTICAL_FOV,
    ONI_STREAM_PROPERTY_VIDEO_MODE, OniDeviceHandle, OniFrame, OniPixelFormat,
    OniPixelFormat_ONI_PIXEL_FORMAT_DEPTH_1_MM as DEPTH_1_MM,
    OniPixelFormat_ONI_PIXEL_FORMAT_DEPTH_100_UM as DEPTH_100_UM,
    OniPixelFormat_ONI_PIXEL_FORMAT_RGB888 as RGB888, OniSensorType_ONI_SENSOR_COLOR,
    OniSensorType_ONI_SENSOR_DEPTH, OniStatus, OniStreamHandle, OniVideoMode,
};
use crate::wire::{Failure, Stamped};

/// Largest side of a picture that is believed, pixels.
const MOST_PIXELS: c_int = 4096;
/// Half the field of view that is assumed where a stream names none that could be: the Kinect's, radians.
const USUAL_HALF_FOV: f64 = 0.507;

/// What a stream shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Depth,
    Color,
}

/// A frame's pixels with its time, never mirrored.
#[derive(Debug)]
pub(super) enum Pixels {
    Depth(Stamped<DepthImage>),
    Color(Stamped<ColorImage>),
}

/// A stream of an open device; destroyed when dropped, which must not be before it was stopped and had a rest.
pub(super) struct Stream<'a> {
    library: &'a Library,
    handle: OniStreamHandle,
    format: Format,
    tap: Option<Tap<'a>>,
}

/// What the frames of a stream look like.
#[derive(Debug, Clone, Copy)]
pub(super) struct Format {
    kind: Kind,
    mode: OniVideoMode,
    is_mirrored: bool,
}

impl<'a> Stream<'a> {
    /// Makes a stream; a live one is set to the mode that suits best and to no mirroring.
    pub(super) fn create(
        library: &'a Library,
        device: OniDeviceHandle,
        kind: Kind,
        is_live: bool,
    ) -> Result<Self, Failure> {
        let sensor = match kind {
            Kind::Depth => OniSensorType_ONI_SENSOR_DEPTH,
            Kind::Color => OniSensorType_ONI_SENSOR_COLOR,
        };
        let mut handle = ptr::null_mut();
        // SAFETY: the device is open, the handle is written.
        let status = unsafe { (library.api().oniDeviceCreateStream)(device, sensor, &raw mut handle) };
        library.check(kind.make_words(), status)?;
        let mode = OniVideoMode { pixelFormat: 0, resolutionX: 0, resolutionY: 0, fps: 0 };
        let format = Format { kind, mode, is_mirrored: false };
        let mut stream = Self { library, handle, format, tap: None };
        if is_live {
            stream.choose_mode();
            let off: c_int = 0;
            // What a driver cannot set is read below and undone by turning the pictures ourselves.
            let _ = stream.set(ONI_STREAM_PROPERTY_MIRRORING, &off);
        }
        stream.format.is_mirrored =
            stream.get(ONI_STREAM_PROPERTY_MIRRORING, 0 as c_int).is_some_and(|v| v != 0);
        stream.format.mode = stream
            .get(ONI_STREAM_PROPERTY_VIDEO_MODE, mode)
            .filter(OniVideoMode::is_plausible)
            .ok_or_else(|| Failure::Other(format!("its {} has no size that could be", kind.words())))?;
        if !kind.formats().contains(&stream.format.mode.pixelFormat) {
            return Err(Failure::Refused(format!(
                "its {} has pixels of OpenNI2's format {}; record depth in millimetres and colour as RGB888",
                kind.words(),
                stream.format.mode.pixelFormat
            )));
        }
        Ok(stream)
    }

    /// 640x480 at 30 frames a second or what comes nearest to it, in a format that is understood. A driver that refuses
    /// stays in the mode it has.
    fn choose_mode(&self) {
        // SAFETY: the stream lives; the description belongs to the library as long as it does.
        let info = unsafe { (self.library.api().oniStreamGetSensorInfo)(self.handle).as_ref() };
        let Some(info) = info.filter(|i| !i.pSupportedVideoModes.is_null() && i.numSupportedVideoModes > 0)
        else {
            return;
        };
        let count = info.numSupportedVideoModes as usize;
        // SAFETY: the library keeps a list of as many modes.
        let modes = unsafe { std::slice::from_raw_parts(info.pSupportedVideoModes, count) };
        let usable = modes.iter().filter(|mode| self.format.kind.formats().contains(&mode.pixelFormat));
        let away = |mode: &&OniVideoMode| {
            let size = (mode.resolutionX - 640).abs() + (mode.resolutionY - 480).abs();
            let format = self.format.kind.formats().iter().position(|format| *format == mode.pixelFormat);
            (size, (mode.fps - 30).abs(), format)
        };
        if let Some(best) = usable.min_by_key(away) {
            let _ = self.set(ONI_STREAM_PROPERTY_VIDEO_MODE, best);
        }
    }

    pub(super) fn handle(&self) -> OniStreamHandle {
        self.handle
    }

    /// Depth units in a metre.
    pub(super) fn units_per_metre(&self) -> f64 {
        self.format.units_per_metre()
    }

    /// The camera by its field of view: ideal, looking through the middle.
    pub(super) fn camera(&self) -> Intrinsics {
        let (width, height) = (self.format.mode.resolutionX as u32, self.format.mode.resolutionY as u32);
        let half = |property| {
            let angle = self.get(property, 0f32).map(|angle| f64::from(angle) / 2.0);
            angle.filter(|half| (0.05..1.5).contains(half))
        };
        let horizontal = half(ONI_STREAM_PROPERTY_HORIZONTAL_FOV).unwrap_or(USUAL_HALF_FOV);
        let fx = f64::from(width) / 2.0 / horizontal.tan();
        // Square pixels where the file says nothing of use.
        let fy =
            half(ONI_STREAM_PROPERTY_VERTICAL_FOV).map_or(fx, |half| f64::from(height) / 2.0 / half.tan());
        let middle = |side: u32| (f64::from(side) - 1.0) / 2.0;
        Intrinsics::pinhole(width, height, fx, fy, middle(width), middle(height))
    }

    /// From now on every frame is read by the driver's own thread as it comes and goes into `frames`, where it is kept
    /// until somebody has time for it: the library itself keeps one frame only, and the next one takes its place.
    pub(super) fn tap(&mut self, frames: SyncSender<Pixels>) -> Result<(), Failure> {
        self.tap = Some(Tap::open(self.library, self.handle, self.format, frames)?);
        Ok(())
    }

    pub(super) fn start(&self) -> Result<(), Failure> {
        // SAFETY: the stream lives.
        let status = unsafe { (self.library.api().oniStreamStart)(self.handle) };
        self.library.check(self.format.kind.start_words(), status)
    }

    pub(super) fn stop(&self) {
        // SAFETY: the stream lives; stopping twice is no error.
        unsafe { (self.library.api().oniStreamStop)(self.handle) };
    }

    /// The frame that is ready; `None` where there was none after all, or one of another shape than the stream's.
    pub(super) fn read(&self) -> Result<Option<Pixels>, Failure> {
        read(self.library, self.handle, self.format)
    }

    pub(super) fn is_supported(&self, property: u32) -> bool {
        // SAFETY: the stream lives.
        unsafe { (self.library.api().oniStreamIsPropertySupported)(self.handle, property as c_int) != 0 }
    }

    pub(super) fn set<T>(&self, property: u32, value: &T) -> OniStatus {
        let data = ptr::from_ref(value).cast::<c_void>();
        // SAFETY: the stream lives, the data has the size that is said.
        unsafe {
            (self.library.api().oniStreamSetProperty)(
                self.handle,
                property as c_int,
                data,
                size_of::<T>() as c_int,
            )
        }
    }

    fn get<T: Copy>(&self, property: u32, empty: T) -> Option<T> {
        let (mut value, mut size) = (empty, size_of::<T>() as c_int);
        // SAFETY: the stream lives, the library writes up to `size` bytes.
        let status = unsafe {
            (self.library.api().oniStreamGetProperty)(
                self.handle,
                property as c_int,
                (&raw mut value).cast(),
                &raw mut size,
            )
        };
        (status == 0 && size as usize == size_of::<T>()).then_some(value)
    }
}

impl Drop for Stream<'_> {
    fn drop(&mut self) {
        self.tap = None;
        // SAFETY: made in `create`, not used any more.
        unsafe { (self.library.api().oniStreamDestroy)(self.handle) };
    }
}

impl Kind {
    fn words(self) -> &'static str {
        if self == Self::Depth { "depth" } else { "colour" }
    }

    fn make_words(self) -> &'static str {
        if self == Self::Depth { "make a depth stream" } else { "make a colour stream" }
    }

    fn start_words(self) -> &'static str {
        if self == Self::Depth { "start the depth stream" } else { "start the colour stream" }
    }

    fn bytes_per_pixel(self) -> usize {
        if self == Self::Depth { 2 } else { 3 }
    }

    /// Pixel formats that are understood, the best one first.
    fn formats(self) -> &'static [OniPixelFormat] {
        if self == Self::Depth { &[DEPTH_1_MM, DEPTH_100_UM] } else { &[RGB888] }
    }
}

impl OniVideoMode {
    fn is_plausible(&self) -> bool {
        (1..=MOST_PIXELS).contains(&self.resolutionX) && (1..=MOST_PIXELS).contains(&self.resolutionY)
    }
}

impl Format {
    fn units_per_metre(&self) -> f64 {
        if self.mode.pixelFormat == DEPTH_100_UM { 10_000.0 } else { 1000.0 }
    }

    fn is_expected(&self, frame: &OniFrame) -> bool {
        let (width, height) = (self.mode.resolutionX, self.mode.resolutionY);
        (frame.width, frame.height) == (width, height)
            && frame.videoMode.pixelFormat == self.mode.pixelFormat
            && frame.croppingEnabled == 0
            && !frame.data.is_null()
            && frame.dataSize > 0
            && frame.stride >= width * self.kind.bytes_per_pixel() as c_int
    }

    /// Rows of `stride` bytes as an image, turned where the stream is mirrored; `None` where bytes are missing.
    fn copy(&self, bytes: &[u8], stride: usize, timestamp_nanos: u64) -> Option<Pixels> {
        let (width, height) = (self.mode.resolutionX as usize, self.mode.resolutionY as usize);
        let row_bytes = width * self.kind.bytes_per_pixel();
        let rows: Vec<&[u8]> =
            (0..height).map_while(|v| bytes.get(v * stride..v * stride + row_bytes)).collect();
        if rows.len() < height {
            return None;
        }
        Some(match self.kind {
            Kind::Depth => {
                let pixels = rows.iter().flat_map(|row| row.as_chunks::<2>().0);
                let data = pixels.map(|pixel| u16::from_le_bytes(*pixel)).collect();
                let image = DepthImage { width, height, data, units_per_metre: self.units_per_metre() };
                let image = if self.is_mirrored { image.mirrored() } else { image };
                Pixels::Depth(Stamped { image, timestamp_nanos, lost_packets: 0 })
            }
            Kind::Color => {
                let mut data = Vec::with_capacity(width * height);
                for row in rows {
                    data.extend_from_slice(row.as_chunks::<3>().0);
                }
                let image = ColorImage { width, height, data };
                let image = if self.is_mirrored { image.mirrored() } else { image };
                Pixels::Color(Stamped { image, timestamp_nanos, lost_packets: 0 })
            }
        })
    }
}

/// Reads the frame of a stream that is ready; `None` where there is none, or one of another format.
pub(super) fn read(
    library: &Library,
    stream: OniStreamHandle,
    format: Format,
) -> Result<Option<Pixels>, Failure> {
    let mut frame = ptr::null_mut();
    // SAFETY: the stream lives, the pointer is written.
    let status = unsafe { (library.api().oniStreamReadFrame)(stream, &raw mut frame) };
    library.check("read a frame", status)?;
    if frame.is_null() {
        return Ok(None);
    }
    let frame = Lent { library, frame };
    // SAFETY: a frame that was read is the reader's until it is released.
    let described = unsafe { &*frame.frame };
    if !format.is_expected(described) {
        return Ok(None);
    }
    // SAFETY: the data has as many bytes as the frame says, checked to be positive, and stays until the release.
    let bytes = unsafe {
        std::slice::from_raw_parts(described.data.cast::<u8>().cast_const(), described.dataSize as usize)
    };
    Ok(format.copy(bytes, described.stride as usize, described.timestamp.saturating_mul(1000)))
}

/// A frame that belongs to the library and is given back.
struct Lent<'a> {
    library: &'a Library,
    frame: *mut OniFrame,
}

impl Drop for Lent<'_> {
    fn drop(&mut self) {
        // SAFETY: read from a stream and not released before.
        unsafe { (self.library.api().oniFrameRelease)(self.frame) };
    }
}
