//! `scan-product record`: a sensor's stream on the disk, every frame as it came.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serde_json::json;

use crate::capture::sensors::{Opener, ThisComputer};
use crate::cli::{DONE, NO_GOOD_SCAN};
use crate::record::{self, End, Plan, Recorded, Usage};
use crate::recording::check_place;
use crate::ui::Ui;

const AFTER_HELP: &str = "\
The recording is one moving stream: colour and depth of every frame, without loss. Ctrl-C ends it
and keeps it. A minute takes 1 to 2 GB. Until then it grows in DIR.partial: where the program is
killed, that folder is a recording of all but the last second; build it, or rename it to DIR.

Examples:
  scan-product record --sensor freenect --seconds 20 --out rec       the Kinect
  scan-product record --sensor openni2 --out rec                     an Asus Xtion, until Ctrl-C
  scan-product record --sensor openni2:walk.oni --out rec            a recording of OpenNI's

Exit status 1: the sensor was unplugged or failed, or the disk is nearly full; what came before is
kept.";

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct Args {
    /// Which sensor: freenect, freenect:SERIAL, openni2, openni2:FILE.oni, replay:RECORDING, simulated
    #[arg(long, value_name = "ADDRESS")]
    sensor: String,
    /// Folder of the recording
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// End after so many seconds [default: with Ctrl-C]
    #[arg(long, value_name = "N", value_parser = seconds)]
    seconds: Option<Duration>,
    /// Take every N-th frame only
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
}

fn seconds(text: &str) -> Result<Duration, String> {
    let value = text.parse().ok().filter(|seconds| (0.1..=86_400.0).contains(seconds));
    value
        .map(Duration::from_secs_f64)
        .ok_or_else(|| "a number of seconds from 0.1 to 86400 is needed".to_owned())
}

/// Set by Ctrl-C.
static STOP: AtomicBool = AtomicBool::new(false);
/// Whether there is something to end.
static RECORDING: AtomicBool = AtomicBool::new(false);

/// Ends a recording so that it is kept; `false` where none is running, or where it was asked to end before.
pub fn end_recording() -> bool {
    RECORDING.load(Ordering::SeqCst) && !STOP.swap(true, Ordering::SeqCst)
}

/// Runs the command.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    check_place(&args.out)?;
    let mut source = ThisComputer.open(&args.sensor, None)?;
    let mut plan = Plan::of(source.as_ref(), &args.out);
    (plan.most, plan.every) = (args.seconds, args.every as usize);
    let whole_seconds = args.seconds.map_or(0, |seconds| seconds.as_secs() as usize);
    ui.note(&format!("{}: recording to {}", source.sensor().model, args.out.display()));
    let stage = ui.stage("recording", whole_seconds);
    let shown = std::cell::Cell::new(0);
    let show = |passed: Duration| {
        let seconds = passed.as_secs();
        stage.advance(seconds.saturating_sub(shown.replace(seconds)));
    };
    let before = record::usage();
    let started = std::time::Instant::now();
    RECORDING.store(true, Ordering::SeqCst);
    let recorded = record::record(source.as_mut(), &plan, &STOP, show);
    RECORDING.store(false, Ordering::SeqCst);
    let took = started.elapsed();
    drop(source);
    stage.done();
    let recorded = recorded?;
    say(args, &recorded, &used_since(before), took, ui);
    Ok(if recorded.end.is_as_wished() { DONE } else { NO_GOOD_SCAN })
}

/// Peak memory is that of the whole run.
fn used_since(before: Usage) -> Usage {
    let now = record::usage();
    Usage {
        cpu: now.cpu.saturating_sub(before.cpu),
        drivers_cpu: now.drivers_cpu.saturating_sub(before.drivers_cpu),
        ..now
    }
}

fn say(args: &Args, recorded: &Recorded, used: &Usage, took: Duration, ui: &Ui) {
    let Recorded { frames, dropped, missing, lost_packets, length, bytes, end } = recorded;
    let out = args.out.display();
    let ended = match end {
        End::TimeIsUp | End::SourceEnded | End::Stopped => None,
        End::Unplugged => Some("the sensor was unplugged; plug it in and record again".to_owned()),
        End::Failed(words) => Some(format!("the sensor's driver failed: {words}")),
        End::DiskNearlyFull => Some("the disk is nearly full; free some space before you go on".to_owned()),
    };
    if let Some(ended) = &ended {
        ui.warn(&format!("ended after {:.1} s: {ended}. What came before is kept", length.as_secs_f64()));
    }
    if *dropped > 0 {
        ui.warn(&format!("{dropped} frames were dropped: this computer or its disk is too slow or too busy"));
    }
    if *missing > *dropped {
        ui.warn(&format!(
            "{} more frames never came: the sensor or its driver left them out",
            missing - dropped
        ));
    }
    if *lost_packets > 0 {
        ui.warn(&format!("the sensor lost {lost_packets} packets; use another USB port, without a hub"));
    }
    let words = format!(
        "{frames} frames in {:.1} s ({dropped} dropped), {} MB, written to {out}\nNext: scan-product build {out} --out out",
        length.as_secs_f64(),
        bytes >> 20,
    );
    ui.result(
        &words,
        &json!({
            "out": args.out, "frames": frames, "dropped": dropped, "missing": missing,
            "lost_packets": lost_packets,
            "seconds": length.as_secs_f64(), "bytes": bytes, "complete": ended.is_none(), "ended": ended,
            "wall_seconds": took.as_secs_f64(), "cpu_seconds": used.cpu.as_secs_f64(),
            "driver_cpu_seconds": used.drivers_cpu.as_secs_f64(), "peak_memory_bytes": used.peak_memory_bytes,
        }),
    );
}
