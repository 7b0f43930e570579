//! GLB (glTF 2.0 in one binary file), metres, **y up**: the one place that turns from and to our z up.
//!
//! Vertex colours of glTF are linear light; ours are sRGB. Written are 16-bit linear colours, so that dark tones keep
//! their steps and come back exactly.

mod accessor;
mod color;
mod document;
mod scene;
mod write;

use std::io::{BufRead, Read};

pub use write::{GENERATOR, write};

use super::{Limits, ModelError};
use crate::image::ColorImage;
use crate::mesh::Mesh;

const FORMAT: &str = "GLB";
const MAGIC: u32 = 0x4654_6c67;
const JSON_CHUNK: u32 = 0x4e4f_534a;
const BINARY_CHUNK: u32 = 0x004e_4942;

/// Reads all meshes and points of the default scene, placed by their nodes; textures are left aside.
pub fn read(reader: impl BufRead, limits: &Limits) -> Result<Mesh, ModelError> {
    read_with_textures(reader, limits, &mut |_| None)
}

/// As [`read`]; `decode` turns the bytes of a PNG or JPEG into a picture, from which vertices take their colours where
/// they have none of their own.
pub fn read_with_textures(
    reader: impl BufRead,
    limits: &Limits,
    decode: &mut dyn FnMut(&[u8]) -> Option<ColorImage>,
) -> Result<Mesh, ModelError> {
    let mut bytes = Vec::new();
    reader.take(limits.max_bytes as u64 + 1).read_to_end(&mut bytes).map_err(ModelError::Io)?;
    ModelError::refuse_more("bytes", bytes.len() as u64, limits.max_bytes)?;
    let (json, binary) = chunks(&bytes, limits)?;
    let document = document::parse(json)?;
    let mesh = scene::gather(&document, binary, limits, decode)?;
    if mesh.vertices.is_empty() { Err(ModelError::Empty) } else { Ok(mesh) }
}

/// The two chunks of the container: description and data.
fn chunks<'a>(bytes: &'a [u8], limits: &Limits) -> Result<(&'a [u8], &'a [u8]), ModelError> {
    let word = |at: usize| -> Result<u32, ModelError> {
        let four = bytes.get(at..at + 4).and_then(|four| four.try_into().ok());
        four.map(u32::from_le_bytes).ok_or(ModelError::Truncated { reading: "reading the header" })
    };
    if word(0)? != MAGIC {
        return Err(wrong("it does not begin with \"glTF\""));
    }
    if word(4)? != 2 {
        return Err(ModelError::Unsupported {
            what: format!("glTF version {}", word(4)?),
            advice: "export it as glTF 2.0 binary",
        });
    }
    let end = word(8)? as usize;
    let bytes = bytes.get(..end).ok_or(ModelError::Truncated { reading: "reading the chunks" })?;
    let chunk = |start: usize, kind: u32| -> Result<Option<&[u8]>, ModelError> {
        let Some(header) = bytes.get(start..start + 8) else { return Ok(None) };
        let length = u32::from_le_bytes([header[0], header[1], header[2], header[3]]) as usize;
        if header[4..] != kind.to_le_bytes() {
            return Ok(None);
        }
        let data = bytes.get(start + 8..).and_then(|rest| rest.get(..length));
        data.map(Some).ok_or(ModelError::Truncated { reading: "reading the chunks" })
    };
    let json = chunk(12, JSON_CHUNK)?.ok_or_else(|| wrong("the first chunk is no JSON"))?;
    ModelError::refuse_more("header bytes", json.len() as u64, limits.max_header_bytes)?;
    let binary = chunk(20 + json.len().next_multiple_of(4), BINARY_CHUNK)?.unwrap_or_default();
    Ok((json, binary))
}

fn wrong(what: &str) -> ModelError {
    ModelError::Header { format: FORMAT, what: what.to_owned() }
}

fn bad_data(what: String) -> ModelError {
    ModelError::Data { format: FORMAT, what }
}

#[cfg(test)]
mod tests;
