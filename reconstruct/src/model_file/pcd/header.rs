//! The PCD header: fields, how many points, in which encoding.

use std::io::BufRead;

use super::FORMAT;
use crate::model_file::lines::{Lines, shown};
use crate::model_file::{Limits, ModelError};

/// Most fields, and most values a field, that are taken.
const MAX_FIELDS: usize = 256;
const MAX_COUNT: usize = 4096;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    Float,
    Signed,
    Unsigned,
}

/// One column, or `count` columns of the same type.
#[derive(Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) number: Number,
    size: usize,
    pub(super) count: usize,
    /// Bytes of a row in front of it.
    pub(super) offset: usize,
}

impl Field {
    pub(super) fn bytes(&self) -> usize {
        self.size * self.count
    }

    pub(super) fn is_packed_color(&self) -> bool {
        matches!(self.name.as_str(), "rgb" | "rgba") && self.size == 4
    }

    /// The first value of the field at the head of `bytes`.
    #[inline(always)]
    pub(super) fn value(&self, bytes: &[u8]) -> f64 {
        match (self.number, self.size) {
            (Number::Float, 4) => f64::from(f32::from_le_bytes(first(bytes))),
            (Number::Float, _) => f64::from_le_bytes(first(bytes)),
            (Number::Unsigned, 1) => f64::from(bytes[0]),
            (Number::Unsigned, 2) => f64::from(u16::from_le_bytes(first(bytes))),
            (Number::Unsigned, 4) => f64::from(u32::from_le_bytes(first(bytes))),
            (Number::Unsigned, _) => u64::from_le_bytes(first(bytes)) as f64,
            (Number::Signed, 1) => f64::from(bytes[0] as i8),
            (Number::Signed, 2) => f64::from(i16::from_le_bytes(first(bytes))),
            (Number::Signed, 4) => f64::from(i32::from_le_bytes(first(bytes))),
            (Number::Signed, _) => i64::from_le_bytes(first(bytes)) as f64,
        }
    }
}

#[inline(always)]
pub(super) fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
    *bytes.first_chunk().expect("a row holds its fields")
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) fields: Vec<Field>,
    pub(super) points: usize,
    pub(super) row_bytes: usize,
    pub(super) encoding: Encoding,
}

impl Header {
    /// Where these fields' first values lie in a row, where all are single precision.
    pub(super) fn singles(&self, fields: [usize; 3]) -> Option<[usize; 3]> {
        let single = |i: usize| self.fields[i].number == Number::Float && self.fields[i].size == 4;
        fields.iter().all(|&i| single(i)).then(|| fields.map(|i| self.fields[i].offset))
    }
}

#[derive(Default)]
struct Said {
    names: Vec<String>,
    sizes: Vec<String>,
    types: Vec<String>,
    counts: Vec<String>,
    width: Option<u64>,
    height: Option<u64>,
    points: Option<u64>,
}

/// Reads the header and gives back the reader where the data begin.
pub(super) fn read<R: BufRead>(reader: R, limits: &Limits) -> Result<(Header, R), ModelError> {
    // Files with hundreds of fields have long lines: the header's limit is for all of it.
    let mut lines = Lines::new(reader, limits.max_header_bytes);
    let mut said = Said::default();
    let mut total = 0;
    let encoding = loop {
        let Some((_, line)) = lines.next()? else {
            return Err(ModelError::Truncated { reading: "reading the header" });
        };
        total += line.len() + 1;
        ModelError::refuse_more("header bytes", total as u64, limits.max_header_bytes)?;
        if line.is_empty() || line.starts_with(b"#") {
            continue;
        }
        let text = std::str::from_utf8(line).map_err(|e| wrong(format!("it is no text ({e})")))?;
        let (key, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let words =
            || -> Vec<String> { rest.split_whitespace().take(MAX_FIELDS + 1).map(str::to_owned).collect() };
        match key {
            "VERSION" | "VIEWPOINT" => {}
            "FIELDS" | "COLUMNS" => said.names = words(),
            "SIZE" => said.sizes = words(),
            "TYPE" => said.types = words(),
            "COUNT" => said.counts = words(),
            "WIDTH" => said.width = Some(whole(rest)?),
            "HEIGHT" => said.height = Some(whole(rest)?),
            "POINTS" => said.points = Some(whole(rest)?),
            "DATA" => break encoding_of(rest.trim())?,
            _ => return Err(wrong(format!("{} is no header line", shown(line)))),
        }
    };
    Ok((header(&said, encoding, limits)?, lines.into_inner()))
}

fn wrong(what: String) -> ModelError {
    ModelError::Header { format: FORMAT, what }
}

fn whole(text: &str) -> Result<u64, ModelError> {
    text.trim().parse().map_err(|e| wrong(format!("{} is no count ({e})", shown(text.as_bytes()))))
}

fn encoding_of(name: &str) -> Result<Encoding, ModelError> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary" => Ok(Encoding::Binary),
        "binary_compressed" => Ok(Encoding::Compressed),
        other => Err(wrong(format!("the encoding {} is not known", shown(other.as_bytes())))),
    }
}

fn header(said: &Said, encoding: Encoding, limits: &Limits) -> Result<Header, ModelError> {
    let points = point_count(said)?;
    ModelError::refuse_more("points", points, limits.max_points)?;
    let fields = fields(said)?;
    let row_bytes = fields.iter().map(Field::bytes).sum();
    Ok(Header { fields, points: points as usize, row_bytes, encoding })
}

fn point_count(said: &Said) -> Result<u64, ModelError> {
    let area = match (said.width, said.height) {
        (Some(width), height) => Some(
            width.checked_mul(height.unwrap_or(1)).ok_or_else(|| wrong("the size is absurd".to_owned()))?,
        ),
        _ => None,
    };
    match (said.points, area) {
        (Some(points), Some(area)) if points != area => {
            Err(wrong(format!("POINTS is {points}, WIDTH times HEIGHT {area}")))
        }
        (Some(points), _) | (None, Some(points)) => Ok(points),
        (None, None) => Err(wrong("the number of points is missing".to_owned())),
    }
}

fn fields(said: &Said) -> Result<Vec<Field>, ModelError> {
    let count = said.names.len();
    if count == 0 || count > MAX_FIELDS {
        return Err(wrong(format!("there are {count} fields, 3 to {MAX_FIELDS} are read")));
    }
    let lists =
        [said.sizes.len(), said.types.len(), if said.counts.is_empty() { count } else { said.counts.len() }];
    if lists.iter().any(|&length| length != count) {
        return Err(wrong("FIELDS, SIZE, TYPE and COUNT have different lengths".to_owned()));
    }
    let mut offset = 0;
    let mut fields = Vec::with_capacity(count);
    for (i, name) in said.names.iter().enumerate() {
        let number = match said.types[i].as_str() {
            "F" => Number::Float,
            "I" => Number::Signed,
            "U" => Number::Unsigned,
            other => return Err(wrong(format!("the type {} is not known", shown(other.as_bytes())))),
        };
        let size = match (said.sizes[i].as_str(), number) {
            ("1", Number::Signed | Number::Unsigned) => 1,
            ("2", Number::Signed | Number::Unsigned) => 2,
            ("4", _) => 4,
            ("8", _) => 8,
            (other, _) => {
                return Err(wrong(format!("the size {} does not fit its type", shown(other.as_bytes()))));
            }
        };
        let count = said.counts.get(i).map_or(Ok(1), |count| whole(count))?;
        if count == 0 || count > MAX_COUNT as u64 {
            return Err(wrong(format!("field {} has {count} values", shown(name.as_bytes()))));
        }
        let field = Field { name: name.clone(), number, size, count: count as usize, offset };
        offset += field.bytes();
        fields.push(field);
    }
    Ok(fields)
}
