//! Plain folders of pairs: `NAME_rgb.png` with `NAME_depth.png`, or a folder of colour and one of depth pictures.
//! The cameras come from the command line.

use std::path::{Path, PathBuf};

use super::folder::{pictures, stem, sub_folder};
use super::trajectory::parse_log;
use super::{ImportError, Options, Source, SourceFrame, read_text};

const COLOR_ENDINGS: [&str; 6] = ["_rgb", "_color", "-rgb", "-color", ".rgb", ".color"];
const DEPTH_ENDINGS: [&str; 3] = ["_depth", "-depth", ".depth"];
const COLOR_FOLDERS: [&str; 6] = ["color", "rgb", "colour", "image", "images", "gray"];
const LOGS: [&str; 2] = ["trajectory.log", "odometry.log"];

/// Whether pairs can be expected here.
pub(super) fn is_one(folder: &Path) -> bool {
    let folder = base(folder);
    let two_folders =
        sub_folder(&folder, &COLOR_FOLDERS).is_some() && sub_folder(&folder, &["depth"]).is_some();
    two_folders
        || pictures(&folder).is_ok_and(|paths| paths.iter().any(|p| name_of(p, &DEPTH_ENDINGS).is_some()))
}

/// The folder itself, or its one sub-folder that holds the pictures.
fn base(folder: &Path) -> PathBuf {
    let inner = folder.join("RGBD");
    if inner.is_dir() { inner } else { folder.to_owned() }
}

fn name_of(path: &Path, endings: &[&str]) -> Option<String> {
    let stem = stem(path);
    endings.iter().find_map(|ending| stem.strip_suffix(ending).map(str::to_owned))
}

pub(super) fn read(folder: &Path) -> Result<Source, ImportError> {
    let folder = base(folder);
    let two_folders = sub_folder(&folder, &COLOR_FOLDERS).zip(sub_folder(&folder, &["depth"]));
    let pairs = if let Some((colors, depths)) = two_folders {
        let named = |folder: &Path| -> Result<Named, ImportError> {
            Ok(pictures(folder)?.into_iter().map(|path| (stem(&path), path)).collect())
        };
        pair(named(&colors)?, named(&depths)?)?
    } else {
        let all = pictures(&folder)?;
        let named = |endings: &[&str]| -> Named {
            all.iter().filter_map(|path| Some((name_of(path, endings)?, path.clone()))).collect()
        };
        pair(named(&COLOR_ENDINGS), named(&DEPTH_ENDINGS))?
    };
    let log = LOGS.iter().map(|name| folder.join(name)).find(|path| path.is_file());
    let poses = log.map_or(Ok(Vec::new()), |path| parse_log(&read_text(&path)?))?;
    let frame = |(i, (name, color, depth)): (usize, (String, PathBuf, PathBuf))| SourceFrame {
        name,
        color,
        depth,
        timestamp_nanos: i as u64 * 33_333_333,
        world_from_camera: poses.iter().find(|(frame, _)| *frame == i).map(|(_, pose)| *pose),
    };
    let frames = pairs.into_iter().enumerate().map(frame).collect();
    Ok(Source { known: Options::default(), frames, is_stream: false, invalid_depth: None })
}

type Named = Vec<(String, PathBuf)>;

/// Pairs by name; where no name is shared, by order, if there are as many of both.
fn pair(colors: Named, depths: Named) -> Result<Vec<(String, PathBuf, PathBuf)>, ImportError> {
    let lengths = || ImportError::DifferentLengths { colors: colors.len(), depths: depths.len() };
    if colors.len() != depths.len() {
        return Err(lengths());
    }
    let shared = colors.iter().zip(&depths).filter(|(color, depth)| color.0 == depth.0).count();
    if shared != 0 && shared != colors.len() {
        return Err(lengths());
    }
    Ok(colors.into_iter().zip(depths).map(|((name, color), (_, depth))| (name, color, depth)).collect())
}
