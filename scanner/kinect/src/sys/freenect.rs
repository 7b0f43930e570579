//! libfreenect, opened at run time: the bindings and where the library is looked for.

/// Made by `regen-freenect.sh`; the first line names the header's version.
#[allow(warnings, unsafe_op_in_unsafe_fn, clippy::all, clippy::pedantic, clippy::undocumented_unsafe_blocks)]
pub(crate) mod bindings;

use std::ffi::OsString;

use bindings::Freenect;

use crate::advice;

/// Names another library file: a copy of one's own, or the replay library.
pub(crate) const PATH_VARIABLE: &str = "SCAN_FREENECT_LIB";
/// Under which names distributions install it: Debian, upstream, development packages.
const NAMES: [&str; 3] = ["libfreenect.so.0.5", "libfreenect.so.0", "libfreenect.so"];
/// What the replay library has and the real one does not.
const REPLAY_MARK: &[u8] = b"freenect_set_depth_format\0";

/// The library, open.
pub(crate) struct Library {
    /// Its functions; each may be absent.
    pub(crate) functions: Freenect,
    /// Whether it plays a dump instead of talking to a sensor.
    pub(crate) is_replay: bool,
}

impl Library {
    /// Opens the library.
    ///
    /// # Errors
    /// How to get it, where none can be opened; for a file that was named, also what the system says of it.
    pub(crate) fn open() -> Result<Self, String> {
        let mut refusal = String::new();
        for name in names() {
            // SAFETY: a library's initialisers run in this process. It is the one the user installed or named; this is
            // done only in a driver's process, which may die of it.
            match unsafe { libloading::Library::new(&name) } {
                Ok(library) => return Ok(Self::from(library)),
                Err(error) => refusal = error.to_string(),
            }
        }
        let is_named = std::env::var_os(PATH_VARIABLE).is_some();
        let install = advice::INSTALL_FREENECT;
        Err(if is_named {
            format!("{install}; {PATH_VARIABLE} names another: {refusal}")
        } else {
            install.to_owned()
        })
    }

    fn from(library: libloading::Library) -> Self {
        // SAFETY: the symbol is looked for, never called.
        let is_replay = unsafe { library.get::<unsafe extern "C" fn()>(REPLAY_MARK) }.is_ok();
        // SAFETY: the functions have the types of the header: the library is libfreenect or its replay, by its name and symbols.
        let functions = unsafe { Freenect::from_library(library) };
        // Looking functions up cannot fail as a whole: each that is absent says so itself.
        let functions = functions.expect("every function is optional");
        Self { functions, is_replay }
    }
}

/// File names to try, in this order.
pub(crate) fn names() -> Vec<OsString> {
    match std::env::var_os(PATH_VARIABLE) {
        Some(path) => vec![path],
        None => NAMES.iter().map(OsString::from).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::bindings as c;
    use std::mem::{offset_of, size_of};

    /// What the C compiler makes of the header on 64-bit systems.
    #[test]
    fn layouts() {
        assert_eq!(size_of::<c::freenect_frame_mode>(), 24);
        assert_eq!(offset_of!(c::freenect_frame_mode, bytes), 12);
        assert_eq!(offset_of!(c::freenect_frame_mode, is_valid), 23);
        assert_eq!(size_of::<c::freenect_raw_tilt_state>(), 12);
        assert_eq!(offset_of!(c::freenect_raw_tilt_state, tilt_status), 8);
        assert_eq!(size_of::<c::freenect_reg_info>(), 29 * 4);
        assert_eq!(size_of::<c::freenect_reg_pad_info>(), 6);
        assert_eq!(size_of::<c::freenect_zero_plane_info>(), 16);
        assert_eq!(offset_of!(c::freenect_registration, zero_plane_info), 124);
        assert_eq!(offset_of!(c::freenect_registration, const_shift), 144);
        assert_eq!(size_of::<c::freenect_registration>(), 176);
        assert_eq!(size_of::<c::freenect_device_attributes>(), 16);
        assert_eq!(size_of::<c::timeval>(), 16);
        assert_eq!(size_of::<c::freenect_device_flags>(), 4);
    }
}
