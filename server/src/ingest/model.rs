//! A model file: known by its content, read under limits, turned into the viewer's stream.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use axum::http::StatusCode;
use reconstruct::mesh::Mesh;
use reconstruct::model_file::{self, Kind};
use reconstruct::stream;

use super::picture::Pictures;
use crate::config::Limits;
use crate::error::{Error, Result};
use crate::model::{ModelInfo, ModelKind};

/// First bytes by which a format is known.
const START_BYTES: u64 = 512;
const HEADER_BYTES: usize = 1 << 20;
const FORMATS: &str = "Send a model as .asc (text), .ply or .glb.";

/// What a model file gives.
pub(super) struct ModelRead {
    pub(super) info: ModelInfo,
    /// The sender's name with the ending of what it really is.
    pub(super) name: String,
    pub(super) stream: Vec<u8>,
    /// A picture of the model, where one was asked for.
    pub(super) pictures: Option<Pictures>,
}

/// Reads, checks, converts.
pub(super) fn read(path: &Path, name: &str, with_picture: bool, limits: &Limits) -> Result<ModelRead> {
    let kind = kind_of(path)?;
    let reader_limits = model_file::Limits {
        max_points: limits.points,
        max_triangles: limits.triangles,
        max_line_bytes: limits.line_bytes,
        max_header_bytes: HEADER_BYTES,
        max_bytes: usize::try_from(limits.model_bytes).unwrap_or(usize::MAX),
    };
    let bad = |what: String| Error::unprocessable("bad_model", format!("The model cannot be used: {what}."));
    let mesh = model_file::read(kind, BufReader::new(File::open(path)?), &reader_limits)
        .map_err(|error| bad(error.to_string().trim_end_matches('.').to_string()))?;
    let stream = stream::encode(&mesh).map_err(|error| bad(error.to_string()))?;
    let pictures = with_picture.then(|| super::picture::of_model(&mesh)).transpose()?;
    Ok(ModelRead { info: info_of(&mesh)?, name: name_with_ending(name, kind), stream, pictures })
}

fn kind_of(path: &Path) -> Result<Kind> {
    let mut start = Vec::new();
    File::open(path)?.take(START_BYTES).read_to_end(&mut start)?;
    let refuse =
        |detail: String| Err(Error::refuse(StatusCode::UNSUPPORTED_MEDIA_TYPE, "not_a_model", detail));
    if start.starts_with(&[0x1f, 0x8b]) || start.starts_with(b"PK\x03\x04") || start.starts_with(b"BZh") {
        return refuse(format!("The file is packed; unpack it first. {FORMATS}"));
    }
    match Kind::sniff(&start) {
        Some(kind @ (Kind::Asc | Kind::Ply | Kind::Glb)) => Ok(kind),
        Some(Kind::Pcd) => {
            let detail = "PCD is not taken here; convert it with `scan-product import` first.";
            refuse(format!("{detail} {FORMATS}"))
        }
        None => refuse(format!("The content is no model that is known here. {FORMATS}")),
    }
}

fn info_of(mesh: &Mesh) -> Result<ModelInfo> {
    let (min, max) =
        mesh.vertices.bounds().ok_or_else(|| Error::internal("a model without points was encoded"))?;
    Ok(ModelInfo {
        kind: if mesh.triangles.is_empty() { ModelKind::Points } else { ModelKind::Mesh },
        points: mesh.vertices.len() as u64,
        triangles: mesh.triangles.len() as u64,
        min,
        max,
    })
}

fn name_with_ending(name: &str, kind: Kind) -> String {
    if Kind::from_name(name) == Some(kind) {
        name.to_string()
    } else {
        format!("{name}.{}", kind.extension())
    }
}
