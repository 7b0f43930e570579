//! PLY (the Stanford polygon file): points or meshes, ascii or binary of either byte order, metres.
//!
//! Any order and type of properties is read, polygons become fans of triangles, other elements are skipped.
//! Written is binary little-endian.

mod header;
mod values;

use std::io::{BufRead, Write};

use header::{Element, Encoding, Header, Property, Scalar};
use values::{Ascii, Binary, Values};

use super::{Limits, ModelError, check_indices, checked_point, unit_normals};
use crate::cloud::PointCloud;
use crate::mesh::{INVENTED, Mesh};

const FORMAT: &str = "PLY";
/// Largest polygon that is split into triangles.
const MAX_POLYGON: usize = 4096;
/// Most rows that are reserved for before the first is read.
const RESERVED_ROWS: usize = 1 << 16;

/// Reads points and faces; metres and z up are taken for granted.
pub fn read(reader: impl BufRead, limits: &Limits) -> Result<Mesh, ModelError> {
    let (header, mut reader) = header::read(reader, limits)?;
    let mesh = match header.encoding {
        Encoding::Ascii => {
            read_elements(&header, &mut Ascii::new(&mut reader, limits.max_line_bytes), limits)
        }
        Encoding::LittleEndian => read_elements(&header, &mut Binary::new(&mut reader, false), limits),
        Encoding::BigEndian => read_elements(&header, &mut Binary::new(&mut reader, true), limits),
    }?;
    if mesh.vertices.is_empty() {
        return Err(ModelError::Empty);
    }
    check_indices(&mesh.triangles, mesh.vertices.len())?;
    Ok(mesh)
}

fn read_elements(header: &Header, values: &mut impl Values, limits: &Limits) -> Result<Mesh, ModelError> {
    let mut mesh = Mesh::default();
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" if mesh.vertices.is_empty() => {
                (mesh.vertices, mesh.deviations_metres) = read_vertices(element, values)?;
            }
            "face" if mesh.triangles.is_empty() => mesh.triangles = read_faces(element, values, limits)?,
            _ => skip_element(element, values)?,
        }
    }
    Ok(mesh)
}

/// What a vertex property is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Slot {
    Position(usize),
    Normal(usize),
    Color(usize),
    Deviation,
    Other,
}

fn slot(name: &str) -> Slot {
    match name {
        "x" => Slot::Position(0),
        "y" => Slot::Position(1),
        "z" => Slot::Position(2),
        "nx" | "normal_x" => Slot::Normal(0),
        "ny" | "normal_y" => Slot::Normal(1),
        "nz" | "normal_z" => Slot::Normal(2),
        "red" | "r" | "diffuse_red" => Slot::Color(0),
        "green" | "g" | "diffuse_green" => Slot::Color(1),
        "blue" | "b" | "diffuse_blue" => Slot::Color(2),
        "deviation" => Slot::Deviation,
        _ => Slot::Other,
    }
}

/// The vertices, and their deviations where the file has them.
fn read_vertices(element: &Element, values: &mut impl Values) -> Result<(PointCloud, Vec<f32>), ModelError> {
    const READING: &str = "reading the vertices";
    let slots: Vec<Slot> = element.properties.iter().map(|property| slot(&property.name)).collect();
    let has = |slot: Slot| element.properties.iter().zip(&slots).any(|(p, s)| *s == slot && p.list.is_none());
    if !(0..3).all(|k| has(Slot::Position(k))) {
        let what = "the vertices have no x, y and z".to_owned();
        return Err(ModelError::Header { format: FORMAT, what });
    }
    let (has_normals, has_colors) =
        ((0..3).all(|k| has(Slot::Normal(k))), (0..3).all(|k| has(Slot::Color(k))));
    let has_deviations = has(Slot::Deviation);
    let mut deviations = Vec::new();
    let mut cloud = PointCloud::default();
    cloud.points.reserve(RESERVED_ROWS.min(element.count as usize));
    for row in 0..element.count {
        let (mut point, mut normal, mut color, mut deviation) = ([0.0; 3], [0.0; 3], [0; 3], 0.0);
        for (property, slot) in element.properties.iter().zip(&slots) {
            if property.list.is_some() {
                skip_property(property, values, READING)?;
                continue;
            }
            let value = values.scalar(property.scalar, READING)?;
            match *slot {
                Slot::Position(k) => point[k] = value as f32,
                Slot::Normal(k) => normal[k] = value as f32,
                Slot::Color(k) => color[k] = color_of(value, property.scalar),
                Slot::Deviation => deviation = value as f32,
                Slot::Other => {}
            }
        }
        cloud.points.push(checked_point(point, row as usize + 1)?);
        if has_normals {
            cloud.normals.push(normal);
        }
        if has_colors {
            cloud.colors.push(color);
        }
        if has_deviations {
            deviations.push(if deviation < 0.0 { INVENTED } else { deviation });
        }
    }
    if deviations.iter().any(|d| d.is_nan()) {
        deviations.clear();
    }
    cloud.normals = unit_normals(cloud.normals);
    Ok((cloud, deviations))
}

/// Real colours run from 0 to 1, 16-bit ones to 65535, all others to 255.
fn color_of(value: f64, scalar: Scalar) -> u8 {
    let scaled = match scalar {
        Scalar::F32 | Scalar::F64 => value * 255.0,
        Scalar::U16 => value / 257.0,
        _ => value,
    };
    scaled.round().clamp(0.0, 255.0) as u8
}

fn read_faces(
    element: &Element,
    values: &mut impl Values,
    limits: &Limits,
) -> Result<Vec<[u32; 3]>, ModelError> {
    const READING: &str = "reading the faces";
    let is_indices =
        |p: &Property| p.list.is_some() && matches!(p.name.as_str(), "vertex_indices" | "vertex_index");
    let mut triangles = Vec::with_capacity(RESERVED_ROWS.min(element.count as usize));
    let mut polygon = Vec::new();
    for _ in 0..if element.properties.is_empty() { 0 } else { element.count } {
        for property in &element.properties {
            if !is_indices(property) {
                skip_property(property, values, READING)?;
                continue;
            }
            read_polygon(property, values, &mut polygon)?;
            let count = triangles.len() + polygon.len().saturating_sub(2);
            ModelError::refuse_more("triangles", count as u64, limits.max_triangles)?;
            for i in 2..polygon.len() {
                triangles.push([polygon[0], polygon[i - 1], polygon[i]]);
            }
        }
    }
    Ok(triangles)
}

fn read_polygon(
    property: &Property,
    values: &mut impl Values,
    polygon: &mut Vec<u32>,
) -> Result<(), ModelError> {
    const READING: &str = "reading the faces";
    let corners = list_length(property, values, READING)?;
    if corners > MAX_POLYGON as u64 {
        let what = format!("a face of {corners} corners");
        return Err(ModelError::Data { format: FORMAT, what });
    }
    polygon.clear();
    for _ in 0..corners {
        let index = values.scalar(property.scalar, READING)?;
        if !(0.0..f64::from(u32::MAX)).contains(&index) {
            return Err(ModelError::Data { format: FORMAT, what: format!("a face names vertex {index}") });
        }
        polygon.push(index as u32);
    }
    Ok(())
}

fn list_length(
    property: &Property,
    values: &mut impl Values,
    reading: &'static str,
) -> Result<u64, ModelError> {
    let Some(count) = property.list else { return Ok(1) };
    let length = values.scalar(count, reading)?;
    if (0.0..=f64::from(u32::MAX)).contains(&length) {
        return Ok(length as u64);
    }
    Err(ModelError::Data { format: FORMAT, what: format!("a list of {length} values") })
}

fn skip_property(
    property: &Property,
    values: &mut impl Values,
    reading: &'static str,
) -> Result<(), ModelError> {
    let count = list_length(property, values, reading)?;
    values.skip(property.scalar, count, reading)
}

fn skip_element(element: &Element, values: &mut impl Values) -> Result<(), ModelError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for _ in 0..element.count {
        for property in &element.properties {
            skip_property(property, values, "skipping other elements")?;
        }
    }
    Ok(())
}

/// Writes binary little-endian: position, normal, colour and deviation (metres; negative where the vertex was invented)
/// where there are such, faces where there are any.
pub fn write(mesh: &Mesh, mut writer: impl Write) -> std::io::Result<()> {
    let vertices = &mesh.vertices;
    let (normals, colors) = (vertices.has_normals(), vertices.has_colors());
    writer.write_all(header_text(mesh).as_bytes())?;
    let deviations = mesh.has_deviations();
    let mut row = Vec::with_capacity(31);
    for (i, point) in vertices.points.iter().enumerate() {
        row.clear();
        row.extend(point.iter().flat_map(|v| v.to_le_bytes()));
        if normals {
            row.extend(vertices.normals[i].iter().flat_map(|v| v.to_le_bytes()));
        }
        if colors {
            row.extend(vertices.colors[i]);
        }
        if deviations {
            let deviation = mesh.deviations_metres[i];
            row.extend(if deviation == INVENTED { -1.0 } else { deviation }.to_le_bytes());
        }
        writer.write_all(&row)?;
    }
    for triangle in &mesh.triangles {
        row.clear();
        row.push(3);
        row.extend(triangle.iter().flat_map(|index| index.to_le_bytes()));
        writer.write_all(&row)?;
    }
    writer.flush()
}

fn header_text(mesh: &Mesh) -> String {
    let mut lines = vec![
        "ply".to_owned(),
        "format binary_little_endian 1.0".to_owned(),
        "comment metres, z up".to_owned(),
        format!("element vertex {}", mesh.vertices.len()),
    ];
    let mut properties = |kind: &str, names: [&str; 3]| {
        lines.extend(names.iter().map(|name| format!("property {kind} {name}")));
    };
    properties("float", ["x", "y", "z"]);
    if mesh.vertices.has_normals() {
        properties("float", ["nx", "ny", "nz"]);
    }
    if mesh.vertices.has_colors() {
        properties("uchar", ["red", "green", "blue"]);
    }
    if mesh.has_deviations() {
        lines.push("property float deviation".to_owned());
    }
    if !mesh.triangles.is_empty() {
        lines.push(format!("element face {}", mesh.triangles.len()));
        lines.push("property list uchar int vertex_indices".to_owned());
    }
    lines.push("end_header\n".to_owned());
    lines.join("\n")
}

#[cfg(test)]
mod tests;
