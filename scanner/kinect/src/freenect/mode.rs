//! Image formats that libfreenect offers. They are listed, never asked for: the replay library aborts on what it lacks.

use std::ffi::c_int;

use super::handle::Unavailable;
use super::inbox::Stream;
use crate::sys::freenect::Library;
use crate::sys::freenect::bindings::freenect_frame_mode;

/// 640 x 480.
const MEDIUM: u32 = 1;
/// 1280 x 1024.
const HIGH: u32 = 2;

/// A format and size of images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Raw depth, 11 bits in 16.
    Raw,
    /// Raw depth, 10 bits in 16.
    RawTenBits,
    /// Depth in millimetres in the infrared camera's geometry, as the library works it out.
    Millimetres,
    /// Depth in millimetres in the colour camera's geometry, as the library works it out.
    Registered,
    /// Colour of 640 x 480 pixels.
    Color,
    /// Colour of 1280 x 1024 pixels.
    LargeColor,
    /// The colour camera's pixels before they are made colours.
    Bayer,
}

impl Format {
    /// Whose it is.
    pub fn stream(self) -> Stream {
        match self {
            Self::Raw | Self::RawTenBits | Self::Millimetres | Self::Registered => Stream::Depth,
            Self::Color | Self::LargeColor | Self::Bayer => Stream::Video,
        }
    }

    /// The library's numbers: resolution, format, bytes an image.
    fn numbers(self) -> (u32, c_int, usize) {
        match self {
            Self::Raw => (MEDIUM, 0, 640 * 480 * 2),
            Self::RawTenBits => (MEDIUM, 1, 640 * 480 * 2),
            Self::Registered => (MEDIUM, 4, 640 * 480 * 2),
            Self::Millimetres => (MEDIUM, 5, 640 * 480 * 2),
            Self::Color => (MEDIUM, 0, 640 * 480 * 3),
            Self::LargeColor => (HIGH, 0, 1280 * 1024 * 3),
            Self::Bayer => (MEDIUM, 1, 640 * 480),
        }
    }

    /// Bytes an image.
    pub fn bytes(self) -> usize {
        self.numbers().2
    }

    /// The library's own description of it; `None` where it does not offer the format.
    pub(super) fn find(self, library: &Library) -> Result<Option<freenect_frame_mode>, Unavailable> {
        let functions = &library.functions;
        let (count, get) = match self.stream() {
            Stream::Depth => (&functions.freenect_get_depth_mode_count, &functions.freenect_get_depth_mode),
            Stream::Video => (&functions.freenect_get_video_mode_count, &functions.freenect_get_video_mode),
        };
        let (Ok(count), Ok(get)) = (count, get) else { return Err(Unavailable("the list of modes")) };
        // SAFETY: takes nothing, returns a number.
        let count = unsafe { count() };
        // SAFETY: the number is one of those the library says it has.
        let modes = (0..count.clamp(0, 64)).map(|number| unsafe { get(number) });
        Ok(modes.into_iter().find(|mode| self.is(mode)))
    }

    fn is(self, mode: &freenect_frame_mode) -> bool {
        let (resolution, format, bytes) = self.numbers();
        // SAFETY: all members of the union are 32-bit numbers.
        let found = unsafe { mode.__bindgen_anon_1.dummy };
        mode.is_valid != 0
            && mode.resolution.0 == resolution
            && found == format
            && usize::try_from(mode.bytes) == Ok(bytes)
    }
}
