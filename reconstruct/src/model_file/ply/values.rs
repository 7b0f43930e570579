//! Values of a PLY body, one after the other, as text or as bytes of either order.

use std::io::{BufRead, Read};

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

impl<R: Read> Binary<R> {
    pub(super) fn new(reader: R, big_endian: bool) -> Self {
        Self { reader, big_endian }
    }
}

impl<R: Read> Values for Binary<R> {
    fn scalar(&mut self, scalar: Scalar, reading: &'static str) -> Result<f64, ModelError> {
        // Least significant byte first, filled up with zeros.
        let mut bytes = [0; 8];
        let used = &mut bytes[..scalar.bytes()];
        self.reader.read_exact(used).map_err(|e| ModelError::reading(e, reading))?;
        if self.big_endian {
            used.reverse();
        }
        let whole = u64::from_le_bytes(bytes);
        Ok(match scalar {
            Scalar::I8 => f64::from(whole as i8),
            Scalar::U8 => f64::from(whole as u8),
            Scalar::I16 => f64::from(whole as i16),
            Scalar::U16 => f64::from(whole as u16),
            Scalar::I32 => f64::from(whole as i32),
            Scalar::U32 => f64::from(whole as u32),
            Scalar::F32 => f64::from(f32::from_bits(whole as u32)),
            Scalar::F64 => f64::from_bits(whole),
        })
    }

    fn skip(&mut self, scalar: Scalar, count: u64, reading: &'static str) -> Result<(), ModelError> {
        let bytes = count * scalar.bytes() as u64;
        let mut limited = (&mut self.reader).take(bytes);
        let skipped = std::io::copy(&mut limited, &mut std::io::sink()).map_err(ModelError::Io)?;
        if skipped == bytes { Ok(()) } else { Err(ModelError::Truncated { reading }) }
    }
}
