//! A simulated scan on disk: the recording as any other, and `truth/` beside it.
//!
//! `truth/poses.json` holds `world_from_camera` of every view and, under `args`, what was simulated; `truth/mesh.ply` is the product's
//! surface in the world, metres.

use std::path::Path;

use reconstruct::board::BoardFile;
use reconstruct::mesh::Mesh;
use reconstruct::pose::to_row_major;
use reconstruct::recording::{Device, FrameEntry, Rig, ViewImages};
use serde_json::{Value, json};

use super::{SimulatedScan, timestamp};
use crate::output::OutputError;
use crate::pictures::{encode_color, encode_depth};
use crate::recording::RecordingWriter;

/// Writes `recording.json`, `board.json`, `color/`, `depth/` and `truth/` into the folder `out`.
pub fn write(scan: &SimulatedScan, out: &Path) -> Result<(), OutputError> {
    let device = Device { backend: "simulated".to_owned(), serial: format!("seed-{}", scan.spec.seed) };
    let mut recording = RecordingWriter::begin(out, &scan.rig, 1000.0, device)?;
    recording.set_mirrored(scan.spec.mirrored);
    for (index, view) in scan.views.iter().enumerate() {
        let view = if scan.spec.mirrored { mirrored(view.clone()) } else { view.clone() };
        if scan.board.is_some() {
            let times: Vec<u64> = (0..view.depths.len()).map(|k| timestamp(index, k)).collect();
            recording.add_view(&view, &times)?;
        } else {
            add_stream_frames(&mut recording, &view, index)?;
        }
    }
    if let Some(board) = &scan.board {
        recording.write_board(&BoardFile::Known(board.clone()))?;
    }
    recording.write_json("truth/poses.json", &poses(scan))?;
    recording.write("truth/mesh.ply", &ply(&scan.truth.mesh))?;
    recording.finish()
}

fn mirrored(view: ViewImages) -> ViewImages {
    let depths = view.depths.into_iter().map(reconstruct::image::DepthImage::mirrored).collect();
    ViewImages { color: view.color.mirrored(), depths, ..view }
}

/// A stream has single frames, each a view of its own.
fn add_stream_frames(out: &mut RecordingWriter, view: &ViewImages, index: usize) -> Result<(), OutputError> {
    let encoded = |bytes: Result<Vec<u8>, png::EncodingError>| {
        bytes.map_err(|e| OutputError::Io { path: "the recording".into(), source: std::io::Error::other(e) })
    };
    let color = out.add_color("png", &encoded(encode_color(&view.color))?)?;
    for depth in &view.depths {
        let depth = out.add_depth(&encoded(encode_depth(depth))?)?;
        out.push_stream_frame(FrameEntry {
            color: color.clone(),
            depth,
            timestamp_nanos: timestamp(index, 0),
        });
    }
    Ok(())
}

fn poses(scan: &SimulatedScan) -> Value {
    let view = |(view, pose): (&ViewImages, &reconstruct::pose::Pose)| json!({"view": view.name, "world_from_camera": to_row_major(pose)});
    let views: Vec<Value> = scan.views.iter().zip(&scan.truth.world_from_camera).map(view).collect();
    let spec = &scan.spec;
    let family = scan.board.as_ref().map(|b| b.family.name());
    let moved = scan.truth.knocked.map_or(-1, |view| view as i64);
    json!({
        "views": views,
        "args": {
            "product": spec.product.name(), "pose": spec.rest, "seed": spec.seed, "views": spec.views, "frames": spec.frames,
            "noise": spec.noise, "warp": spec.warp_px, "scale_bias": spec.scale_error, "family": family,
            "hide_board": spec.hide_board, "elevation": spec.elevations_deg, "distance": spec.distances_m,
            "unregistered": spec.unregistered, "mirrored": spec.mirrored,
            "stream": scan.board.is_none(), "no_board": scan.board.is_none(), "moved": moved,
        },
        "rig": rig(&scan.rig),
    })
}

fn rig(rig: &Rig) -> Value {
    json!({"color": rig.color, "depth": rig.depth, "color_from_depth": to_row_major(&rig.color_from_depth)})
}

/// A mesh as binary PLY: metres, colours at the vertices.
fn ply(mesh: &Mesh) -> Vec<u8> {
    let (points, triangles) = (&mesh.vertices.points, &mesh.triangles);
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nelement face {}\n\
         property list uchar uint vertex_indices\nend_header\n",
        points.len(),
        triangles.len()
    )
    .into_bytes();
    for (point, color) in points.iter().zip(&mesh.vertices.colors) {
        bytes.extend(point.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(color);
    }
    for triangle in triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|i| i.to_le_bytes()));
    }
    bytes
}
