//! PCD (the Point Cloud Library's file): ascii, binary or compressed, metres. Points without a place (NaN, as organised
//! clouds have them) are left out.

mod header;

use std::fmt::Write as _;
use std::io::{BufRead, Read, Write};

use header::{Encoding, Field, Header, Number, first};

use super::lines::{Tokens, number};
use super::{Limits, MAX_COORDINATE_METRES, ModelError, checked_point, lzf, unit_normals};
use crate::cloud::PointCloud;

const FORMAT: &str = "PCD";
const READING: &str = "reading the points";
/// Bytes of a row that is nothing but a place.
const PLACE_BYTES: usize = 12;
/// Most bytes of compressed points that are reserved for before the first is read.
const RESERVED_BYTES: usize = 1 << 22;
/// Bytes of rows that are read at once.
const CHUNK_BYTES: usize = 1 << 16;

/// Whether the first lines are a PCD header's.
pub(super) fn looks_like(start: &[u8]) -> bool {
    let lines = start.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
    let mut said = lines.filter(|line| !line.is_empty()).take(4);
    said.any(|line| {
        line.starts_with(b"# .PCD") || line.starts_with(b"FIELDS ") || line.starts_with(b"VERSION .")
    })
}

/// Reads points with colours and normals where the file has them.
pub fn read(reader: impl BufRead, limits: &Limits) -> Result<PointCloud, ModelError> {
    let (header, reader) = header::read(reader, limits)?;
    let mut rows = Rows::new(&header)?;
    match header.encoding {
        Encoding::Ascii => read_ascii(&header, reader, &mut rows, limits)?,
        Encoding::Binary => read_binary(&header, reader, &mut rows)?,
        Encoding::Compressed => read_compressed(&header, reader, &mut rows, limits)?,
    }
    rows.finish()
}

/// What is gathered of the rows.
struct Rows {
    /// Field numbers of x, y, z.
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    color: Option<usize>,
    cloud: PointCloud,
    row: usize,
}

impl Rows {
    fn new(header: &Header) -> Result<Self, ModelError> {
        let find = |names: [&str; 3]| -> Option<[usize; 3]> {
            let mut found = [0; 3];
            for (found, name) in found.iter_mut().zip(names) {
                *found = header.fields.iter().position(|field| field.name == name)?;
            }
            Some(found)
        };
        let no_position =
            || ModelError::Header { format: FORMAT, what: "there are no fields x, y and z".to_owned() };
        Ok(Self {
            position: find(["x", "y", "z"]).ok_or_else(no_position)?,
            normal: find(["normal_x", "normal_y", "normal_z"]),
            color: header.fields.iter().position(Field::is_packed_color),
            cloud: PointCloud::default(),
            row: 0,
        })
    }

    /// Takes one row; `value(field)` is the first value of a field, `bits(field)` its four bytes as they are.
    fn take(&mut self, value: impl Fn(usize) -> f64, bits: impl Fn(usize) -> u32) -> Result<(), ModelError> {
        self.row += 1;
        let point = self.position.map(|field| value(field) as f32);
        if point.iter().any(|v| v.is_nan()) {
            return Ok(());
        }
        self.cloud.points.push(checked_point(point, self.row)?);
        if let Some(normal) = self.normal {
            self.cloud.normals.push(normal.map(|field| value(field) as f32));
        }
        if let Some(field) = self.color {
            let [blue, green, red, _] = bits(field).to_le_bytes();
            self.cloud.colors.push([red, green, blue]);
        }
        Ok(())
    }

    /// Takes rows that are nothing but a place, if all are good ones; says whether it did.
    fn take_all(&mut self, rows: &[u8]) -> bool {
        let before = self.cloud.len();
        let rows = rows.as_chunks::<PLACE_BYTES>().0;
        self.cloud.points.extend(rows.iter().map(|row| {
            let single = |k: usize| f32::from_le_bytes([row[k], row[k + 1], row[k + 2], row[k + 3]]);
            [single(0), single(4), single(8)]
        }));
        let values = self.cloud.points[before..].as_flattened();
        let good = values.iter().filter(|v| v.abs() <= MAX_COORDINATE_METRES).count();
        if good < values.len() {
            self.cloud.points.truncate(before);
            return false;
        }
        self.row += rows.len();
        true
    }

    /// Takes rows of which only the place is wanted, in single precision at these offsets.
    fn take_places<'a>(
        &mut self,
        rows: impl Iterator<Item = &'a [u8]>,
        offsets: [usize; 3],
    ) -> Result<(), ModelError> {
        for row in rows {
            self.row += 1;
            let point = offsets.map(|at| f32::from_bits(first_four(&row[at..])));
            if !point.iter().any(|v| v.is_nan()) {
                self.cloud.points.push(checked_point(point, self.row)?);
            }
        }
        Ok(())
    }

    /// Takes columns of single precision, and of packed colours where there are such.
    fn take_columns(&mut self, places: [&[u8]; 3], colors: Option<&[u8]>) -> Result<(), ModelError> {
        let [x, y, z] = places.map(|column| column.as_chunks::<4>().0);
        for (((row, x), y), z) in (0..).zip(x).zip(y).zip(z) {
            let point = [*x, *y, *z].map(f32::from_le_bytes);
            if point.iter().any(|v| v.is_nan()) {
                continue;
            }
            self.cloud.points.push(checked_point(point, row + 1)?);
            if let Some(colors) = colors {
                let [blue, green, red, _] = first(&colors[4 * row..]);
                self.cloud.colors.push([red, green, blue]);
            }
        }
        Ok(())
    }

    fn finish(mut self) -> Result<PointCloud, ModelError> {
        if self.cloud.is_empty() {
            return Err(ModelError::Empty);
        }
        self.cloud.normals = unit_normals(self.cloud.normals);
        Ok(self.cloud)
    }
}

fn read_ascii(
    header: &Header,
    reader: impl BufRead,
    rows: &mut Rows,
    limits: &Limits,
) -> Result<(), ModelError> {
    let mut tokens = Tokens::new(reader, limits.max_line_bytes);
    let mut values = vec![0.0; header.fields.len()];
    let mut bits = vec![0; header.fields.len()];
    for _ in 0..header.points {
        for (i, field) in header.fields.iter().enumerate() {
            for k in 0..field.count {
                let (token, line) = tokens.next(READING)?;
                if k > 0 {
                    continue;
                }
                let value = number(FORMAT, token, line)?;
                values[i] = value;
                bits[i] = if field.number == Number::Float {
                    (value as f32).to_bits()
                } else {
                    value as i64 as u32
                };
            }
        }
        rows.take(|field| values[field], |field| bits[field])?;
    }
    Ok(())
}

fn read_binary(header: &Header, mut reader: impl Read, rows: &mut Rows) -> Result<(), ModelError> {
    let most = (CHUNK_BYTES / header.row_bytes.max(1)).clamp(1, header.points.max(1));
    let mut chunk = vec![0; most * header.row_bytes];
    let singles = header.singles(rows.position);
    let mut left = header.points;
    while left > 0 {
        let count = left.min(most);
        let bytes = &mut chunk[..count * header.row_bytes];
        reader.read_exact(bytes).map_err(|e| ModelError::reading(e, READING))?;
        match singles {
            Some([0, 4, 8]) if header.row_bytes == PLACE_BYTES && rows.take_all(bytes) => {}
            Some(offsets) if rows.normal.is_none() && rows.color.is_none() => {
                rows.take_places(bytes.chunks_exact(header.row_bytes), offsets)?;
            }
            _ => {
                for row in bytes.chunks_exact(header.row_bytes) {
                    let at = |field: usize| &row[header.fields[field].offset..];
                    rows.take(|field| header.fields[field].value(at(field)), |field| first_four(at(field)))?;
                }
            }
        }
        left -= count;
    }
    Ok(())
}

fn first_four(bytes: &[u8]) -> u32 {
    u32::from_le_bytes(first(bytes))
}

/// Compressed data hold all values of the first field, then all of the second, and so on.
fn read_compressed(
    header: &Header,
    mut reader: impl Read,
    rows: &mut Rows,
    limits: &Limits,
) -> Result<(), ModelError> {
    let mut sizes = [0; 8];
    reader.read_exact(&mut sizes).map_err(|e| ModelError::reading(e, READING))?;
    let size = |at: usize| u32::from_le_bytes(std::array::from_fn(|k| sizes[at + k])) as usize;
    let (compressed, plain) = (size(0), size(4));
    if plain != header.points * header.row_bytes {
        let what = format!("{plain} bytes are announced for {} points", header.points);
        return Err(ModelError::Data { format: FORMAT, what });
    }
    ModelError::refuse_more("bytes", plain.max(compressed) as u64, limits.max_bytes)?;
    let mut packed = Vec::with_capacity(compressed.min(RESERVED_BYTES));
    reader.take(compressed as u64).read_to_end(&mut packed).map_err(ModelError::Io)?;
    if packed.len() < compressed {
        return Err(ModelError::Truncated { reading: READING });
    }
    let damaged =
        || ModelError::Data { format: FORMAT, what: "the compressed points are damaged".to_owned() };
    let data = lzf::decompress(&packed, plain).ok_or_else(damaged)?;
    rows.cloud.points.reserve(header.points);
    let column = |field: usize| {
        let field = &header.fields[field];
        &data[field.offset * header.points..][..field.bytes() * header.points]
    };
    let narrow = |field: usize| header.fields[field].bytes() == 4;
    let all_narrow = rows.color.is_none_or(narrow) && rows.position.into_iter().all(narrow);
    if all_narrow && header.singles(rows.position).is_some() && rows.normal.is_none() {
        return rows.take_columns(rows.position.map(column), rows.color.map(column));
    }
    for row in 0..header.points {
        let at = |field: usize| &column(field)[row * header.fields[field].bytes()..];
        rows.take(|field| header.fields[field].value(at(field)), |field| first_four(at(field)))?;
    }
    Ok(())
}

/// Writes binary points with normals and packed colours where there are such.
pub fn write(cloud: &PointCloud, mut writer: impl Write) -> std::io::Result<()> {
    writer.write_all(header_text(cloud).as_bytes())?;
    let (normals, colors) = (cloud.has_normals(), cloud.has_colors());
    let mut row = Vec::with_capacity(28);
    for (i, point) in cloud.points.iter().enumerate() {
        row.clear();
        row.extend(point.iter().flat_map(|v| v.to_le_bytes()));
        if normals {
            row.extend(cloud.normals[i].iter().flat_map(|v| v.to_le_bytes()));
        }
        if colors {
            let [red, green, blue] = cloud.colors[i];
            row.extend([blue, green, red, 255]);
        }
        writer.write_all(&row)?;
    }
    writer.flush()
}

fn header_text(cloud: &PointCloud) -> String {
    let mut fields = vec![("x", 'F'), ("y", 'F'), ("z", 'F')];
    if cloud.has_normals() {
        fields.extend([("normal_x", 'F'), ("normal_y", 'F'), ("normal_z", 'F')]);
    }
    if cloud.has_colors() {
        fields.push(("rgba", 'U'));
    }
    let mut text = String::from("# .PCD v0.7 - metres, z up\nVERSION 0.7\n");
    let mut line = |key: &str, values: Vec<String>| {
        writeln!(text, "{key} {}", values.join(" ")).expect("a string takes everything");
    };
    line("FIELDS", fields.iter().map(|(name, _)| (*name).to_owned()).collect());
    line("SIZE", vec!["4".to_owned(); fields.len()]);
    line("TYPE", fields.iter().map(|(_, kind)| kind.to_string()).collect());
    line("COUNT", vec!["1".to_owned(); fields.len()]);
    line("WIDTH", vec![cloud.len().to_string()]);
    line("HEIGHT", vec!["1".to_owned()]);
    line("VIEWPOINT", vec!["0 0 0 1 0 0 0".to_owned()]);
    line("POINTS", vec![cloud.len().to_string()]);
    line("DATA", vec!["binary".to_owned()]);
    text
}

#[cfg(test)]
mod tests;
