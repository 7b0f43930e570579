//! What libfreenect hands over while it is called: images, and lines of its log.
//!
//! The library calls back on the thread that called it, and a driver's process has one sensor on one thread: what comes is
//! kept for that thread until the driver's loop fetches it. Nothing here may panic, for the callers are C.

use std::cell::RefCell;
use std::ffi::{CStr, c_char, c_void};

use crate::sys::freenect::bindings::{freenect_context, freenect_device, freenect_loglevel};

/// Images that may wait: more than one turn of the loop ever brings.
const WAITING: usize = 16;
/// Lines that are kept to explain a failure.
const LINES: usize = 20;

/// One of the two streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stream {
    /// The infrared camera's depth.
    Depth,
    /// The colour camera's pictures.
    Video,
}

/// An image as the library gives it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Arrived {
    /// Whose it is.
    pub stream: Stream,
    /// The sensor's 60 MHz counter.
    pub ticks: u32,
    /// Pixels in the format that was set.
    pub bytes: Vec<u8>,
    /// Packets lost since the stream's image before, as the library counts them: parts of the image are older than it.
    /// What is lost across the border of two images counts for the first.
    pub lost_packets: u32,
}

#[derive(Debug, Default)]
struct Inbox {
    /// Bytes of an image a stream; 0 while none is expected.
    sizes: [usize; 2],
    /// Packets lost since the streams' start, as logged last.
    lost: [u32; 2],
    /// Of these, how many an image has told already.
    told: [u32; 2],
    images: Vec<Arrived>,
    lines: Vec<String>,
}

thread_local! {
    static INBOX: RefCell<Inbox> = RefCell::default();
}

/// Says how large the images of a stream are from now on.
pub fn expect(stream: Stream, bytes: usize) {
    with(|inbox| inbox.sizes[stream as usize] = bytes);
}

/// What has come since the last call.
pub fn take_images() -> Vec<Arrived> {
    with(|inbox| std::mem::take(&mut inbox.images)).unwrap_or_default()
}

/// The last lines of the library's log that are errors, oldest first.
pub fn take_lines() -> Vec<String> {
    with(|inbox| std::mem::take(&mut inbox.lines)).unwrap_or_default()
}

/// `None` where the library calls back while the driver fetches, which it never does.
fn with<T>(act: impl FnOnce(&mut Inbox) -> T) -> Option<T> {
    INBOX.try_with(|inbox| inbox.try_borrow_mut().ok().map(|mut inbox| act(&mut inbox))).ok().flatten()
}

/// Depth has come.
///
/// # Safety
/// For libfreenect alone: `pixels` holds an image of the mode that was announced by [`expect`].
pub unsafe extern "C" fn on_depth(_device: *mut freenect_device, pixels: *mut c_void, ticks: u32) {
    // SAFETY: passed on from the library.
    unsafe { on_image(Stream::Depth, pixels, ticks) };
}

/// A picture has come.
///
/// # Safety
/// As [`on_depth`].
pub unsafe extern "C" fn on_video(_device: *mut freenect_device, pixels: *mut c_void, ticks: u32) {
    // SAFETY: passed on from the library.
    unsafe { on_image(Stream::Video, pixels, ticks) };
}

/// # Safety
/// As [`on_depth`].
unsafe fn on_image(stream: Stream, pixels: *mut c_void, ticks: u32) {
    if pixels.is_null() {
        return;
    }
    with(|inbox| {
        let size = inbox.sizes[stream as usize];
        // SAFETY: the library's buffer holds one image of the mode that was set, whose size is this, until we return.
        let bytes = unsafe { std::slice::from_raw_parts(pixels.cast::<u8>(), size) }.to_vec();
        inbox.deliver(stream, ticks, bytes);
    });
}

/// The library says something.
///
/// # Safety
/// For libfreenect alone: `line` is a C string.
pub unsafe extern "C" fn on_log(
    _context: *mut freenect_context,
    level: freenect_loglevel,
    line: *const c_char,
) {
    if line.is_null() {
        return;
    }
    // SAFETY: the library passes a string that ends, and keeps it until we return.
    let line = unsafe { CStr::from_ptr(line) }.to_string_lossy();
    with(|inbox| inbox.log(level, line.trim_end()));
}

impl Inbox {
    fn deliver(&mut self, stream: Stream, ticks: u32, bytes: Vec<u8>) {
        let which = stream as usize;
        let lost_packets = self.lost[which].saturating_sub(self.told[which]);
        self.told[which] = self.lost[which];
        if !bytes.is_empty() && self.images.len() < WAITING {
            self.images.push(Arrived { stream, ticks, bytes, lost_packets });
        }
    }

    fn log(&mut self, level: freenect_loglevel, line: &str) {
        if let Some((stream, lost)) = lost_in_all(line) {
            let which = stream as usize;
            // Counted anew after a restart.
            self.told[which] = if lost < self.lost[which] { 0 } else { self.told[which] };
            self.lost[which] = lost;
        } else if level.0 <= freenect_loglevel::FREENECT_LOG_ERROR.0 {
            if self.lines.len() == LINES {
                self.lines.remove(0);
            }
            self.lines.push(line.chars().take(300).collect());
        }
    }
}

/// `[Stream 70] Lost 3 total packets in 5 frames (…)`: the library tells of lost packets nowhere else.
fn lost_in_all(line: &str) -> Option<(Stream, u32)> {
    let (stream, rest) = line.strip_prefix("[Stream ")?.split_once("] Lost ")?;
    let lost = rest.split_once(" total packets")?.0.parse().ok()?;
    match stream {
        "70" => Some((Stream::Depth, lost)),
        "80" => Some((Stream::Video, lost)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_after_a_loss_says_so_once() {
        let mut inbox = Inbox::default();
        let debug = freenect_loglevel::FREENECT_LOG_DEBUG;
        inbox.log(debug, "[Stream 70] Lost 2 packets");
        inbox.log(debug, "[Stream 70] Lost 2 total packets in 5 frames (0.400000 lppf)");
        inbox.log(debug, "[Stream 80] Lost 1 total packets in 5 frames (0.200000 lppf)");
        for stream in [Stream::Depth, Stream::Depth, Stream::Video] {
            inbox.deliver(stream, 0, vec![0]);
        }
        inbox.log(debug, "[Stream 70] Lost 5 total packets in 7 frames (0.7 lppf)");
        inbox.deliver(Stream::Depth, 0, vec![0]);
        let lost: Vec<u32> = inbox.images.iter().map(|image| image.lost_packets).collect();
        assert_eq!(lost, [2, 0, 1, 3]);
    }

    #[test]
    fn only_errors_are_kept_and_few_of_them() {
        let mut inbox = Inbox::default();
        inbox.log(freenect_loglevel::FREENECT_LOG_DEBUG, "chatter");
        for i in 0..100 {
            inbox.log(freenect_loglevel::FREENECT_LOG_ERROR, &format!("Could not open camera: {i}"));
        }
        assert_eq!(
            (inbox.lines.len(), inbox.lines[LINES - 1].as_str()),
            (LINES, "Could not open camera: 99")
        );
        assert_eq!(lost_in_all("[Stream 70] Lost many total packets"), None);
        assert_eq!(lost_in_all("[Stream 99] Lost 1 total packets"), None);
    }

    #[test]
    fn images_that_nobody_expects_are_left() {
        let mut inbox = Inbox::default();
        inbox.deliver(Stream::Video, 0, vec![]);
        assert!(inbox.images.is_empty());
        (0..100).for_each(|i| inbox.deliver(Stream::Video, i, vec![1]));
        assert_eq!(inbox.images.len(), WAITING);
    }
}
