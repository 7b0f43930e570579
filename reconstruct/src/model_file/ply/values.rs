//! Values of a PLY body, one after the other, as text or as bytes of either order.

use std::io::BufRead;

use super::FORMAT;
use super::header::Scalar;
use crate::model_file::ModelError;
use crate::model_file::lines::{Tokens, number};

/// A stream of scalars. `f64` holds every value of every type exactly.
pub(super) trait Values {
    fn scalar(&mut self, scalar: Scalar, reading: &'static str) -> Result<f64, ModelError>;

    fn skip(&mut self, scalar: Scalar, count: u64, reading: &'static str) -> Result<(), ModelError>;
}

pub(super) struct Ascii<R>(Tokens<R>);

impl<R: BufRead> Ascii<R> {
    pub(super) fn new(reader: R, most: usize) -> Self {
        Self(Tokens::new(reader, most))
    }
}

impl<R: BufRead> Values for Ascii<R> {
    fn scalar(&mut self, _: Scalar, reading: &'static str) -> Result<f64, ModelError> {
        let (token, line) = self.0.next(reading)?;
        number(FORMAT, token, line)
    }

    fn skip(&mut self, _: Scalar, count: u64, reading: &'static str) -> Result<(), ModelError> {
        (0..count).try_for_each(|_| self.0.next(reading).map(|_| ()))
    }
}

pub(super) struct Binary<R> {
    reader: R,
    big_endian: bool,
}

impl<R: BufRead> Binary<R> {
    pub(super) fn new(reader: R, big_endian: bool) -> Self {
        Self { reader, big_endian }
    }

    /// The next bytes, the least significant first.
    #[inline(always)]
    fn bytes<const N: usize>(&mut self, reading: &'static str) -> Result<[u8; N], ModelError> {
        let ready = self.reader.fill_buf().ok().and_then(|buffered| buffered.first_chunk().copied());
        let mut bytes = ready.unwrap_or([0; N]);
        match ready {
            Some(_) => self.reader.consume(N),
            // Across the buffer's end, or what went wrong.
            None => self.reader.read_exact(&mut bytes).map_err(|e| ModelError::reading(e, reading))?,
        }
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }
}

impl<R: BufRead> Values for Binary<R> {
    #[inline(always)]
    fn scalar(&mut self, scalar: Scalar, reading: &'static str) -> Result<f64, ModelError> {
        Ok(match scalar {
            Scalar::I8 => f64::from(i8::from_le_bytes(self.bytes(reading)?)),
            Scalar::U8 => f64::from(u8::from_le_bytes(self.bytes(reading)?)),
            Scalar::I16 => f64::from(i16::from_le_bytes(self.bytes(reading)?)),
            Scalar::U16 => f64::from(u16::from_le_bytes(self.bytes(reading)?)),
            Scalar::I32 => f64::from(i32::from_le_bytes(self.bytes(reading)?)),
            Scalar::U32 => f64::from(u32::from_le_bytes(self.bytes(reading)?)),
            Scalar::F32 => f64::from(f32::from_le_bytes(self.bytes(reading)?)),
            Scalar::F64 => f64::from_le_bytes(self.bytes(reading)?),
        })
    }

    fn skip(&mut self, scalar: Scalar, count: u64, reading: &'static str) -> Result<(), ModelError> {
        let bytes = count * scalar.bytes() as u64;
        let mut limited = std::io::Read::take(&mut self.reader, bytes);
        let skipped = std::io::copy(&mut limited, &mut std::io::sink()).map_err(ModelError::Io)?;
        if skipped == bytes { Ok(()) } else { Err(ModelError::Truncated { reading }) }
    }
}
