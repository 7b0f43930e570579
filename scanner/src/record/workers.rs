//! Compresses and writes frames on threads of their own, behind a queue that does not grow.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender, TrySendError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Scope;

use kinect::source::Frame;
use reconstruct::recording::FrameEntry;

use super::RecordError;
use crate::pictures;
use crate::recording::RecordingWriter;

/// Threads: one keeps up with 30 frames a second several times over, the second covers for it while the disk is slow.
const THREADS: usize = 2;
/// Frames that wait, at most: half a second, 25 MB.
const QUEUE: usize = 16;

type Job = (usize, Arc<Frame>);

/// The threads' shared state.
pub(super) struct Workers<'a> {
    writer: &'a RecordingWriter,
    queue: Mutex<Option<SyncSender<Job>>>,
    jobs: Mutex<Receiver<Job>>,
    entries: Mutex<Vec<(usize, FrameEntry)>>,
    error: Mutex<Option<RecordError>>,
    has_failed: AtomicBool,
    bytes: AtomicU64,
    accepted: AtomicU64,
}

/// What was written.
pub(super) struct Written {
    /// Frames in the order they came.
    pub(super) entries: Vec<FrameEntry>,
    /// Size of all files.
    pub(super) bytes: u64,
}

/// Lets the threads end when it goes.
pub(super) struct Stopping<'w, 'a>(&'w Workers<'a>);

impl Drop for Stopping<'_, '_> {
    fn drop(&mut self) {
        *lock(&self.0.queue) = None;
    }
}

impl<'a> Workers<'a> {
    pub(super) fn new(writer: &'a RecordingWriter) -> Self {
        let (queue, jobs) = mpsc::sync_channel(QUEUE);
        Self {
            writer,
            queue: Mutex::new(Some(queue)),
            jobs: Mutex::new(jobs),
            entries: Mutex::default(),
            error: Mutex::default(),
            has_failed: AtomicBool::new(false),
            bytes: AtomicU64::new(0),
            accepted: AtomicU64::new(0),
        }
    }

    /// Starts the threads; they end once what this returns is dropped and the queue is empty.
    pub(super) fn start<'scope>(&'scope self, scope: &'scope Scope<'scope, '_>) -> Stopping<'scope, 'a> {
        for _ in 0..THREADS {
            scope.spawn(|| self.work());
        }
        Stopping(self)
    }

    /// Takes a frame over; `false` where there is no room and `may_drop`.
    pub(super) fn take(&self, frame: Arc<Frame>, may_drop: bool) -> bool {
        let number = self.accepted.load(Ordering::SeqCst) as usize;
        let queue = lock(&self.queue);
        let Some(queue) = queue.as_ref() else { return false };
        let is_taken = if may_drop {
            !matches!(queue.try_send((number, frame)), Err(TrySendError::Full(_)))
        } else {
            queue.send((number, frame)).is_ok()
        };
        self.accepted.fetch_add(u64::from(is_taken), Ordering::SeqCst);
        is_taken
    }

    /// Whether something could not be written.
    pub(super) fn have_failed(&self) -> bool {
        self.has_failed.load(Ordering::SeqCst)
    }

    /// Bytes on the disk so far.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::SeqCst)
    }

    /// The frames that are written by now, in the order they came.
    pub(super) fn entries(&self) -> Vec<FrameEntry> {
        let mut entries = lock(&self.entries).clone();
        entries.sort_unstable_by_key(|(number, _)| *number);
        entries.into_iter().map(|(_, entry)| entry).collect()
    }

    /// All frames, after the threads have ended.
    ///
    /// # Errors
    /// The first thing that could not be written.
    pub(super) fn finish(self) -> Result<Written, RecordError> {
        if let Some(error) = lock(&self.error).take() {
            return Err(error);
        }
        let mut entries = std::mem::take(&mut *lock(&self.entries));
        entries.sort_unstable_by_key(|(number, _)| *number);
        let entries = entries.into_iter().map(|(_, entry)| entry).collect();
        Ok(Written { entries, bytes: self.bytes() })
    }

    fn work(&self) {
        loop {
            let job = lock(&self.jobs).recv();
            let Ok((number, frame)) = job else { return };
            // After a failure the queue is still emptied, so that nobody waits for room in it.
            if self.have_failed() {
                continue;
            }
            match self.write(number, &frame) {
                Ok(entry) => lock(&self.entries).push((number, entry)),
                Err(error) => {
                    lock(&self.error).get_or_insert(error);
                    self.has_failed.store(true, Ordering::SeqCst);
                }
            }
        }
    }

    fn write(&self, number: usize, frame: &Frame) -> Result<FrameEntry, RecordError> {
        let (color, depth) = (format!("color/{number:06}.png"), format!("depth/{number:06}.png"));
        let write = |name: &str, bytes: Result<Vec<u8>, png::EncodingError>| -> Result<(), RecordError> {
            let bytes = bytes.map_err(RecordError::Encode)?;
            self.writer.write(name, &bytes)?;
            self.bytes.fetch_add(bytes.len() as u64, Ordering::SeqCst);
            Ok(())
        };
        write(&color, pictures::encode_color(&frame.color))?;
        write(&depth, pictures::encode_depth(&frame.depth))?;
        Ok(FrameEntry { color, depth, timestamp_nanos: frame.color_timestamp_nanos })
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
