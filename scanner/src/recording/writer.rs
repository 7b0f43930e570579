//! Writes recordings: images first, the description last, everything under a temporary name until it is complete.

use std::path::Path;

use reconstruct::board::BoardFile;
use reconstruct::pose;
use reconstruct::recording::{DepthCamera, Device, FrameEntry, RecordingFile, Rig, ViewEntry, ViewImages};
use serde::Serialize;

use crate::output::{self, OutputDir, OutputError};
use crate::pictures;

/// What a recording consists of; an older one of these names is replaced.
pub const OWNED_NAMES: [&str; 6] = ["recording.json", "board.json", "poses.json", "color", "depth", "truth"];

/// A recording being written. Dropped without [`Self::finish`], it leaves nothing.
#[derive(Debug)]
pub struct RecordingWriter {
    out: OutputDir,
    file: RecordingFile,
    colors: usize,
    depths: usize,
}

impl RecordingWriter {
    /// Starts a recording in the folder `out`. One that is there already is replaced; pictures of other origin are not.
    pub fn begin(out: &Path, rig: &Rig, units_per_metre: f64, device: Device) -> Result<Self, OutputError> {
        check_place(out)?;
        let file = RecordingFile {
            version: 1,
            device,
            color: rig.color,
            depth: DepthCamera { intrinsics: rig.depth, units_per_metre },
            color_from_depth: pose::to_row_major(&rig.color_from_depth),
            mirrored: false,
            views: Vec::new(),
            frames: Vec::new(),
        };
        Ok(Self { out: OutputDir::begin(out, &OWNED_NAMES)?, file, colors: 0, depths: 0 })
    }

    /// As [`Self::begin`], but what is left of it can be found and used should the program be killed: see [`Self::renew`].
    pub fn begin_in_sight(
        out: &Path,
        rig: &Rig,
        units_per_metre: f64,
        device: Device,
    ) -> Result<Self, OutputError> {
        let mut writer = Self::begin(out, rig, units_per_metre, device)?;
        writer.out = OutputDir::begin_in_sight(out, &OWNED_NAMES)?;
        Ok(writer)
    }

    /// Lets the unfinished recording consist of these frames of a stream for now.
    pub fn renew(&self, frames: Vec<FrameEntry>) -> Result<(), OutputError> {
        let file = RecordingFile { frames, ..self.file.clone() };
        let bytes = serde_json::to_vec(&file).map_err(|e| OutputError::Io {
            path: "recording.json".into(),
            source: std::io::Error::other(e),
        })?;
        self.out.renew("recording.json", &bytes)
    }

    /// Says that the images are stored flipped left-right.
    pub fn set_mirrored(&mut self, mirrored: bool) {
        self.file.mirrored = mirrored;
    }

    /// Adds a view: one colour image and its depth images with the times they were taken.
    pub fn add_view(&mut self, view: &ViewImages, timestamps_nanos: &[u64]) -> Result<(), OutputError> {
        let color = self.add_color("png", &encoded(pictures::encode_color(&view.color))?)?;
        let mut frames = Vec::new();
        for (i, depth) in view.depths.iter().enumerate() {
            let depth = self.add_depth(&encoded(pictures::encode_depth(depth))?)?;
            let timestamp_nanos = timestamps_nanos.get(i).copied().unwrap_or(0);
            frames.push(FrameEntry { color: color.clone(), depth, timestamp_nanos });
        }
        self.push_view(view.name.clone(), frames);
        Ok(())
    }

    /// Stores the bytes of a colour image; the returned path goes into a [`FrameEntry`].
    pub fn add_color(&mut self, extension: &str, bytes: &[u8]) -> Result<String, OutputError> {
        let name = format!("color/{:06}.{extension}", self.colors);
        self.colors += 1;
        self.out.write(&name, bytes)?;
        Ok(name)
    }

    /// Stores the bytes of a 16-bit PNG; the returned path goes into a [`FrameEntry`].
    pub fn add_depth(&mut self, bytes: &[u8]) -> Result<String, OutputError> {
        let name = format!("depth/{:06}.png", self.depths);
        self.depths += 1;
        self.out.write(&name, bytes)?;
        Ok(name)
    }

    /// Lists a view of frames stored before.
    pub fn push_view(&mut self, name: String, frames: Vec<FrameEntry>) {
        self.file.views.push(ViewEntry { name, frames, still: None });
    }

    /// Lists a frame of one moving stream; a recording has views or such frames, not both.
    pub fn push_stream_frame(&mut self, frame: FrameEntry) {
        self.file.frames.push(frame);
    }

    /// Puts `board.json` beside.
    pub fn write_board(&self, board: &BoardFile) -> Result<(), OutputError> {
        self.write_json("board.json", board)
    }

    /// Puts another file beside, as JSON: poses, truth.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), OutputError> {
        self.out.write_with(name, |file| {
            serde_json::to_writer_pretty(&mut *file, value)?;
            std::io::Write::write_all(file, b"\n")
        })
    }

    /// Puts another file beside.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), OutputError> {
        self.out.write(name, bytes)
    }

    /// Writes the description and puts the recording into its place.
    pub fn finish(self) -> Result<(), OutputError> {
        self.write_json("recording.json", &self.file)?;
        self.out.commit()
    }
}

/// Refuses a folder in which a recording would replace pictures of other origin, or in which nothing can be written.
pub fn check_place(out: &Path) -> Result<(), OutputError> {
    if !out.join("recording.json").exists() {
        let foreign = OWNED_NAMES.iter().map(|name| out.join(name)).find(|path| path.is_dir());
        foreign.map_or(Ok(()), |path| Err(OutputError::Foreign(path)))?;
    }
    output::check_writable(out)
}

fn encoded(bytes: Result<Vec<u8>, png::EncodingError>) -> Result<Vec<u8>, OutputError> {
    bytes.map_err(|e| OutputError::Io { path: "the recording".into(), source: std::io::Error::other(e) })
}
