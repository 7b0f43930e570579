//! A recording as a sensor: what was recorded comes again, frame by frame, at its own pace or as fast as it is taken.
//!
//! `replay:FOLDER` keeps the times between frames, `replay-fast:FOLDER` does not wait. Nothing is ever left out: who is
//! late gets the next frame late. Views of a resting scene come one after the other.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use kinect::source::{Control, Event, Frame, SensorInfo, Source, SourceError};
use reconstruct::image::ColorImage;
use reconstruct::recording::FrameEntry;

use crate::recording::{Recording, RecordingError};

/// Addresses that play at the recording's own pace.
const OWN_PACE: &str = "replay:";
/// Addresses that play as fast as frames are taken.
const AS_TAKEN: &str = "replay-fast:";
/// Between frames whose times say nothing of use.
const USUAL_STEP: Duration = Duration::from_nanos(33_333_333);
/// Longest pause that is kept: between views somebody walked around.
const LONGEST_STEP: Duration = Duration::from_secs(1);

/// A recording being played.
#[derive(Debug)]
pub struct Replay {
    info: SensorInfo,
    recording: Recording,
    frames: Vec<FrameEntry>,
    keeps_pace: bool,
    /// The last colour picture, which the frames of a view share.
    color: Option<(String, Arc<ColorImage>)>,
    playing: Option<Playing>,
}

/// Where it is, and when the next frame is due.
#[derive(Debug)]
struct Playing {
    index: usize,
    due: Instant,
}

/// Whether an address is that of a recording to be replayed.
pub fn is_replay(address: &str) -> bool {
    address.starts_with(OWN_PACE) || address.starts_with(AS_TAKEN)
}

impl Replay {
    /// Opens the recording of an address.
    ///
    /// # Errors
    /// Where it cannot be read, with what to do.
    pub fn open(address: &str) -> Result<Self, SourceError> {
        let unknown = || {
            SourceError::NotFound(format!("{address:?} is no address of a recording: write replay:FOLDER"))
        };
        let own_pace = address.strip_prefix(OWN_PACE);
        let folder = own_pace.or_else(|| address.strip_prefix(AS_TAKEN)).ok_or_else(unknown)?;
        let unreadable = |error: RecordingError| SourceError::NotFound(error.to_string());
        let recording = Recording::open(Path::new(folder)).map_err(unreadable)?;
        let file = recording.file();
        let frames = file.view_entries().into_iter().flat_map(|view| view.frames).collect();
        let info = SensorInfo {
            backend: "replay".to_owned(),
            address: address.to_owned(),
            model: format!("Recording {folder}"),
            serial: file.device.serial.clone(),
            rig: recording.rig(),
            units_per_metre: file.depth.units_per_metre,
            abilities: Vec::new(),
        };
        Ok(Self { info, recording, frames, keeps_pace: own_pace.is_some(), color: None, playing: None })
    }

    fn load(&mut self, index: usize) -> Result<Frame, RecordingError> {
        let entry = &self.frames[index];
        let depth = Arc::new(self.recording.load_depth(&entry.depth)?);
        let color = match &self.color {
            Some((path, color)) if *path == entry.color => Arc::clone(color),
            _ => Arc::new(self.recording.load_color(&entry.color)?),
        };
        self.color = Some((entry.color.clone(), Arc::clone(&color)));
        Ok(Frame {
            index: index as u64,
            color,
            depth,
            color_timestamp_nanos: entry.timestamp_nanos,
            depth_timestamp_nanos: entry.timestamp_nanos,
            lost_packets: 0,
            skipped: 0,
            gravity: None,
        })
    }

    /// From a frame to the next one.
    fn step(&self, index: usize) -> Duration {
        let time = |index: usize| self.frames.get(index).map(|frame| frame.timestamp_nanos);
        let nanos = time(index + 1).zip(time(index)).and_then(|(next, this)| next.checked_sub(this));
        match nanos {
            Some(nanos) if nanos > 0 => Duration::from_nanos(nanos).min(LONGEST_STEP),
            _ => USUAL_STEP,
        }
    }
}

impl Source for Replay {
    fn sensor(&self) -> &SensorInfo {
        &self.info
    }

    fn start(&mut self) -> Result<(), SourceError> {
        self.playing = Some(Playing { index: 0, due: Instant::now() });
        Ok(())
    }

    fn next_event(&mut self, patience: Duration) -> Event {
        let Some(Playing { index, due }) = self.playing.take() else {
            // Who asks in a loop must not turn it as fast as it goes.
            std::thread::sleep(patience.min(Duration::from_millis(100)));
            return Event::Nothing;
        };
        if index == self.frames.len() {
            return Event::Ended;
        }
        let wait = due.saturating_duration_since(Instant::now());
        if self.keeps_pace {
            std::thread::sleep(wait.min(patience));
            if wait > patience {
                self.playing = Some(Playing { index, due });
                return Event::Nothing;
            }
        }
        match self.load(index) {
            Ok(frame) => {
                // Who is late does not get the frames after this one any faster than they were taken.
                let due = due.max(Instant::now().checked_sub(USUAL_STEP).unwrap_or(due)) + self.step(index);
                self.playing = Some(Playing { index: index + 1, due });
                Event::Frame(Arc::new(frame))
            }
            Err(error) => Event::Failed(error.to_string()),
        }
    }

    fn control(&mut self, _control: Control) -> Result<(), SourceError> {
        Err(SourceError::Unable("it is a recording"))
    }

    fn stop(&mut self) {
        self.playing = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use reconstruct::camera::Intrinsics;
    use reconstruct::image::DepthImage;
    use reconstruct::pose::Pose;
    use reconstruct::recording::{Device, Rig};

    use crate::pictures;
    use crate::recording::RecordingWriter;

    /// Four frames, 20 ms apart, the first two of which share their colour picture.
    fn recording() -> tempfile::TempDir {
        let home = tempfile::tempdir().unwrap();
        let camera = Intrinsics::pinhole(32, 24, 30.0, 30.0, 15.5, 11.5);
        let rig = Rig { color: camera, depth: camera, color_from_depth: Pose::identity() };
        let device = Device { backend: "freenect".to_owned(), serial: "A1".to_owned() };
        let mut writer = RecordingWriter::begin(&home.path().join("rec"), &rig, 1000.0, device).unwrap();
        writer.set_mirrored(true);
        let mut color = String::new();
        for i in 0..4u16 {
            if i != 1 {
                let mut image = ColorImage::filled(32, 24, [i as u8; 3]);
                image.data[0] = [200; 3];
                color = writer.add_color("png", &pictures::encode_color(&image).unwrap()).unwrap();
            }
            let depth =
                DepthImage { width: 32, height: 24, data: vec![800 + i; 32 * 24], units_per_metre: 1000.0 };
            let depth = writer.add_depth(&pictures::encode_depth(&depth).unwrap()).unwrap();
            let timestamp_nanos = 5_000_000_000 + u64::from(i) * 20_000_000;
            writer.push_stream_frame(FrameEntry { color: color.clone(), depth, timestamp_nanos });
        }
        writer.finish().unwrap();
        home
    }

    fn open(kind: &str, home: &tempfile::TempDir) -> Replay {
        Replay::open(&format!("{kind}{}", home.path().join("rec").display())).unwrap()
    }

    fn play(replay: &mut Replay) -> Vec<Arc<Frame>> {
        let mut frames = Vec::new();
        loop {
            match replay.next_event(Duration::from_secs(2)) {
                Event::Frame(frame) => frames.push(frame),
                Event::Ended => return frames,
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn every_frame_comes_unmirrored_and_then_the_end() {
        let home = recording();
        let mut replay = open(AS_TAKEN, &home);
        assert!(matches!(replay.next_event(Duration::ZERO), Event::Nothing), "not started");
        for _ in 0..2 {
            replay.start().unwrap();
            let frames = play(&mut replay);
            assert_eq!(frames.len(), 4);
            for (i, frame) in frames.iter().enumerate() {
                assert_eq!(frame.depth.data[0], 800 + i as u16);
                let own = [0, 0, 2, 3][i];
                assert_eq!((frame.color.data[31], frame.color.data[0]), ([200; 3], [own; 3]));
                assert_eq!(frame.depth_timestamp_nanos, 5_000_000_000 + i as u64 * 20_000_000);
            }
            assert!(matches!(replay.next_event(Duration::ZERO), Event::Nothing), "the end comes once");
        }
        assert_eq!((replay.sensor().serial.as_str(), replay.sensor().backend.as_str()), ("A1", "replay"));
    }

    #[test]
    fn at_its_own_pace_it_takes_its_time() {
        let home = recording();
        let mut replay = open(OWN_PACE, &home);
        let started = Instant::now();
        replay.start().unwrap();
        assert_eq!(play(&mut replay).len(), 4);
        assert!(started.elapsed() >= Duration::from_millis(60), "{:?}", started.elapsed());
    }

    #[test]
    fn what_cannot_be_read_is_said() {
        let home = recording();
        let picture = home.path().join("rec/depth/000002.png");
        let bytes = std::fs::read(&picture).unwrap();
        std::fs::write(&picture, &bytes[..40]).unwrap();
        let mut replay = open(AS_TAKEN, &home);
        replay.start().unwrap();
        assert!(matches!(replay.next_event(Duration::ZERO), Event::Frame(_)));
        assert!(matches!(replay.next_event(Duration::ZERO), Event::Frame(_)));
        let event = replay.next_event(Duration::ZERO);
        assert!(matches!(&event, Event::Failed(words) if words.contains("depth/000002.png")), "{event:?}");
        for bad in ["replay:", "replay:/nowhere", "freenect"] {
            assert!(matches!(Replay::open(bad), Err(SourceError::NotFound(_))), "{bad}");
        }
    }
}
