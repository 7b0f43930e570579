//! Dumps of libfreenect's `fakenect-record`: `INDEX.txt` lists `d-TIME-TICKS.pgm` (raw 11-bit depth), `r-TIME-TICKS.ppm`
//! (colour) and `a-TIME-TICKS.dump` (accelerometer, not used) in the order they came. Read here without the library.
//!
//! The head of a picture is one line, and depth is little-endian: neither is as PGM has it. Ticks are a 60 MHz counter
//! of 32 bits that both pictures share. Raw depth becomes millimetres by a common Kinect's constants, in the depth
//! camera's own geometry; a dump does not say which unit made it. The cameras are a common Kinect's too: 575.8 pixels for
//! depth (reference distance / two reference pixels), the colour camera of its registration table (about 528 pixels), the
//! depth camera 24 mm left of the colour camera.

use std::path::Path;

use kinect::clock::Clock;
use kinect::freenect::depth::{Constants, Mapping};
use reconstruct::image::{ColorImage, DepthImage};
use reconstruct::pose::Pose;

use super::{ImportError, Options, Source, SourceFrame, read_text, tum};
use crate::pictures::{self, MAX_SIDE, PictureError};

const INDEX: &str = "INDEX.txt";
const TICKS_PER_SECOND: u32 = 60_000_000;
/// Longest first line of a picture, bytes.
const MOST_HEAD: usize = 64;
/// The largest raw value, which means that nothing was measured.
const LARGEST_RAW: u16 = 2047;
const UNITS_PER_METRE: f64 = 1000.0;
const DEPTH_CAMERA: [f64; 4] = [575.8, 575.8, 319.5, 239.5];

/// What a line of the index names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Raw depth.
    Depth,
    /// Colour.
    Color,
    /// The accelerometer.
    Acceleration,
}

/// A line of the index.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// What the file holds.
    pub kind: Kind,
    /// Its name, which has no folder in it.
    pub name: String,
    /// When it was taken, nanoseconds on the sensor's clock.
    pub nanos: u64,
}

/// Whether the folder is such a dump.
pub(super) fn is_one(folder: &Path) -> bool {
    folder.join(INDEX).is_file()
}

/// Reads the index: one name a line, in the order of play.
pub fn parse_index(text: &str) -> Result<Vec<Entry>, ImportError> {
    let mut clock = Clock::new(TICKS_PER_SECOND);
    let mut entries = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let name = line.trim();
        if name.is_empty() {
            continue;
        }
        let (kind, ticks) = parse_name(name).ok_or_else(|| {
            let shown: String = name.chars().take(60).collect();
            ImportError::text(
                INDEX,
                i + 1,
                format!("{shown:?} is no name as d-TIME-TICKS.pgm, r-TIME-TICKS.ppm or a-TIME-TICKS.dump"),
            )
        })?;
        entries.push(Entry { kind, name: name.to_owned(), nanos: clock.nanos(ticks) });
    }
    Ok(entries)
}

fn parse_name(name: &str) -> Option<(Kind, u32)> {
    let kinds =
        [("d-", ".pgm", Kind::Depth), ("r-", ".ppm", Kind::Color), ("a-", ".dump", Kind::Acceleration)];
    let (body, kind) = kinds.iter().find_map(|&(begin, end, kind)| {
        let body = name.strip_prefix(begin)?.strip_suffix(end)?;
        Some((body, kind))
    })?;
    let (seconds, ticks) = body.split_once('-')?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit() || b == b'.');
    (is_number(seconds) && ticks.bytes().all(|b| b.is_ascii_digit())).then_some(())?;
    Some((kind, ticks.parse().ok()?))
}

/// The pixels behind a head of one line: width, height and bytes, as many as there must be.
fn parse_pixels<'a>(
    bytes: &'a [u8],
    magic: &str,
    largest: &str,
    bytes_per_pixel: usize,
) -> Result<(usize, usize, &'a [u8]), PictureError> {
    let damaged = |what: &str| PictureError::Damaged(what.to_owned());
    let end = bytes.iter().take(MOST_HEAD).position(|&b| b == b'\n').ok_or_else(|| {
        if bytes.len() < MOST_HEAD { PictureError::Truncated } else { damaged("its first line has no end") }
    })?;
    let head =
        std::str::from_utf8(&bytes[..end]).map_err(|_not_text| damaged("its first line is no text"))?;
    let words: Vec<&str> = head.split_ascii_whitespace().collect();
    let &[kind, width, height, most] = words.as_slice() else {
        return Err(damaged("its first line has not four words"));
    };
    if (kind, most) != (magic, largest) {
        return Err(PictureError::Damaged(format!(
            "it does not begin with {magic} and the largest value {largest}"
        )));
    }
    let side = |word: &str| word.parse().map_err(|_no_number| damaged("its size is no number"));
    let (width, height): (usize, usize) = (side(width)?, side(height)?);
    if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
        return Err(PictureError::Implausible { width, height });
    }
    let pixels = &bytes[end + 1..];
    match pixels.len().cmp(&(width * height * bytes_per_pixel)) {
        std::cmp::Ordering::Less => Err(PictureError::Truncated),
        std::cmp::Ordering::Equal => Ok((width, height, pixels)),
        std::cmp::Ordering::Greater => Err(damaged("there is more behind its pixels")),
    }
}

/// A colour picture of a dump.
pub fn parse_color(bytes: &[u8]) -> Result<ColorImage, PictureError> {
    let (width, height, pixels) = parse_pixels(bytes, "P6", "255", 3)?;
    Ok(ColorImage { width, height, data: pixels.as_chunks::<3>().0.to_vec() })
}

/// The raw depth of a dump: width, height and values up to 2047.
pub fn parse_depth(bytes: &[u8]) -> Result<(usize, usize, Vec<u16>), PictureError> {
    let (width, height, pixels) = parse_pixels(bytes, "P5", "65535", 2)?;
    let raw: Vec<u16> = pixels.as_chunks::<2>().0.iter().map(|&pixel| u16::from_le_bytes(pixel)).collect();
    if raw.iter().any(|&raw| raw > LARGEST_RAW) {
        return Err(PictureError::NotDepth {
            found: "values above 2047, where a dump has raw depth of 11 bits".to_owned(),
        });
    }
    Ok((width, height, raw))
}

/// A picture of a dump as PNG, depth in millimetres; `None` for files of other kinds.
pub(super) fn to_png(path: &Path, bytes: &[u8]) -> Option<Result<Vec<u8>, ImportError>> {
    let picture = |source| ImportError::Picture { path: path.to_owned(), source };
    let png = match path.extension()?.to_str()? {
        "ppm" => parse_color(bytes).map_err(picture).map(|image| pictures::encode_color(&image)),
        "pgm" => parse_depth(bytes).map_err(picture).map(|(width, height, raw)| {
            let data = mapping().millimetres(&raw);
            pictures::encode_depth(&DepthImage { width, height, data, units_per_metre: UNITS_PER_METRE })
        }),
        _ => return None,
    };
    Some(png.and_then(|png| png.map_err(ImportError::Encode)))
}

fn mapping() -> &'static Mapping {
    static MAPPING: std::sync::OnceLock<Mapping> = std::sync::OnceLock::new();
    MAPPING.get_or_init(|| Mapping::new(&Constants::default()))
}

pub(super) fn read(folder: &Path) -> Result<Source, ImportError> {
    let entries = parse_index(&read_text(&folder.join(INDEX))?)?;
    let of = |kind: Kind| -> Vec<(f64, &Entry)> {
        let entries = entries.iter().filter(|entry| entry.kind == kind);
        let mut timed: Vec<(f64, &Entry)> = entries.map(|entry| (entry.nanos as f64 * 1e-9, entry)).collect();
        timed.sort_by(|a, b| a.0.total_cmp(&b.0));
        timed
    };
    let (colors, depths) = (of(Kind::Color), of(Kind::Depth));
    let times: Vec<f64> = colors.iter().map(|(seconds, _)| *seconds).collect();
    let depth_of = tum::associate(&times, &depths);
    let mut frames = Vec::new();
    for ((_, color), depth) in colors.iter().zip(depth_of) {
        let Some(depth) = depth else { continue };
        frames.push(SourceFrame {
            name: format!("{:03}", frames.len()),
            color: folder.join(&color.name),
            depth: folder.join(&depths[depth].1.name),
            timestamp_nanos: color.nanos,
            world_from_camera: None,
        });
    }
    let common = Constants::default();
    let color_camera = common.color_camera().map(|camera| [camera.fx, camera.fy, camera.cx, camera.cy]);
    let depth_camera_x = -f64::from(common.color_camera_cm) / 100.0;
    let known = Options {
        color_camera,
        depth_camera: Some(DEPTH_CAMERA),
        color_from_depth: Some(Pose::translation(depth_camera_x, 0.0, 0.0)),
        units_per_metre: Some(UNITS_PER_METRE),
        ..Options::default()
    };
    Ok(Source { known, frames, is_stream: true, invalid_depth: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depth_file(width: usize, height: usize, raw: impl Fn(usize) -> u16) -> Vec<u8> {
        let mut bytes = format!("P5 {width} {height} 65535\n").into_bytes();
        bytes.extend((0..width * height).flat_map(|i| raw(i).to_le_bytes()));
        bytes
    }

    #[test]
    fn the_index_in_order_with_its_clock_turning_round() {
        let text = "a-1000.1-4294000000.dump\nd-1000.100000-4294000000.pgm\r\n\nr-1000.12-1032704.ppm\n";
        let entries = parse_index(text).unwrap();
        assert_eq!(
            entries.iter().map(|e| e.kind).collect::<Vec<_>>(),
            [Kind::Acceleration, Kind::Depth, Kind::Color]
        );
        assert_eq!(entries[1].name, "d-1000.100000-4294000000.pgm");
        // 2 000 000 ticks on: a thirtieth of a second.
        assert!((33_333_333..=33_333_334).contains(&(entries[2].nanos - entries[1].nanos)), "{entries:?}");
        for bad in [
            "x-1-2.pgm",
            "d-1-2.ppm",
            "d-1.pgm",
            "d-../../1-2.pgm",
            "d-1-99999999999.pgm",
            "d--2.pgm",
            "d-1-+2.pgm",
        ] {
            let error = parse_index(&format!("a-1-2.dump\n{bad}\n")).unwrap_err().to_string();
            assert!(error.contains("INDEX.txt, line 2") && error.contains(';'), "{error}");
        }
    }

    #[test]
    fn raw_depth_is_little_endian_and_becomes_millimetres() {
        let raws = [300, 500, 700, 900, 1000, 1084, 2047, 0];
        let (_, _, raw) = parse_depth(&depth_file(4, 2, |i| raws[i])).unwrap();
        assert_eq!(raw, raws);
        let millimetres = mapping().millimetres(&raw);
        // The table of drivers' own constants; what lies beyond 10 m is noise.
        assert_eq!(millimetres[..7], [437, 586, 887, 1824, 3864, 0, 0]);
    }

    #[test]
    fn colour_has_a_blank_behind_its_head() {
        let bytes = [b"P6 2 1 255 \n".as_slice(), &[1, 2, 3, 10, 20, 30]].concat();
        let image = parse_color(&bytes).unwrap();
        assert_eq!((image.width, image.data), (2, vec![[1, 2, 3], [10, 20, 30]]));
    }

    #[test]
    fn broken_pictures_are_named_as_such() {
        let good = depth_file(4, 3, |i| i as u16);
        for length in 0..good.len() {
            let error = parse_depth(&good[..length]).unwrap_err();
            assert_eq!(error, PictureError::Truncated, "{length}");
        }
        let longer = [good.as_slice(), &[0]].concat();
        assert!(matches!(parse_depth(&longer), Err(PictureError::Damaged(_))));
        assert!(matches!(parse_depth(&depth_file(4, 3, |_| 2048)), Err(PictureError::NotDepth { .. })));
        for head in ["P5 4 3 255\n", "P6 4 3 65535\n", "P5 4 3\n", "P5 -4 3 65535\n", "P5 4 x 65535\n"] {
            let bytes = [head.as_bytes(), &[0; 24]].concat();
            assert!(matches!(parse_depth(&bytes), Err(PictureError::Damaged(_))), "{head}");
        }
        let huge = b"P5 99999999 99999999 65535\n".to_vec();
        assert!(matches!(parse_depth(&huge), Err(PictureError::Implausible { .. })));
        assert!(matches!(parse_depth(&[b'P'; 200]), Err(PictureError::Damaged(_))));
    }
}
