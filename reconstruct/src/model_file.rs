//! Model files: ASC, PLY, PCD and GLB, read with limits and written.
//!
//! In memory everything is in metres, in the world frame with z up. ASC holds millimetres; GLB is y up, and
//! [`glb`] is the one place that turns. Readers take bytes from anywhere: they allocate by what they have read, never by
//! what a header announces, and every refusal says what to change.

pub mod asc;
pub mod glb;
pub mod pcd;
pub mod ply;

mod decimal;
mod error;
mod lines;
mod lzf;
#[cfg(test)]
mod round_trip;

use std::io::BufRead;
use std::path::Path;

pub use error::ModelError;

use crate::mesh::Mesh;

/// Farthest coordinate that is read, metres: farther is another unit or damage, and its square must stay finite.
pub const MAX_COORDINATE_METRES: f32 = 1.0e6;

/// Bounds on what is read from outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Most points or vertices.
    pub max_points: usize,
    /// Most triangles.
    pub max_triangles: usize,
    /// Longest line or single value of a text file, bytes.
    pub max_line_bytes: usize,
    /// Longest PLY or PCD header, or GLB description, bytes.
    pub max_header_bytes: usize,
    /// Largest file where it must be held in memory (GLB, compressed PCD), bytes.
    pub max_bytes: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_points: 10_000_000,
            max_triangles: 20_000_000,
            max_line_bytes: 1024,
            max_header_bytes: 1 << 20,
            max_bytes: 512 << 20,
        }
    }
}

/// The formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Text, a point a line, millimetres.
    Asc,
    /// Stanford polygon file, ascii or binary.
    Ply,
    /// Point Cloud Library's file, ascii, binary or compressed.
    Pcd,
    /// glTF 2.0 in one binary file.
    Glb,
}

impl Kind {
    /// By the name's extension: `asc`, `xyz`, `txt`, `ply`, `pcd`, `glb`, in any case.
    pub fn from_name(name: &str) -> Option<Self> {
        let extension = Path::new(name).extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "asc" | "xyz" | "txt" => Some(Self::Asc),
            "ply" => Some(Self::Ply),
            "pcd" => Some(Self::Pcd),
            "glb" => Some(Self::Glb),
            _ => None,
        }
    }

    /// By the first bytes (some hundred are enough); `None` where they look like none of the formats.
    pub fn sniff(start: &[u8]) -> Option<Self> {
        if start.starts_with(b"ply\n") || start.starts_with(b"ply\r") {
            return Some(Self::Ply);
        }
        if start.starts_with(b"glTF") {
            return Some(Self::Glb);
        }
        if pcd::looks_like(start) {
            return Some(Self::Pcd);
        }
        asc::looks_like(start).then_some(Self::Asc)
    }

    /// The extension, as in `model.asc`.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Asc => "asc",
            Self::Ply => "ply",
            Self::Pcd => "pcd",
            Self::Glb => "glb",
        }
    }
}

/// Reads a model of the named kind: metres, z up. Textures of GLB files are left aside; see [`glb::read_with_textures`].
pub fn read(kind: Kind, reader: impl BufRead, limits: &Limits) -> Result<Mesh, ModelError> {
    match kind {
        Kind::Asc => asc::read(reader, limits).map(Mesh::of_points),
        Kind::Ply => ply::read(reader, limits),
        Kind::Pcd => pcd::read(reader, limits).map(Mesh::of_points),
        Kind::Glb => glb::read(reader, limits),
    }
}

/// Refuses a coordinate that is not a number or absurdly far, by the point's number from 1.
fn checked_point(point: [f32; 3], number: usize) -> Result<[f32; 3], ModelError> {
    if point.iter().all(|v| v.abs() <= MAX_COORDINATE_METRES) {
        Ok(point)
    } else {
        Err(ModelError::BadCoordinate { number, point })
    }
}

/// Unit normals, or none at all where one of them has no direction: an attribute is whole or absent.
fn unit_normals(mut normals: Vec<[f32; 3]>) -> Vec<[f32; 3]> {
    for normal in &mut normals {
        let length = normal.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
        if !(1e-9..1e9).contains(&length) {
            return Vec::new();
        }
        *normal = normal.map(|v| (f64::from(v) / length) as f32);
    }
    normals
}

/// Refuses triangles that name vertices which do not exist.
fn check_indices(triangles: &[[u32; 3]], vertices: usize) -> Result<(), ModelError> {
    match triangles.iter().flatten().find(|&&i| i as usize >= vertices) {
        Some(&index) => Err(ModelError::BadIndex { index: u64::from(index), vertices }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_known_by_name_and_by_content() {
        assert_eq!(Kind::from_name("a/Model.ASC"), Some(Kind::Asc));
        assert_eq!(Kind::from_name("model.obj"), None);
        assert_eq!(Kind::sniff(b"ply\nformat"), Some(Kind::Ply));
        assert_eq!(Kind::sniff(b"glTF\x02\0\0\0"), Some(Kind::Glb));
        assert_eq!(Kind::sniff(b"# .PCD v0.7 - Point Cloud"), Some(Kind::Pcd));
        assert_eq!(Kind::sniff(b"VERSION .7\nFIELDS x y z"), Some(Kind::Pcd));
        assert_eq!(Kind::sniff(b"# points\n1.0 2.0 3.0 0 0 0\n"), Some(Kind::Asc));
        assert_eq!(Kind::sniff(b"<html>"), None);
        assert_eq!(Kind::sniff(b""), None);
    }

    #[test]
    fn normals_are_all_of_unit_length_or_absent() {
        assert_eq!(unit_normals(vec![[0.0, 3.0, 0.0]]), [[0.0, 1.0, 0.0]]);
        assert!(unit_normals(vec![[0.0, 1.0, 0.0], [0.0; 3]]).is_empty());
        assert!(unit_normals(vec![[f32::NAN, 1.0, 0.0]]).is_empty());
    }
}
