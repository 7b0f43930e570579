//! Brings in recordings of other programs: each importer turns a folder into a [`Source`], [`write()`] makes the recording.

pub mod bop;
mod error;
pub mod fakenect;
mod folder;
pub mod model;
pub mod oni;
pub mod pairs;
pub mod seven_scenes;
pub mod surface;
pub mod trajectory;
pub mod tum;

use std::fs;
use std::path::{Path, PathBuf};

use reconstruct::camera::Intrinsics;
use reconstruct::pose::{self, Pose};
use reconstruct::recording::{Device, FrameEntry, Rig};
use serde::Serialize;

pub use error::ImportError;

use crate::pictures::{self, PictureSize};
use crate::recording::{RecordingError, RecordingWriter, check_camera, check_units};

/// Kinds of folders that are understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// TUM RGB-D benchmark: rgb.txt, depth.txt, factor 5000
    Tum,
    /// BOP scene folder: scene_camera.json, rgb/, depth/
    Bop,
    /// 7-Scenes: frame-000000.color.png, .depth.png, .pose.txt
    SevenScenes,
    /// Dump of libfreenect's fakenect-record: INDEX.txt, d-*.pgm, r-*.ppm
    Fakenect,
    /// Pairs of pictures: NAME_rgb.png with NAME_depth.png, or folders color/ and depth/
    Pairs,
}

/// Focal lengths and principal point, pixels.
pub type Pinhole = [f64; 4];

/// What the command line says about the cameras; the importers know the rest.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// fx, fy, cx, cy of the colour camera.
    pub color_camera: Option<Pinhole>,
    /// fx, fy, cx, cy of the depth camera.
    pub depth_camera: Option<Pinhole>,
    /// k1, k2, p1, p2, k3.
    pub color_distortion: Option<[f64; 5]>,
    /// k1, k2, p1, p2, k3.
    pub depth_distortion: Option<[f64; 5]>,
    /// Colour-camera frame from depth-camera frame.
    pub color_from_depth: Option<Pose>,
    /// Depth units in a metre.
    pub units_per_metre: Option<f64>,
    /// The pictures are stored flipped left-right.
    pub mirrored: bool,
    /// Take every so many-th frame.
    pub every: usize,
}

/// A recording found in another program's folder.
#[derive(Debug)]
pub struct Source {
    /// What the importer knows about the cameras; the command line overrides it.
    pub known: Options,
    /// Pairs of pictures.
    pub frames: Vec<SourceFrame>,
    /// One moving camera rather than views of a resting one.
    pub is_stream: bool,
    /// A depth value that means "nothing measured", besides 0.
    pub invalid_depth: Option<u16>,
}

/// One pair of pictures.
#[derive(Debug, Clone)]
pub struct SourceFrame {
    /// View name where the source is no stream.
    pub name: String,
    /// Colour picture.
    pub color: PathBuf,
    /// Depth picture.
    pub depth: PathBuf,
    /// When it was taken.
    pub timestamp_nanos: u64,
    /// The colour camera's pose, where the source knows it.
    pub world_from_camera: Option<Pose>,
}

/// Which kind of folder this is; `None` where it looks like none of them.
pub fn detect(folder: &Path) -> Option<Kind> {
    if folder.join("rgb.txt").is_file() && folder.join("depth.txt").is_file() {
        return Some(Kind::Tum);
    }
    if folder.join("scene_camera.json").is_file() {
        return Some(Kind::Bop);
    }
    if fakenect::is_one(folder) {
        return Some(Kind::Fakenect);
    }
    if seven_scenes::is_one(folder) {
        return Some(Kind::SevenScenes);
    }
    pairs::is_one(folder).then_some(Kind::Pairs)
}

/// Reads a folder of a kind.
pub fn read(kind: Kind, folder: &Path) -> Result<Source, ImportError> {
    match kind {
        Kind::Tum => tum::read(folder),
        Kind::Bop => bop::read(folder),
        Kind::SevenScenes => seven_scenes::read(folder),
        Kind::Fakenect => fakenect::read(folder),
        Kind::Pairs => pairs::read(folder),
    }
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written {
    /// Pairs of pictures.
    pub frames: usize,
    /// How many of them came with a pose.
    pub poses: usize,
}

/// Poses that came with the source, beside the recording; not used by `build`, for comparison alone.
#[derive(Debug, Serialize)]
struct PosesFile {
    version: u32,
    views: Vec<PoseEntry>,
}

#[derive(Debug, Serialize)]
struct PoseEntry {
    view: String,
    world_from_camera: [f64; 16],
}

/// Writes the recording; `step` is called after every frame.
pub fn write(
    source: &Source,
    options: &Options,
    out: &Path,
    step: impl Fn(),
) -> Result<Written, ImportError> {
    let frames: Vec<&SourceFrame> = source.frames.iter().step_by(options.every.max(1)).collect();
    let first = frames.first().ok_or(ImportError::NoFrames)?;
    let rig = rig(source, options, first)?;
    let units = options.units_per_metre.or(source.known.units_per_metre).unwrap_or(1000.0);
    check_units(units)?;
    let device = Device { backend: "import".to_owned(), serial: String::new() };
    let mut writer = RecordingWriter::begin(out, &rig, units, device)?;
    writer.set_mirrored(options.mirrored);
    let mut poses = Vec::new();
    for (i, frame) in frames.iter().enumerate() {
        let entry = copy_frame(&mut writer, source, frame, &rig)?;
        let name = if source.is_stream { format!("{i:03}") } else { frame.name.clone() };
        if let Some(pose) = &frame.world_from_camera {
            poses.push(PoseEntry { view: name.clone(), world_from_camera: pose::to_row_major(pose) });
        }
        if source.is_stream {
            writer.push_stream_frame(entry);
        } else {
            writer.push_view(name, vec![entry]);
        }
        step();
    }
    let written = Written { frames: frames.len(), poses: poses.len() };
    if !poses.is_empty() {
        writer.write_json("poses.json", &PosesFile { version: 1, views: poses })?;
    }
    writer.finish()?;
    Ok(written)
}

/// The cameras by command line, else by what the importer knows; sizes are the pictures' own.
fn rig(source: &Source, options: &Options, first: &SourceFrame) -> Result<Rig, ImportError> {
    let known = &source.known;
    let color = options.color_camera.or(known.color_camera).ok_or(ImportError::NoCamera)?;
    let depth = options.depth_camera.or(known.depth_camera).unwrap_or(color);
    let color_distortion = options.color_distortion.or(known.color_distortion).unwrap_or_default();
    let same = options.depth_camera.or(known.depth_camera).is_none();
    let depth_distortion = options.depth_distortion.or(known.depth_distortion);
    let depth_distortion = depth_distortion.unwrap_or(if same { color_distortion } else { [0.0; 5] });
    let color_from_depth = options.color_from_depth.or(known.color_from_depth).unwrap_or_default();
    let camera = |name: &str, [fx, fy, cx, cy]: Pinhole, distortion, size: PictureSize| {
        let (width, height) = (size.width as u32, size.height as u32);
        let camera = Intrinsics { width, height, fx, fy, cx, cy, distortion };
        check_camera(name, &camera).map(|()| camera)
    };
    Ok(Rig {
        color: camera("color", color, color_distortion, picture_size(&first.color)?)?,
        depth: camera("depth", depth, depth_distortion, picture_size(&first.depth)?)?,
        color_from_depth,
    })
}

fn picture_size(path: &Path) -> Result<PictureSize, ImportError> {
    pictures::size(&read_picture(path)?)
        .map_err(|source| ImportError::Picture { path: path.to_owned(), source })
}

/// Copies a pair; every picture is decoded once, so that a broken one is found now.
fn copy_frame(
    writer: &mut RecordingWriter,
    source: &Source,
    frame: &SourceFrame,
    rig: &Rig,
) -> Result<FrameEntry, ImportError> {
    let bad = |path: &Path| {
        let path = path.to_owned();
        move |source| ImportError::Picture { path, source }
    };
    let (color, mut depth) = (read_picture(&frame.color)?, read_picture(&frame.depth)?);
    let size = (rig.color.width as usize, rig.color.height as usize);
    pictures::decode_color(&color, size.0, size.1).map_err(bad(&frame.color))?;
    let size = (rig.depth.width as usize, rig.depth.height as usize);
    let mut image = pictures::decode_depth(&depth, size.0, size.1, 1.0).map_err(bad(&frame.depth))?;
    if let Some(invalid) = source.invalid_depth.filter(|invalid| image.data.contains(invalid)) {
        image.data.iter_mut().filter(|raw| **raw == invalid).for_each(|raw| *raw = 0);
        depth = pictures::encode_depth(&image).map_err(ImportError::Encode)?;
    }
    let extension = if color.starts_with(&[0xff, 0xd8]) { "jpg" } else { "png" };
    Ok(FrameEntry {
        color: writer.add_color(extension, &color)?,
        depth: writer.add_depth(&depth)?,
        timestamp_nanos: frame.timestamp_nanos,
    })
}

/// Largest file that is read whole.
const MAX_FILE_BYTES: u64 = 64 << 20;

fn read_file(path: &Path) -> Result<Vec<u8>, ImportError> {
    let unreadable = |source| ImportError::Unreadable { path: path.to_owned(), source };
    let metadata = fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() || metadata.len() > MAX_FILE_BYTES {
        return Err(ImportError::NotAFile(path.to_owned()));
    }
    fs::read(path).map_err(unreadable)
}

/// A picture as PNG or JPEG; those of libfreenect's dumps become PNG.
fn read_picture(path: &Path) -> Result<Vec<u8>, ImportError> {
    let bytes = read_file(path)?;
    fakenect::to_png(path, &bytes).unwrap_or(Ok(bytes))
}

fn read_text(path: &Path) -> Result<String, ImportError> {
    Ok(String::from_utf8_lossy(&read_file(path)?).into_owned())
}

impl From<RecordingError> for ImportError {
    fn from(error: RecordingError) -> Self {
        Self::Recording(Box::new(error))
    }
}

#[cfg(test)]
mod tests;
