//! Tag detection on the peers' pictures: 640x480, six tags of 4 cm at 0.5 to 1 m, blurred and noisy, corners known.

use std::path::Path;

use anyhow::Context;
use nalgebra::Point2;
use reconstruct::board::Family;
use reconstruct::image::GrayImage;
use reconstruct::marker::{DetectConfig, Detection, Dictionary, detect};

use crate::clock::{Bench, Times};
use crate::reference::quantile;

/// A picture and the corners of the tags in it.
struct Picture {
    image: GrayImage,
    truth: Vec<(u32, [Point2<f64>; 4])>,
}

pub(crate) fn run(bench: &Bench) -> anyhow::Result<()> {
    for (name, family, folder) in [
        ("ARUCO 4x4_50", Family::Aruco4x4_50, "tags/aruco_4x4_50"),
        ("AprilTag 36h11", Family::Tag36h11, "tags/tag36h11"),
    ] {
        let folder = bench.data.join(folder);
        if bench.wants(name) && folder.is_dir() {
            measure(bench, &format!("{name} detect"), family, &pictures(&folder)?);
        }
    }
    Ok(())
}

/// `NNN.pgm` and `NNN.txt` (id, then x and y of four corners a line).
fn pictures(folder: &Path) -> anyhow::Result<Vec<Picture>> {
    let mut pictures = Vec::new();
    for k in 0.. {
        let Ok(bytes) = std::fs::read(folder.join(format!("{k:03}.pgm"))) else { break };
        let text = std::fs::read_to_string(folder.join(format!("{k:03}.txt")))?;
        let truth = text.lines().map(tag).collect::<anyhow::Result<_>>()?;
        pictures.push(Picture { image: gray(&bytes)?, truth });
    }
    anyhow::ensure!(!pictures.is_empty(), "no pictures in {}", folder.display());
    Ok(pictures)
}

/// A binary PGM of 640 x 480.
fn gray(bytes: &[u8]) -> anyhow::Result<GrayImage> {
    let (width, height) = (640, 480);
    let start = bytes.len().checked_sub(width * height).context("the picture is too short")?;
    Ok(GrayImage { width, height, data: bytes[start..].to_vec() })
}

fn tag(line: &str) -> anyhow::Result<(u32, [Point2<f64>; 4])> {
    let numbers: Vec<f64> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
    anyhow::ensure!(numbers.len() == 9, "a tag is an id and four corners");
    let corners = std::array::from_fn(|k| Point2::new(numbers[1 + 2 * k], numbers[2 + 2 * k]));
    Ok((numbers[0] as u32, corners))
}

fn measure(bench: &Bench, stage: &str, family: Family, pictures: &[Picture]) {
    let (dictionary, config) = (Dictionary::of(family), DetectConfig::default());
    let mut times = Times::default();
    let (mut found, mut wrong, mut errors) = (0, 0, Vec::new());
    let _warm = detect(&pictures[0].image, dictionary, None, &config);
    for picture in pictures {
        let tags = times.add(|| detect(&picture.image, dictionary, None, &config));
        for tag in tags {
            match picture.truth.iter().find(|(id, _)| *id == tag.id) {
                Some((_, corners)) => {
                    found += 1;
                    errors.extend(corner_errors(&tag, corners));
                }
                None => wrong += 1,
            }
        }
    }
    let all: usize = pictures.iter().map(|p| p.truth.len()).sum();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt();
    bench.print(
        stage,
        &times,
        &format!(
            "found={found}/{all} fp={wrong} corner_rms={rms:.3}px med={:.3} p95={:.3}",
            quantile(errors.clone(), 0.5),
            quantile(errors, 0.95)
        ),
    );
}

/// To the nearest true corner, as the peers are judged.
fn corner_errors(tag: &Detection, truth: &[Point2<f64>; 4]) -> [f64; 4] {
    tag.corners.map(|c| truth.iter().map(|t| (c - t).norm()).fold(f64::INFINITY, f64::min))
}
