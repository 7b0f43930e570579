//! Writes GLB: one mesh of triangles, or of points where there are none.

use std::io::{self, Write};

use serde_json::{Value, json};

use super::color::linear_table;
use super::{BINARY_CHUNK, JSON_CHUNK, MAGIC};
use crate::mesh::{INVENTED, Mesh};
use crate::model_file::unit_normals;

/// What the file names as its maker.
pub const GENERATOR: &str = concat!("scan-product ", env!("CARGO_PKG_VERSION"));

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Writes positions, normals, colours, deviations (`_DEVIATION`, metres, negative where invented) and triangles; a mesh without vertices, or one larger than the format can hold, is
/// [`io::ErrorKind::InvalidInput`].
pub fn write(mesh: &Mesh, mut writer: impl Write) -> io::Result<()> {
    if mesh.vertices.is_empty() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "a model without points cannot be a GLB file",
        ));
    }
    let (json, binary) = parts(mesh);
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let size = |bytes: usize| {
        u32::try_from(bytes)
            .map_err(|e| io::Error::new(io::ErrorKind::InvalidInput, format!("too large for GLB: {e}")))
    };
    for word in [MAGIC, 2, size(total)?, size(json.len())?, JSON_CHUNK] {
        writer.write_all(&word.to_le_bytes())?;
    }
    writer.write_all(&json)?;
    for word in [size(binary.len())?, BINARY_CHUNK] {
        writer.write_all(&word.to_le_bytes())?;
    }
    writer.write_all(&binary)?;
    writer.flush()
}

/// glTF's y up from our z up.
fn y_up([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, z, -y]
}

/// Collects the binary chunk and its description.
#[derive(Default)]
struct Builder {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Builder {
    /// Adds a block of elements of one size, a multiple of four; returns the accessor's number.
    fn add(
        &mut self,
        bytes: impl Iterator<Item = u8>,
        count: usize,
        target: u32,
        mut accessor: Value,
    ) -> usize {
        let start = self.binary.len();
        self.binary.extend(bytes);
        let length = self.binary.len() - start;
        self.views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": length, "target": target}));
        accessor["bufferView"] = json!(self.views.len() - 1);
        accessor["count"] = json!(count);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

fn parts(mesh: &Mesh) -> (Value, Vec<u8>) {
    let vertices = &mesh.vertices;
    let count = vertices.len();
    let mut builder = Builder::default();
    let positions: Vec<[f32; 3]> = vertices.points.iter().map(|&p| y_up(p)).collect();
    let (low, high) = bounds(&positions);
    let shape = json!({"componentType": FLOAT, "type": "VEC3", "min": low, "max": high});
    let bytes = positions.as_flattened().iter().flat_map(|v| v.to_le_bytes());
    let mut attributes = json!({"POSITION": builder.add(bytes, count, ARRAY_BUFFER, shape)});
    let normals = if vertices.has_normals() { unit_normals(vertices.normals.clone()) } else { Vec::new() };
    if !normals.is_empty() {
        let shape = json!({"componentType": FLOAT, "type": "VEC3"});
        let bytes = normals.iter().flat_map(|&n| y_up(n)).flat_map(f32::to_le_bytes);
        attributes["NORMAL"] = json!(builder.add(bytes, count, ARRAY_BUFFER, shape));
    }
    if vertices.has_colors() {
        let table = linear_table();
        let shape = json!({"componentType": UNSIGNED_SHORT, "type": "VEC4", "normalized": true});
        let wide = vertices.colors.iter().flat_map(|c| {
            let [r, g, b] = c.map(|v| table[usize::from(v)]);
            [r, g, b, u16::MAX]
        });
        attributes["COLOR_0"] =
            json!(builder.add(wide.flat_map(u16::to_le_bytes), count, ARRAY_BUFFER, shape));
    }
    if mesh.has_deviations() {
        let shape = json!({"componentType": FLOAT, "type": "SCALAR"});
        let known = mesh.deviations_metres.iter().map(|&d| if d == INVENTED { -1.0 } else { d });
        let bytes = known.flat_map(f32::to_le_bytes);
        attributes["_DEVIATION"] = json!(builder.add(bytes, count, ARRAY_BUFFER, shape));
    }
    let mut primitive = json!({"attributes": attributes, "mode": 0, "material": 0});
    if !mesh.triangles.is_empty() {
        let shape = json!({"componentType": UNSIGNED_INT, "type": "SCALAR"});
        let bytes = mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes());
        primitive["indices"] =
            json!(builder.add(bytes, mesh.triangles.len() * 3, ELEMENT_ARRAY_BUFFER, shape));
        primitive["mode"] = json!(4);
    }
    let json = json!({
        "asset": {"version": "2.0", "generator": GENERATOR},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "product"}],
        "meshes": [{"primitives": [primitive]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9}, "doubleSided": true}],
        "accessors": builder.accessors,
        "bufferViews": builder.views,
        "buffers": [{"byteLength": builder.binary.len()}],
    });
    (json, builder.binary)
}

/// Lowest and highest coordinates, as doubles of exactly the stored values.
fn bounds(points: &[[f32; 3]]) -> ([f64; 3], [f64; 3]) {
    let wide = points.iter().map(|p| p.map(f64::from));
    wide.fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), p| {
        (std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k])))
    })
}
