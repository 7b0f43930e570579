//! The live check of a sensor: what its frames say about it, each finding with a number and what to do.
//!
//! [`watch`] looks on for some seconds, [`judge`] says what was found; the first touches the sensor, the second is pure.
//! Seconds, metres, pixels of the colour picture.

mod board;
mod offset;

use std::sync::Arc;
use std::time::{Duration, Instant};

use kinect::source::{Event, Frame, SensorInfo, Source, SourceError};
use reconstruct::board::KnownBoard;
use serde::Serialize;

use crate::capture::hints::Level;
pub use offset::color_depth_offset;

/// Frames kept for what needs pictures; more add nothing.
const KEPT: usize = 10;
/// A sensor that needs longer for its first frame does not run.
const FIRST_FRAME: Duration = Duration::from_secs(8);
/// Frames a second that a Kinect delivers, and those below which a capture is no pleasure.
const FULL_RATE: f64 = 27.0;
const POOR_RATE: f64 = 15.0;
/// Half the time between two frames: what free-running cameras may differ by.
const PAIR_SECONDS: f64 = 0.017;
/// Colour lies on depth as well as the eye can tell.
const OFFSET_PX: f64 = 3.0;
/// Depth and board agree as far as paper, printer and a usual sensor do, and as far as any sensor does.
const SCALE_USUAL: f64 = 0.015;
const SCALE_ANY: f64 = 0.04;
const BRIGHT: f64 = 140.0;
const DARK: f64 = 30.0;

/// What happened while somebody looked on.
#[derive(Debug, Clone, Default)]
pub struct Watched {
    /// Frames that came.
    pub frames: u64,
    /// From the first to the last of them.
    pub seconds: f64,
    /// Packets lost in them.
    pub lost_packets: u64,
    /// Frames that this computer was too slow for.
    pub skipped: u64,
    /// Colour minus depth, each frame.
    pub pair_seconds: Vec<f64>,
    /// The last frames.
    pub kept: Vec<Arc<Frame>>,
    /// What went wrong, in words.
    pub trouble: Option<String>,
}

/// One thing that was checked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// `frame_rate`, `lost_packets`, `computer`, `valid_depth`, `light`, `time_offset`, `pixel_offset`, `tags`,
    /// `duplicate_tags`, `depth_scale`.
    pub code: &'static str,
    /// Green: well; yellow: could be better; red: no good scan this way.
    pub level: Level,
    /// What was measured, in `unit`; none where it could not be.
    pub value: Option<f64>,
    /// Unit of `value`.
    pub unit: &'static str,
    /// In words, with what to do.
    pub text: String,
}

/// Starts the sensor, looks on for `seconds`, stops it.
pub fn watch(source: &mut dyn Source, seconds: f64) -> Result<Watched, SourceError> {
    source.start()?;
    let mut watched = Watched::default();
    let began = Instant::now();
    let mut first: Option<Instant> = None;
    loop {
        match source.next_event(Duration::from_millis(200)) {
            Event::Frame(frame) => {
                let first = *first.get_or_insert_with(Instant::now);
                watched.add(frame, first.elapsed().as_secs_f64());
            }
            Event::Ended => break,
            Event::Unplugged => watched.trouble = Some("it was unplugged".to_owned()),
            Event::Failed(why) => watched.trouble = Some(why),
            Event::Still(_) | Event::Nothing => {}
        }
        let enough = first.is_some_and(|first| first.elapsed().as_secs_f64() >= seconds);
        let never = first.is_none() && began.elapsed() > FIRST_FRAME;
        if enough || never || watched.trouble.is_some() {
            break;
        }
    }
    source.stop();
    Ok(watched)
}

impl Watched {
    fn add(&mut self, frame: Arc<Frame>, seconds: f64) {
        self.frames += 1;
        self.seconds = seconds;
        self.lost_packets += u64::from(frame.lost_packets);
        self.skipped += u64::from(frame.skipped);
        let (color, depth) = (frame.color_timestamp_nanos, frame.depth_timestamp_nanos);
        self.pair_seconds.push((color as f64 - depth as f64) * 1e-9);
        if self.kept.len() == KEPT {
            self.kept.remove(0);
        }
        self.kept.push(frame);
    }
}

/// All findings, in the order in which they should be solved.
pub fn judge(watched: &Watched, sensor: &SensorInfo, board: Option<&KnownBoard>) -> Vec<Finding> {
    if let Some(trouble) = &watched.trouble {
        let text = format!(
            "The sensor stopped: {trouble}. Unplug it, plug it in again, and see `scan-product devices`."
        );
        return vec![finding("frame_rate", Level::Red, None, "1/s", text)];
    }
    let Some(newest) = watched.kept.last() else {
        let text =
            "No picture came at all. Is its power supply plugged in, and does no other program use it?";
        return vec![finding("frame_rate", Level::Red, Some(0.0), "1/s", text)];
    };
    let mut findings =
        vec![rate(watched), packets(watched), computer(watched), pairs(watched), depth_and_light(newest)];
    findings.extend(darkness(newest));
    findings.push(offset::judge(sensor, newest));
    findings.extend(board::judge(&sensor.rig, board, &watched.kept));
    findings
}

fn finding(
    code: &'static str,
    level: Level,
    value: Option<f64>,
    unit: &'static str,
    text: impl Into<String>,
) -> Finding {
    Finding { code, level, value, unit, text: text.into() }
}

fn rate(watched: &Watched) -> Finding {
    let rate = if watched.seconds > 0.0 { (watched.frames - 1) as f64 / watched.seconds } else { 0.0 };
    let (level, advice) = match rate {
        FULL_RATE.. => (Level::Green, ""),
        POOR_RATE.. => (Level::Yellow, ": plug it into a USB port of its own, without a hub"),
        _ => (Level::Red, ": plug it into a USB 2 port of its own, without a hub, and close other programs"),
    };
    finding("frame_rate", level, Some(rate), "1/s", format!("{rate:.1} pictures a second{advice}."))
}

fn packets(watched: &Watched) -> Finding {
    let lost = watched.lost_packets;
    let share = lost as f64 / watched.frames.max(1) as f64;
    let (level, text) = match lost {
        0 => (Level::Green, "No USB packet was lost.".to_owned()),
        _ => (
            if share > 1.0 { Level::Red } else { Level::Yellow },
            format!(
                "{lost} USB packets were lost: use another port or cable, no hub, and no virtual machine."
            ),
        ),
    };
    finding("lost_packets", level, Some(lost as f64), "packets", text)
}

fn computer(watched: &Watched) -> Finding {
    let skipped = watched.skipped;
    let (level, text) = match skipped {
        0 => (Level::Green, "This computer keeps up with the sensor.".to_owned()),
        _ => (
            Level::Yellow,
            format!("This computer missed {skipped} pictures: close other programs while you scan."),
        ),
    };
    finding("computer", level, Some(skipped as f64), "pictures", text)
}

fn pairs(watched: &Watched) -> Finding {
    let seconds = median(&watched.pair_seconds);
    let text = format!("Colour and depth are taken {:.1} ms apart", seconds.abs() * 1000.0);
    if seconds.abs() <= PAIR_SECONDS {
        return finding("time_offset", Level::Green, Some(seconds), "s", format!("{text}."));
    }
    let text = format!("{text}: only take views while nothing moves.");
    finding("time_offset", Level::Yellow, Some(seconds), "s", text)
}

fn depth_and_light(frame: &Frame) -> Finding {
    let valid = frame.depth.data.iter().filter(|raw| **raw > 0).count() as f64;
    let share = valid / frame.depth.data.len().max(1) as f64;
    let percent = format!("{:.0} % of the picture has depth", share * 100.0);
    let (level, text) = match share {
        0.5.. => (Level::Green, format!("{percent}.")),
        0.25.. => (
            Level::Yellow,
            format!("{percent}: dark, shiny and far things give none; 0.5 to 1.2 m distance is good."),
        ),
        _ if brightness(frame) > BRIGHT => (
            Level::Red,
            format!(
                "{percent} and the room is very bright: sunlight drowns the sensor's own light. Close the curtains or move away from the window."
            ),
        ),
        _ => (Level::Red, format!("{percent}: keep 0.5 to 1.2 m distance and let nothing cover the sensor.")),
    };
    finding("valid_depth", level, Some(share), "share", text)
}

fn darkness(frame: &Frame) -> Option<Finding> {
    let gray = brightness(frame);
    (gray < DARK).then(|| {
        let text = "The room is so dark that markers and colours drown: switch on a lamp.";
        finding("light", Level::Yellow, Some(gray), "grey level", text)
    })
}

/// Mean grey level, 0 to 255.
fn brightness(frame: &Frame) -> f64 {
    let gray = frame.color.to_gray().data;
    gray.iter().map(|&v| f64::from(v)).sum::<f64>() / gray.len().max(1) as f64
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
