//! What a capture costs: CPU of a live picture, and of recording 30 pictures a second without loss. For `make capture-load`.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use clap::Parser;
use kinect::source::{Event, Frame, Source};
use reconstruct::board::BoardFile;
use scanner::capture::camera::{Camera, Frames};
use scanner::capture::journal::Journal;
use scanner::capture::live::Live;
use scanner::capture::simulated::{Simulated, usual_board};

/// Frames that may wait for the disk.
const ROOM: usize = 64;
/// Live pictures measured.
const PICTURES: usize = 200;

/// Measures the capture on this machine
#[derive(Debug, Parser)]
struct Args {
    /// Seconds to record
    #[arg(long, default_value_t = 60)]
    seconds: u64,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    live_pictures()?;
    recording(args.seconds)
}

/// CPU time and wall time of looking at a VGA frame and encoding its two pictures.
fn live_pictures() -> anyhow::Result<()> {
    let mut sensor = Simulated::open("simulated:mug", None)?;
    let mut live = Live::new(&sensor.sensor().rig, None, Some(&usual_board()));
    sensor.start()?;
    let frames: Vec<Arc<Frame>> = (0..6).map(|_| next(&mut sensor)).collect::<Result<_, _>>()?;
    let (cpu, wall, mut bytes) = (cpu_seconds()?, Instant::now(), 0);
    for index in 0..PICTURES {
        let frame = &frames[index % frames.len()];
        let look = live.look(frame, Instant::now());
        bytes += live.picture(frame, look).map_or(0, |picture| picture.len());
    }
    let per_picture = |seconds: f64| seconds * 1000.0 / PICTURES as f64;
    let (cpu, wall) = (per_picture(cpu_seconds()? - cpu), per_picture(wall.elapsed().as_secs_f64()));
    println!(
        "live picture: {cpu:.1} ms of CPU, {wall:.1} ms until it is there ({:.0} a second), {} kB",
        1000.0 / wall,
        bytes / PICTURES / 1000
    );
    Ok(())
}

/// The sensor's thread, the encoder and the disk at 30 frames a second.
fn recording(seconds: u64) -> anyhow::Result<()> {
    let folder = std::env::temp_dir().join(format!("capture-load-{}", std::process::id()));
    let sensor = Simulated::open("simulated:mug", None)?;
    let mut journal = Journal::begin(&folder, sensor.sensor(), &BoardFile::Known(usual_board()))?;
    let count = seconds as usize * 30;
    let mut view = journal.begin_view(count)?;
    let frames = Arc::<Frames>::default();
    let camera = Camera::start(Box::new(sensor), Arc::clone(&frames), |_| ())?;
    let (cpu, started) = (cpu_seconds()?, Instant::now());
    let inbox = frames.take_all(ROOM);
    let mut skipped = 0;
    for index in 0..count {
        let frame = inbox.recv_timeout(Duration::from_secs(3)).context("no frame came")?;
        skipped += if index == 0 { 0 } else { frame.skipped };
        view.add(&frame)?;
    }
    let dropped = frames.enough() + skipped;
    let (wall, cpu) = (started.elapsed().as_secs_f64(), cpu_seconds()? - cpu);
    let synced = Instant::now();
    journal.confirm(view)?;
    let synced = synced.elapsed().as_secs_f64();
    drop((camera, journal));
    let megabytes = std::fs::read_dir(folder.join("views/000"))?
        .map(|entry| Ok(entry?.metadata()?.len()))
        .sum::<std::io::Result<u64>>()?
        >> 20;
    std::fs::remove_dir_all(&folder)?;
    println!(
        "recording: {count} frames in {wall:.1} s, {dropped} dropped, {:.0} % of one core, {} MB of memory at most, {megabytes} MB written, {synced:.1} s to sync all at the end",
        100.0 * cpu / wall,
        status("VmHWM:")? >> 10,
    );
    ensure!(dropped == 0, "{dropped} frames were dropped");
    Ok(())
}

fn next(sensor: &mut Simulated) -> anyhow::Result<Arc<Frame>> {
    match sensor.next_event(Duration::from_secs(1)) {
        Event::Frame(frame) => Ok(frame),
        other => anyhow::bail!("no frame but {other:?}"),
    }
}

/// CPU time of this process so far, all threads (Linux counts it in hundredths of a second).
fn cpu_seconds() -> anyhow::Result<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").context("CPU time is measured on Linux only")?;
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |index: usize| fields.get(index).and_then(|text| text.parse::<f64>().ok()).unwrap_or(0.0);
    Ok((ticks(11) + ticks(12)) / 100.0)
}

/// A number of kilobytes from the process's status.
fn status(name: &str) -> anyhow::Result<u64> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default();
    Ok(line.split_whitespace().next().and_then(|text| text.parse().ok()).unwrap_or(0))
}
