//! Writes what a build gives: model, poster and report, all or nothing.

use std::io;
use std::path::Path;

use reconstruct::mesh::Mesh;
use reconstruct::model_file::{asc, glb, ply};
use reconstruct::poster::{self, PosterConfig};
use serde::Serialize;

use crate::output::{OutputDir, OutputError};
use crate::pictures;

/// Names of all files a build may write; older ones of these names go away with a new result.
pub const FILES: [&str; 5] = ["model.asc", "model.ply", "model.glb", "poster.png", "report.json"];

/// Most bytes of a poster: it is the first picture a buyer sees.
pub const POSTER_BYTES: usize = 100_000;

/// Writes the files of a built model into `out`; with an empty mesh only the report.
pub fn write(out: &Path, mesh: &Mesh, report: &impl Serialize) -> Result<(), OutputError> {
    write_beside(out, mesh, report)?.commit()
}

/// As [`write()`], but `out` stays as it is until what this returns is committed.
pub fn write_beside(out: &Path, mesh: &Mesh, report: &impl Serialize) -> Result<OutputDir, OutputError> {
    let dir = OutputDir::begin(out, &FILES)?;
    if !mesh.vertices.is_empty() {
        write_model(&dir, mesh)?;
    }
    dir.write_with("report.json", |file| {
        serde_json::to_writer_pretty(&mut *file, report)?;
        io::Write::write_all(file, b"\n")
    })?;
    Ok(dir)
}

/// Writes a model's files and its poster, all at the same time.
fn write_model(dir: &OutputDir, mesh: &Mesh) -> Result<(), OutputError> {
    let ((poster, asc), (ply, glb)) = rayon::join(
        || rayon::join(|| write_poster(dir, mesh), || write_asc(dir, mesh)),
        || rayon::join(|| write_ply(dir, mesh), || write_glb(dir, mesh)),
    );
    asc.and(ply).and(glb).and(poster)
}

fn write_asc(dir: &OutputDir, mesh: &Mesh) -> Result<(), OutputError> {
    dir.write_with("model.asc", |file| asc::write(&mesh.measured(), file))
}

fn write_ply(dir: &OutputDir, mesh: &Mesh) -> Result<(), OutputError> {
    dir.write_with("model.ply", |file| ply::write(mesh, file))
}

fn write_glb(dir: &OutputDir, mesh: &Mesh) -> Result<(), OutputError> {
    dir.write_with("model.glb", |file| glb::write(mesh, file))
}

fn write_poster(dir: &OutputDir, mesh: &Mesh) -> Result<(), OutputError> {
    let picture = poster::draw(mesh, &PosterConfig::facing(mesh));
    dir.write_with("poster.png", |file| {
        let bytes = pictures::encode_small(&picture, POSTER_BYTES).map_err(io::Error::other)?;
        io::Write::write_all(file, &bytes)
    })
}
