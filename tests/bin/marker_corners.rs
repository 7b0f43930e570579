//! `marker-corners RECORDING…`: corner errors of our detector against the truth beside simulated recordings, a line a
//! picture and one a recording, in the form of `compare/markers.py`.

use std::path::Path;

use nalgebra::Vector2;
use tests::corners::{KnownTruth, PictureCorners, median, median_length, rms};

fn main() {
    let folders: Vec<String> = std::env::args().skip(1).collect();
    if folders.is_empty() {
        println!("usage: marker-corners RECORDING…  (recordings with board.json and truth/poses.json)");
        std::process::exit(2);
    }
    println!("{:<34} {:>7} {:>8} {:>8} {:>9} {:>6}", "ours", "found", "median", "rms", "bias x,y", "ms");
    for folder in &folders {
        let Some(truth) = KnownTruth::open(Path::new(folder)) else {
            println!("{folder}: no known board or no truth");
            continue;
        };
        let views: Vec<PictureCorners> =
            (0..truth.world_from_camera.len()).map(|v| truth.measure(v)).collect();
        for view in &views {
            line(
                &format!("  {}", view.name),
                view.errors.len() / 4,
                view.in_picture,
                &view.errors,
                view.milliseconds,
            );
            if !view.wrong_ids.is_empty() {
                println!("    wrong ids: {:?}", view.wrong_ids);
            }
        }
        let all: Vec<Vector2<f64>> = views.iter().flat_map(|v| v.errors.iter().copied()).collect();
        let name = Path::new(folder).file_name().map_or(folder.clone(), |n| n.to_string_lossy().into_owned());
        let in_picture = views.iter().map(|v| v.in_picture).sum();
        line(&name, all.len() / 4, in_picture, &all, median(views.iter().map(|v| v.milliseconds).collect()));
    }
}

fn line(name: &str, found: usize, in_picture: usize, errors: &[Vector2<f64>], milliseconds: f64) {
    let mean = errors.iter().sum::<Vector2<f64>>() / errors.len().max(1) as f64;
    println!(
        "{name:<34} {found:>3}/{in_picture:<3} {:>8.3} {:>8.3} {:>+5.2},{:>+5.2} {milliseconds:>5.1}",
        median_length(errors),
        rms(errors),
        mean.x,
        mean.y,
    );
}
