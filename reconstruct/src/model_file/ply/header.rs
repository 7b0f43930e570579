//! The PLY header: which elements follow, with which properties, in which encoding.

use std::io::BufRead;

use super::FORMAT;
use crate::model_file::lines::{Lines, shown};
use crate::model_file::{Limits, ModelError};

/// Most elements or properties an element that are taken.
const MAX_ENTRIES: usize = 256;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    /// Type of the count in front of a list.
    pub(super) list: Option<Scalar>,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
}

/// Reads the header and gives back the reader where the data begin.
pub(super) fn read<R: BufRead>(reader: R, limits: &Limits) -> Result<(Header, R), ModelError> {
    let mut lines = Lines::new(reader, limits.max_line_bytes);
    let mut total = 0;
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    match lines.next()? {
        Some((_, b"ply")) => {}
        _ => return Err(wrong("it does not begin with the line \"ply\"".to_owned())),
    }
    loop {
        let Some((_, line)) = lines.next()? else {
            return Err(ModelError::Truncated { reading: "reading the header" });
        };
        total += line.len() + 1;
        ModelError::refuse_more("header bytes", total as u64, limits.max_header_bytes)?;
        let text = std::str::from_utf8(line).unwrap_or("comment");
        let words: Vec<&str> = text.split_ascii_whitespace().take(6).collect();
        match words.as_slice() {
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, "1.0"] => encoding = Some(encoding_of(name)?),
            ["element", name, count] => elements.push(element(name, count, limits, elements.len())?),
            ["property", rest @ ..] => {
                let element = elements
                    .last_mut()
                    .ok_or_else(|| wrong("a property comes before its element".to_owned()))?;
                if element.properties.len() >= MAX_ENTRIES {
                    return Err(wrong("an element has too many properties".to_owned()));
                }
                element.properties.push(property(rest, line)?);
            }
            ["end_header"] => break,
            _ => return Err(wrong(format!("{} is no header line", shown(line)))),
        }
    }
    let encoding = encoding.ok_or_else(|| wrong("the format line is missing".to_owned()))?;
    Ok((Header { encoding, elements }, lines.into_inner()))
}

fn wrong(what: String) -> ModelError {
    ModelError::Header { format: FORMAT, what }
}

fn encoding_of(name: &str) -> Result<Encoding, ModelError> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::LittleEndian),
        "binary_big_endian" => Ok(Encoding::BigEndian),
        other => Err(wrong(format!("the format {} is not known", shown(other.as_bytes())))),
    }
}

fn element(name: &str, count: &str, limits: &Limits, already: usize) -> Result<Element, ModelError> {
    if already >= MAX_ENTRIES {
        return Err(wrong("there are too many elements".to_owned()));
    }
    let count: u64 = count
        .parse()
        .map_err(|e| wrong(format!("{} is no number of rows ({e})", shown(count.as_bytes()))))?;
    match name {
        "vertex" => ModelError::refuse_more("points", count, limits.max_points)?,
        "face" => ModelError::refuse_more("triangles", count, limits.max_triangles)?,
        _ => {}
    }
    Ok(Element { name: name.to_owned(), count, properties: Vec::new() })
}

fn property(words: &[&str], line: &[u8]) -> Result<Property, ModelError> {
    let scalar = |name: &str| {
        Scalar::from_name(name)
            .ok_or_else(|| wrong(format!("the type {} is not known", shown(name.as_bytes()))))
    };
    match *words {
        ["list", count, item, name] => {
            let list = Some(scalar(count)?);
            Ok(Property { name: name.to_owned(), scalar: scalar(item)?, list })
        }
        [kind, name] => Ok(Property { name: name.to_owned(), scalar: scalar(kind)?, list: None }),
        _ => Err(wrong(format!("{} is no property", shown(line)))),
    }
}
