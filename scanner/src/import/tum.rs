//! TUM RGB-D benchmark folders: `rgb.txt` and `depth.txt` list pictures with times, depth in 1/5000 m and registered to
//! colour, `groundtruth.txt` the camera's poses (Sturm et al. 2012).

use std::path::Path;

use super::trajectory::{content, parse_tum};
use super::{ImportError, Options, Source, SourceFrame, read_text};

/// Farthest in time that a depth picture or a pose belongs to a colour picture, seconds.
const MAX_GAP_SECONDS: f64 = 0.02;

/// `timestamp filename` a line: seconds and path, by time.
pub fn parse_list(file: &'static str, text: &str) -> Result<Vec<(f64, String)>, ImportError> {
    let mut list = Vec::new();
    for (line, content) in content(text) {
        let entry = content.split_once(char::is_whitespace).and_then(|(time, path)| {
            let seconds = time.parse::<f64>().ok().filter(|t| (0.0..1e10).contains(t))?;
            Some((seconds, path.trim().to_owned()))
        });
        let entry =
            entry.ok_or_else(|| ImportError::text(file, line, "expected a time in seconds and a path"))?;
        let stays_inside =
            Path::new(&entry.1).components().all(|c| matches!(c, std::path::Component::Normal(_)));
        if !stays_inside {
            return Err(ImportError::text(file, line, "the path leaves the folder"));
        }
        list.push(entry);
    }
    list.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(list)
}

/// For every time of `times` the entry of `others` (sorted) nearest in time, each entry used once at most.
pub fn associate<T>(times: &[f64], others: &[(f64, T)]) -> Vec<Option<usize>> {
    let mut used = vec![false; others.len()];
    let mut nearest = |time: f64| {
        let after = others.partition_point(|(t, _)| *t < time);
        let candidates = after.saturating_sub(2)..(after + 2).min(others.len());
        let near = candidates.filter(|&i| !used[i] && (others[i].0 - time).abs() <= MAX_GAP_SECONDS);
        let found =
            near.min_by(|&a, &b| (others[a].0 - time).abs().total_cmp(&(others[b].0 - time).abs()))?;
        used[found] = true;
        Some(found)
    };
    times.iter().map(|&time| nearest(time)).collect()
}

pub(super) fn read(folder: &Path) -> Result<Source, ImportError> {
    let colors = parse_list("rgb.txt", &read_text(&folder.join("rgb.txt"))?)?;
    let depths = parse_list("depth.txt", &read_text(&folder.join("depth.txt"))?)?;
    let truth = folder.join("groundtruth.txt");
    let mut poses = if truth.is_file() { parse_tum(&read_text(&truth)?)? } else { Vec::new() };
    poses.sort_by(|a, b| a.0.total_cmp(&b.0));
    let times: Vec<f64> = colors.iter().map(|(time, _)| *time).collect();
    let (depth_of, pose_of) = (associate(&times, &depths), associate(&times, &poses));
    let mut frames = Vec::new();
    for (i, (seconds, color)) in colors.iter().enumerate() {
        let Some(depth) = depth_of[i] else { continue };
        frames.push(SourceFrame {
            name: format!("{:03}", frames.len()),
            color: folder.join(color),
            depth: folder.join(&depths[depth].1),
            timestamp_nanos: (seconds * 1e9) as u64,
            world_from_camera: pose_of[i].map(|pose| poses[pose].1),
        });
    }
    Ok(Source { known: known(folder), frames, is_stream: true, invalid_depth: None })
}

/// The cameras as the benchmark's pages give them, by the sequence's name; the makers' own default otherwise.
fn known(folder: &Path) -> Options {
    let name =
        folder.canonicalize().unwrap_or_else(|_absent| folder.to_owned()).to_string_lossy().into_owned();
    let (camera, distortion) = if name.contains("freiburg1") {
        ([517.3, 516.5, 318.6, 255.3], [0.2624, -0.9531, -0.0054, 0.0026, 1.1633])
    } else if name.contains("freiburg2") {
        ([520.9, 521.0, 325.1, 249.7], [0.2312, -0.7849, -0.0033, -0.0001, 0.9172])
    } else if name.contains("freiburg3") {
        ([535.4, 539.2, 320.1, 247.6], [0.0; 5])
    } else {
        ([525.0, 525.0, 319.5, 239.5], [0.0; 5])
    };
    Options {
        color_camera: Some(camera),
        color_distortion: Some(distortion),
        units_per_metre: Some(5000.0),
        ..Options::default()
    }
}
