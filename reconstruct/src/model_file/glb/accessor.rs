//! Typed, bounds-checked access to the binary chunk.

use super::document::{Accessor, BufferView, Document};
use super::{ModelError, bad_data};

/// Component types by glTF's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_number(number: u32) -> Result<Self, ModelError> {
        Ok(match number {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            other => return Err(bad_data(format!("component type {other} does not exist"))),
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

/// An accessor whose whole range has been checked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Values<'a> {
    data: &'a [u8],
    component: Component,
    normalized: bool,
    /// Components an element.
    width: usize,
    stride: usize,
    /// Elements.
    pub(super) count: usize,
}

impl<'a> Values<'a> {
    /// Looks an accessor up and checks that all its elements lie inside the binary chunk.
    pub(super) fn open(document: &Document, binary: &'a [u8], index: usize) -> Result<Self, ModelError> {
        let accessor = item(&document.accessors, index, "accessor")?;
        if accessor.sparse.is_some() {
            return Err(ModelError::Unsupported {
                what: "a sparse accessor".to_owned(),
                advice: "export with plain vertex data",
            });
        }
        let view =
            accessor.buffer_view.ok_or_else(|| bad_data(format!("accessor {index} has no buffer view")))?;
        let (view, bytes) = view_bytes(document, binary, view)?;
        let values = Self::of_view(accessor, view, bytes)?;
        let outside = || bad_data(format!("accessor {index} reaches beyond its data"));
        let last =
            values.count.checked_sub(1).ok_or_else(|| bad_data(format!("accessor {index} is empty")))?;
        let element = values.component.bytes() * values.width;
        let end = last.checked_mul(values.stride).and_then(|v| v.checked_add(element)).ok_or_else(outside)?;
        if end > values.data.len() { Err(outside()) } else { Ok(values) }
    }

    fn of_view(accessor: &Accessor, view: &BufferView, bytes: &'a [u8]) -> Result<Self, ModelError> {
        let component = Component::from_number(accessor.component_type)?;
        let width = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => return Err(bad_data("vertex data of an unusual shape".to_owned())),
        };
        let element = component.bytes() * width;
        let stride = view.byte_stride.unwrap_or(element);
        if stride < element || stride > 252 {
            return Err(bad_data(format!("a stride of {stride} bytes")));
        }
        let data = bytes.get(accessor.byte_offset..).unwrap_or_default();
        Ok(Self { data, component, normalized: accessor.normalized, width, stride, count: accessor.count })
    }

    /// Component `k` of element `i`, from 0 to 1 (or -1 to 1) where normalised.
    pub(super) fn get(&self, i: usize, k: usize) -> f64 {
        let size = self.component.bytes();
        let start = i * self.stride + k * size;
        let mut bytes = [0; 4];
        bytes[..size].copy_from_slice(&self.data[start..start + size]);
        let whole = u32::from_le_bytes(bytes);
        let (value, most) = match self.component {
            Component::I8 => (f64::from(whole as i8), 127.0),
            Component::U8 => (f64::from(whole), 255.0),
            Component::I16 => (f64::from(whole as i16), 32_767.0),
            Component::U16 => (f64::from(whole), 65_535.0),
            Component::U32 => (f64::from(whole), f64::from(u32::MAX)),
            Component::F32 => return f64::from(f32::from_bits(whole)),
        };
        if self.normalized { (value / most).max(-1.0) } else { value }
    }

    /// Element `i` as three components.
    pub(super) fn triple(&self, i: usize) -> [f64; 3] {
        std::array::from_fn(|k| self.get(i, k))
    }

    /// Element `i` as an index; only for unsigned scalars.
    pub(super) fn index(&self, i: usize) -> u32 {
        self.get(i, 0) as u32
    }

    /// Refuses elements of fewer than `width` components.
    pub(super) fn of_width(self, width: usize) -> Result<Self, ModelError> {
        if self.width >= width {
            return Ok(self);
        }
        Err(bad_data(format!("vertex data of {} components where {width} are needed", self.width)))
    }

    /// Refuses what cannot be indices.
    pub(super) fn of_indices(self) -> Result<Self, ModelError> {
        if self.width == 1 && matches!(self.component, Component::U8 | Component::U16 | Component::U32) {
            return Ok(self);
        }
        Err(bad_data("indices that are no whole numbers".to_owned()))
    }
}

/// The entry of a list, or a refusal that names it.
pub(super) fn item<'a, T>(list: &'a [T], index: usize, name: &str) -> Result<&'a T, ModelError> {
    list.get(index).ok_or_else(|| bad_data(format!("{name} {index} does not exist")))
}

/// A buffer view and its bytes.
pub(super) fn view_bytes<'d, 'a>(
    document: &'d Document,
    binary: &'a [u8],
    index: usize,
) -> Result<(&'d BufferView, &'a [u8]), ModelError> {
    let view = item(&document.buffer_views, index, "buffer view")?;
    let buffer = item(&document.buffers, view.buffer, "buffer")?;
    if view.buffer != 0 || buffer.uri.is_some() {
        return Err(ModelError::Unsupported {
            what: "data outside of the GLB file".to_owned(),
            advice: "export everything into one .glb file",
        });
    }
    let end = view.byte_offset.checked_add(view.byte_length);
    let bytes = end.and_then(|end| binary.get(view.byte_offset..end));
    Ok((view, bytes.ok_or_else(|| bad_data(format!("buffer view {index} reaches beyond the file")))?))
}
