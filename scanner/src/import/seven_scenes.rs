//! 7-Scenes sequences: `frame-000000.color.png`, `.depth.png` (millimetres, 65535 = none) and `.pose.txt`
//! (`world_from_camera`, metres; Shotton et al. 2013). The pages give one rough camera for both pictures.

use std::path::Path;

use super::folder::{pictures, stem};
use super::trajectory::parse_matrix;
use super::{ImportError, Options, Source, SourceFrame, read_text};

const COLOR: &str = ".color";
const DEPTH: &str = ".depth";

/// Whether the folder holds such frames.
pub(super) fn is_one(folder: &Path) -> bool {
    pictures(folder).is_ok_and(|paths| {
        paths.iter().any(|path| stem(path).starts_with("frame-") && stem(path).ends_with(COLOR))
    })
}

pub(super) fn read(folder: &Path) -> Result<Source, ImportError> {
    let paths = pictures(folder)?;
    let mut frames = Vec::new();
    let is = |ending: &str| paths.iter().filter(|path| stem(path).ends_with(ending)).count();
    for color in &paths {
        let name = stem(color);
        let Some(base) = name.strip_suffix(COLOR) else { continue };
        let depth = color.with_file_name(format!("{base}{DEPTH}.png"));
        if !depth.is_file() {
            return Err(ImportError::DifferentLengths { colors: is(COLOR), depths: is(DEPTH) });
        }
        let pose = color.with_file_name(format!("{base}.pose.txt"));
        let pose = if pose.is_file() { parse_matrix(&read_text(&pose)?) } else { None };
        frames.push(SourceFrame {
            name: base.to_owned(),
            color: color.clone(),
            depth,
            timestamp_nanos: frames.len() as u64 * 33_333_333,
            world_from_camera: pose,
        });
    }
    let known = Options {
        color_camera: Some([585.0, 585.0, 320.0, 240.0]),
        units_per_metre: Some(1000.0),
        ..Options::default()
    };
    Ok(Source { known, frames, is_stream: true, invalid_depth: Some(u16::MAX) })
}
