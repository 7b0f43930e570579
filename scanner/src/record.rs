//! Records a sensor's stream: every frame as it comes, without loss, as one moving stream of a `recording.json`.
//!
//! One thread takes frames from the sensor and does nothing else; two compress and write them behind a bounded queue.
//! What the queue has no room for is dropped and counted (a file waits instead). The free space of the disk is looked at
//! while there is enough of it: the recording ends early, and is kept, before the disk is full. A live recording grows in
//! `OUT.partial`, whose description is renewed all the while: where the program is killed, that folder is a recording.

mod error;
mod space;
mod usage;
mod workers;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use kinect::source::{Event, Frame, Source};
use reconstruct::recording::{Device, FrameEntry, Rig};

pub use error::RecordError;
pub use usage::{Usage, usage};

use crate::capture::journal::free_bytes;
use crate::capture::replay::is_replay;
use crate::output::OutputError;
use crate::recording::RecordingWriter;
use space::Space;
use workers::Workers;

/// How long to wait for the sensor before looking whether the end was asked for.
const GLANCE: Duration = Duration::from_millis(100);
/// How often the description of an unfinished recording is written.
const RENEWED: Duration = Duration::from_secs(1);
/// A sensor that sends nothing for so long has nothing to record.
const MOST_SILENCE: Duration = Duration::from_secs(15);

/// What to record and where to.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Folder of the recording.
    pub out: PathBuf,
    /// What took the pictures, as written down.
    pub device: Device,
    /// The cameras; the sensor's own unless somebody knows better.
    pub rig: Rig,
    /// Depth units in a metre.
    pub units_per_metre: f64,
    /// Ends after so much of the sensor's time.
    pub most: Option<Duration>,
    /// Takes every so many-th frame.
    pub every: usize,
    /// Whether frames that come too fast are dropped; a file can wait.
    pub may_drop: bool,
    /// Whether what was recorded before the sensor failed is of use.
    pub keeps_part: bool,
    /// The pictures are stored flipped left-right.
    pub is_mirrored: bool,
    /// Free space of the disk under a path, bytes.
    pub free_bytes: fn(&Path) -> std::io::Result<u64>,
}

impl Plan {
    /// All of what a sensor sends.
    pub fn of(source: &dyn Source, out: &Path) -> Self {
        let sensor = source.sensor();
        Self {
            out: out.to_owned(),
            device: Device { backend: sensor.backend.clone(), serial: sensor.serial.clone() },
            rig: sensor.rig,
            units_per_metre: sensor.units_per_metre,
            most: None,
            every: 1,
            may_drop: !is_file(&sensor.address),
            keeps_part: true,
            is_mirrored: false,
            free_bytes,
        }
    }
}

/// Whether an address is that of a recording, which can wait, rather than of a sensor.
pub fn is_file(address: &str) -> bool {
    let target = address.strip_prefix("openni2:").unwrap_or_default();
    is_replay(address) || kinect::is_recording(target)
}

/// What was recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorded {
    /// Pairs of pictures.
    pub frames: usize,
    /// Frames that were lost on this side: no room in the queue, or not taken from the driver in time.
    pub dropped: u64,
    /// Frames that never came, by the gaps between the times of those that did; with `every` above 1 not known: 0.
    pub missing: u64,
    /// Packets that the sensor lost.
    pub lost_packets: u64,
    /// From the first to the last frame, by the sensor's clock.
    pub length: Duration,
    /// Size of all pictures as files.
    pub bytes: u64,
    /// Why it ended.
    pub end: End,
}

/// Why a recording ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum End {
    /// The time asked for has passed.
    TimeIsUp,
    /// The recording that was played is over.
    SourceEnded,
    /// Somebody asked for it.
    Stopped,
    /// The sensor was unplugged.
    Unplugged,
    /// The sensor's driver failed, in words.
    Failed(String),
    /// Less space is left than should be.
    DiskNearlyFull,
}

impl End {
    /// Whether everything was recorded that was asked for.
    pub fn is_as_wished(&self) -> bool {
        matches!(self, Self::TimeIsUp | Self::SourceEnded | Self::Stopped)
    }
}

/// Records until the plan is fulfilled, the source ends, or `stop` is set; `progress` is told how much there is.
///
/// # Errors
/// Where no frame came, or nothing can be written. A sensor that goes in between is no error: what there is is kept.
pub fn record(
    source: &mut dyn Source,
    plan: &Plan,
    stop: &AtomicBool,
    progress: impl Fn(Duration),
) -> Result<Recorded, RecordError> {
    let space = Space::new(plan);
    space.check_before()?;
    let begin = if plan.keeps_part { RecordingWriter::begin_in_sight } else { RecordingWriter::begin };
    let mut writer = begin(&plan.out, &plan.rig, plan.units_per_metre, plan.device.clone())?;
    writer.set_mirrored(plan.is_mirrored);
    source.start()?;
    let workers = Workers::new(&writer);
    let mut taken = Taken::default();
    let end = thread::scope(|scope| {
        let _stopping = workers.start(scope);
        // Dropped at the end, which ends the thread.
        let (_recording, over) = mpsc::channel();
        if plan.keeps_part {
            let (writer, workers) = (&writer, &workers);
            scope.spawn(move || keep_description(writer, workers, &over));
        }
        take_frames(source, plan, stop, &space, &workers, &mut taken, progress)
    });
    source.stop();
    let written = workers.finish()?;
    let end = end?;
    if written.entries.is_empty() {
        return Err(RecordError::NoFrames(nothing_because(&end)));
    }
    if !plan.keeps_part && !end.is_as_wished() {
        return Err(RecordError::Part(nothing_because(&end)));
    }
    let frames = written.entries.len();
    let missing = if plan.every <= 1 { missing(&written.entries) } else { 0 };
    for entry in written.entries {
        writer.push_stream_frame(entry);
    }
    writer.finish()?;
    let length = Duration::from_nanos(taken.last_nanos - taken.first_nanos.unwrap_or(taken.last_nanos));
    let Taken { dropped, lost_packets, .. } = taken;
    Ok(Recorded { frames, dropped, missing, lost_packets, length, bytes: written.bytes, end })
}

/// Names the frames that are written in the unfinished recording's description, until `over`.
fn keep_description(writer: &RecordingWriter, workers: &Workers<'_>, over: &Receiver<()>) {
    let mut pause = RENEWED;
    while over.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
        let started = Instant::now();
        let entries = workers.entries();
        if !entries.is_empty() {
            // What cannot be written is told by whoever writes the pictures.
            let _ = writer.renew(entries);
        }
        // Of a long recording the description is long: it may take a small part of the time only.
        pause = RENEWED.max(started.elapsed() * 20);
    }
}

/// What has been taken from the sensor.
#[derive(Debug, Default)]
struct Taken {
    seen: usize,
    first_nanos: Option<u64>,
    last_nanos: u64,
    dropped: u64,
    lost_packets: u64,
}

fn take_frames(
    source: &mut dyn Source,
    plan: &Plan,
    stop: &AtomicBool,
    space: &Space,
    workers: &Workers<'_>,
    taken: &mut Taken,
    progress: impl Fn(Duration),
) -> Result<End, RecordError> {
    let mut last = Instant::now();
    loop {
        if stop.load(Ordering::SeqCst) {
            return Ok(End::Stopped);
        }
        if workers.have_failed() {
            // `Workers::finish` says why.
            return Ok(End::Failed(String::new()));
        }
        if space.is_short(workers.bytes())? {
            return Ok(End::DiskNearlyFull);
        }
        match source.next_event(GLANCE) {
            Event::Frame(frame) => {
                last = Instant::now();
                let first = *taken.first_nanos.get_or_insert(frame.color_timestamp_nanos);
                let passed = Duration::from_nanos(frame.color_timestamp_nanos.saturating_sub(first));
                if plan.most.is_some_and(|most| passed >= most) {
                    return Ok(End::TimeIsUp);
                }
                taken.dropped += u64::from(frame.skipped);
                taken.lost_packets += u64::from(frame.lost_packets);
                taken.last_nanos = taken.last_nanos.max(frame.color_timestamp_nanos);
                let is_wanted = taken.seen.is_multiple_of(plan.every.max(1));
                taken.seen += 1;
                let is_kept = !is_wanted || (fits(&frame, &plan.rig) && workers.take(frame, plan.may_drop));
                taken.dropped += u64::from(!is_kept);
                progress(passed);
            }
            Event::Ended => return Ok(End::SourceEnded),
            Event::Unplugged => return Ok(End::Unplugged),
            Event::Failed(words) => return Ok(End::Failed(words)),
            Event::Nothing if last.elapsed() > MOST_SILENCE => {
                return Ok(End::Failed("the sensor sends no pictures".to_owned()));
            }
            Event::Nothing | Event::Still(_) => {}
        }
    }
}

/// Whether a frame has the sizes that the recording says.
fn fits(frame: &Frame, rig: &Rig) -> bool {
    let size = |width: usize, height: usize| (width as u32, height as u32);
    size(frame.color.width, frame.color.height) == (rig.color.width, rig.color.height)
        && size(frame.depth.width, frame.depth.height) == (rig.depth.width, rig.depth.height)
}

/// Frames that are missing between others: how many more of the usual steps each gap has.
fn missing(entries: &[FrameEntry]) -> u64 {
    let mut steps: Vec<u64> = entries
        .windows(2)
        .map(|pair| pair[1].timestamp_nanos.saturating_sub(pair[0].timestamp_nanos))
        .collect();
    steps.sort_unstable();
    let usual = steps.get(steps.len() / 2).copied().unwrap_or_default().max(1);
    steps.iter().map(|step| ((step + usual / 2) / usual).saturating_sub(1)).sum()
}

fn nothing_because(end: &End) -> String {
    match end {
        End::Unplugged => "the sensor was unplugged".to_owned(),
        End::Failed(words) => words.clone(),
        End::Stopped => "it was stopped before the first frame".to_owned(),
        End::DiskNearlyFull => "the disk is nearly full".to_owned(),
        End::SourceEnded | End::TimeIsUp => "there was no pair of colour and depth".to_owned(),
    }
}

impl From<OutputError> for RecordError {
    fn from(error: OutputError) -> Self {
        Self::Output(error)
    }
}

#[cfg(test)]
mod tests;
