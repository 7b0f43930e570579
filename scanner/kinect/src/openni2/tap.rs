//! Reads a live stream where its frames come into being: on the driver's own thread.

use std::ffi::c_void;
use std::panic::{self, AssertUnwindSafe};
use std::ptr;
use std::sync::mpsc::SyncSender;

use super::library::Library;
use super::stream::{self, Format, Pixels};
use crate::sys::openni2::{OniCallbackHandle, OniStreamHandle};
use crate::wire::Failure;

/// A callback that is registered with a stream; closed when dropped, which is after the stream was stopped.
pub(super) struct Tap<'a> {
    library: &'a Library,
    stream: OniStreamHandle,
    callback: OniCallbackHandle,
    /// Boxed, because the callback holds its address; freed after the callback is gone.
    _spout: Box<Spout<'a>>,
}

/// What the callback needs.
struct Spout<'a> {
    library: &'a Library,
    stream: OniStreamHandle,
    format: Format,
    frames: SyncSender<Pixels>,
}

impl<'a> Tap<'a> {
    /// Registers the callback.
    pub(super) fn open(
        library: &'a Library,
        stream: OniStreamHandle,
        format: Format,
        frames: SyncSender<Pixels>,
    ) -> Result<Self, Failure> {
        let spout = Box::new(Spout { library, stream, format, frames });
        let cookie = ptr::from_ref::<Spout>(&spout).cast_mut().cast::<c_void>();
        let mut callback = ptr::null_mut();
        // SAFETY: the stream lives; the cookie is the boxed spout, which lives until the callback was unregistered.
        let status = unsafe {
            (library.api().oniStreamRegisterNewFrameCallback)(
                stream,
                Some(on_frame),
                cookie,
                &raw mut callback,
            )
        };
        library.check("watch a stream", status)?;
        Ok(Self { library, stream, callback, _spout: spout })
    }
}

impl Drop for Tap<'_> {
    fn drop(&mut self) {
        // SAFETY: registered in `open` with a stream that still lives.
        unsafe { (self.library.api().oniStreamUnregisterNewFrameCallback)(self.stream, self.callback) };
    }
}

/// The library has a new frame. What there is no room for is gone: its place among the times stays empty.
unsafe extern "C" fn on_frame(_stream: OniStreamHandle, cookie: *mut c_void) {
    // SAFETY: the cookie is the boxed spout that outlives the registration; nobody writes to it.
    let Some(spout) = (unsafe { cookie.cast::<Spout>().as_ref() }) else { return };
    // A panic must not unwind into the library; it has been printed, and the frame is lost.
    let _ = panic::catch_unwind(AssertUnwindSafe(|| {
        if let Ok(Some(pixels)) = stream::read(spout.library, spout.stream, spout.format) {
            let _ = spout.frames.try_send(pixels);
        }
    }));
}
