//! Whether colour and depth lie on each other: the shift at which the edges of depth meet edges of the picture best.
//!
//! Where depth jumps, one thing ends before another, and there the picture nearly always has an edge. The edge pixels of
//! depth are moved over the picture's gradient; the shift with the highest mean is the offset. Colour camera's pixels.

use kinect::source::{Frame, SensorInfo};
use reconstruct::average::{AverageConfig, average};
use reconstruct::image::GrayImage;

use super::{Finding, OFFSET_PX, finding};
use crate::capture::hints::Level;
use crate::pipeline::depth::in_color_camera;

/// Shifts that are tried, pixels each way.
const REACH: i32 = 12;
/// A step of depth over two pixels from which something ends there, as a part of the distance.
const JUMP: f32 = 0.06;
/// Stronger edges count no more than this, grey levels.
const STRONG: f32 = 60.0;
/// Fewer edge pixels say nothing.
const MIN_EDGES: usize = 300;
/// The best shift must stand out of all by so many standard deviations.
const CLEAR: f64 = 2.5;

pub(super) fn judge(sensor: &SensorInfo, frame: &Frame) -> Finding {
    let disparity =
        average(std::slice::from_ref(frame.depth.as_ref()), sensor.rig.depth.fx, &AverageConfig::default());
    let map = in_color_camera(disparity, &sensor.rig);
    let metres: Vec<f32> = (0..map.disparity_px.len()).map(|i| map.metres(i)).collect();
    let Some([du, dv]) = color_depth_offset(&frame.color.to_gray(), &metres) else {
        let text = "Whether colour and depth lie on each other cannot be seen here: put a box on the board.";
        return finding("pixel_offset", Level::Green, None, "px", text);
    };
    let pixels = du.hypot(dv);
    let text = format!("Colour and depth lie {pixels:.1} pixels apart");
    if pixels <= OFFSET_PX {
        return finding("pixel_offset", Level::Green, Some(pixels), "px", format!("{text}."));
    }
    let text = format!(
        "{text} ({du:+.1} to the right, {dv:+.1} down): colours will smear at edges. Unplug the sensor and plug it in again; \
         where that does not help, report it with the recording."
    );
    finding("pixel_offset", Level::Yellow, Some(pixels), "px", text)
}

/// How far the picture lies right of and below depth, pixels; `None` where too few edges tell.
///
/// `metres` has the picture's size, 0 where nothing was measured.
pub fn color_depth_offset(gray: &GrayImage, metres: &[f32]) -> Option<[f64; 2]> {
    let (width, height) = (gray.width, gray.height);
    if metres.len() != width * height || width < 64 || height < 64 {
        return None;
    }
    let gradient = gradient(gray);
    let edges = depth_edges(metres, width, height);
    if edges.len() < MIN_EDGES {
        return None;
    }
    let side = (2 * REACH + 1) as usize;
    let score = |du: i32, dv: i32| -> f64 {
        let at = |&(u, v): &(i32, i32)| f64::from(gradient[((v + dv) as usize) * width + (u + du) as usize]);
        edges.iter().map(at).sum::<f64>() / edges.len() as f64
    };
    let shifts = (-REACH..=REACH).flat_map(|dv| (-REACH..=REACH).map(move |du| (du, dv)));
    let scores: Vec<f64> = shifts.map(|(du, dv)| score(du, dv)).collect();
    let (best, &highest) = scores.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let mean = scores.iter().sum::<f64>() / scores.len() as f64;
    let spread = (scores.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / scores.len() as f64).sqrt();
    if highest < mean + CLEAR * spread {
        return None;
    }
    let (column, row) = (best % side, best / side);
    let along = |step: usize, position: usize| -> f64 {
        if position == 0 || position == side - 1 {
            return 0.0;
        }
        peak(scores[best - step], highest, scores[best + step])
    };
    let whole = |position: usize| position as f64 - f64::from(REACH);
    Some([whole(column) + along(1, column), whole(row) + along(side, row)])
}

/// Top of the parabola through three neighbours, -0.5 to 0.5.
fn peak(before: f64, top: f64, after: f64) -> f64 {
    let bend = before - 2.0 * top + after;
    if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Strength of the picture's edges, capped so that print does not outshout outlines.
fn gradient(gray: &GrayImage) -> Vec<f32> {
    let (width, height) = (gray.width, gray.height);
    let mut strength = vec![0.0; width * height];
    let at = |u: usize, v: usize| f32::from(gray.data[v * width + u]);
    for v in 1..height - 1 {
        for u in 1..width - 1 {
            let (gx, gy) = (at(u + 1, v) - at(u - 1, v), at(u, v + 1) - at(u, v - 1));
            strength[v * width + u] = gx.hypot(gy).min(STRONG);
        }
    }
    strength
}

/// Pixels on the near side of a jump, far enough from the border for all shifts.
fn depth_edges(metres: &[f32], width: usize, height: usize) -> Vec<(i32, i32)> {
    let border = REACH as usize + 2;
    let mut edges = Vec::new();
    for v in border..height - border {
        for u in border..width - border {
            let here = metres[v * width + u];
            let ends = |other: f32| other > 0.0 && other - here > JUMP * here;
            let around = [(u - 2, v), (u + 2, v), (u, v - 2), (u, v + 2)];
            if here > 0.0 && around.iter().any(|&(a, b)| ends(metres[b * width + a])) {
                edges.push((u as i32, v as i32));
            }
        }
    }
    edges
}
