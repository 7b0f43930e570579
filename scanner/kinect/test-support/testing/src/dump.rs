//! Writes a dump for the replay library, as `fakenect-record` does.

use std::fs;
use std::io;
use std::path::Path;

use crate::scene;

/// Ticks between two images, 60 MHz.
const FRAME_TICKS: u32 = 2_000_000;
/// How far colour is behind depth: four milliseconds.
const SKEW_TICKS: u32 = 240_000;
/// Of the accelerometer, 1 g.
const COUNTS_PER_G: i16 = 819;

/// Writes `frames` pairs and the accelerometer's state into `folder`, to be played at full speed.
///
/// # Errors
/// Where they cannot be written.
pub fn write(folder: &Path, frames: u32) -> io::Result<()> {
    let mut index = String::new();
    let mut put = |name: String, bytes: Vec<u8>| -> io::Result<()> {
        index.push_str(&name);
        index.push('\n');
        fs::write(folder.join(name), bytes)
    };
    for frame in 0..frames {
        let ticks = 100_000 + frame * FRAME_TICKS;
        put(format!("a-1000.000000-{ticks}.dump"), accelerometer())?;
        let mut depth = b"P5 640 480 65535\n".to_vec();
        for value in scene::raw_depth(frame) {
            depth.extend(value.to_le_bytes());
        }
        put(format!("d-1000.000000-{ticks}.pgm"), depth)?;
        let mut picture = b"P6 640 480 255 \n".to_vec();
        picture.extend(scene::picture(frame).as_flattened());
        put(format!("r-1000.000000-{}.ppm", ticks + SKEW_TICKS), picture)?;
    }
    fs::write(folder.join("INDEX.txt"), index)
}

fn accelerometer() -> Vec<u8> {
    let mut state = vec![0u8; 12];
    state[2..4].copy_from_slice(&COUNTS_PER_G.to_le_bytes());
    state
}
