//! One record of the container.

use std::io::{self, Write};

/// "NIR" backwards, as every record begins.
const MAGIC: u32 = 0x0052_494E;

/// Kinds of records.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Type {
    IntProperty = 0x03,
    GeneralProperty = 0x06,
    NodeRemoved = 0x07,
    NodeDataBegin = 0x08,
    NodeStateReady = 0x09,
    NewData = 0x0A,
    End = 0x0B,
    NodeAdded = 0x0D,
    SeekTable = 0x0E,
}

/// Header and fields of a record being put together.
#[derive(Debug)]
pub(crate) struct Record {
    bytes: Vec<u8>,
}

impl Record {
    /// `undo` is the place of the record that this one follows on, 0 for none.
    pub(crate) fn new(kind: Type, node: u32, undo: u64) -> Self {
        // The two zeros are the sizes of the fields and of the payload, known when it is written.
        let header = [MAGIC, kind as u32, node, 0, 0];
        let bytes = header.iter().flat_map(|v| v.to_le_bytes()).collect();
        Self { bytes }.u64(undo)
    }

    pub(crate) fn u32(self, value: u32) -> Self {
        self.bytes(&value.to_le_bytes())
    }

    pub(crate) fn u64(self, value: u64) -> Self {
        self.bytes(&value.to_le_bytes())
    }

    /// With its length and a zero at the end.
    pub(crate) fn text(self, text: &str) -> Self {
        self.u32(text.len() as u32 + 1).bytes(text.as_bytes()).bytes(&[0])
    }

    pub(crate) fn bytes(mut self, bytes: &[u8]) -> Self {
        self.bytes.extend(bytes);
        self
    }

    pub(crate) fn write(mut self, file: &mut impl Write, payload: &[u8]) -> io::Result<()> {
        let sizes = [self.bytes.len() as u32, payload.len() as u32].map(u32::to_le_bytes).concat();
        self.bytes[12..20].copy_from_slice(&sizes);
        file.write_all(&self.bytes)?;
        file.write_all(payload)
    }
}
