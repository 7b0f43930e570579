//! Text with limits: lines and blank-separated values of bounded length, counted for messages.

use std::io::{BufRead, ErrorKind, Read};

use super::{ModelError, decimal};

/// Reads lines without their end: in place where the reader's buffer holds them whole, else in one that is used again.
pub(super) struct Lines<R> {
    reader: R,
    buffer: Vec<u8>,
    most: usize,
    number: usize,
    /// Bytes of the reader's buffer that were given out.
    shown: usize,
}

impl<R: BufRead> Lines<R> {
    pub(super) fn new(reader: R, most: usize) -> Self {
        Self { reader, buffer: Vec::new(), most, number: 0, shown: 0 }
    }

    /// The next line and its number from 1; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<(usize, &[u8])>, ModelError> {
        self.reader.consume(std::mem::take(&mut self.shown));
        match self.reader.fill_buf() {
            Ok(available) => {
                let window = &available[..available.len().min(self.most)];
                if let Some(length) = memchr::memchr(b'\n', window) {
                    self.number += 1;
                    self.shown = length + 1;
                    let line = &self.reader.fill_buf().map_err(ModelError::Io)?[..length];
                    return Ok(Some((self.number, line.trim_ascii())));
                }
            }
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) => return Err(ModelError::Io(e)),
        }
        self.next_copied()
    }

    fn next_copied(&mut self) -> Result<Option<(usize, &[u8])>, ModelError> {
        self.buffer.clear();
        let mut limited = (&mut self.reader).take(self.most as u64 + 1);
        let count = limited.read_until(b'\n', &mut self.buffer).map_err(ModelError::Io)?;
        if count == 0 {
            return Ok(None);
        }
        self.number += 1;
        if self.buffer.len() > self.most {
            return Err(ModelError::LineTooLong { line: self.number, most: self.most });
        }
        Ok(Some((self.number, self.buffer.trim_ascii())))
    }

    pub(super) fn into_inner(mut self) -> R {
        self.reader.consume(std::mem::take(&mut self.shown));
        self.reader
    }
}

/// Reads values between blanks, wherever the lines end.
pub(super) struct Tokens<R> {
    reader: R,
    buffer: Vec<u8>,
    most: usize,
    line: usize,
}

impl<R: BufRead> Tokens<R> {
    pub(super) fn new(reader: R, most: usize) -> Self {
        Self { reader, buffer: Vec::new(), most, line: 1 }
    }

    /// The next value as text, and the data line it stands on.
    pub(super) fn next(&mut self, reading: &'static str) -> Result<(&str, usize), ModelError> {
        self.buffer.clear();
        loop {
            let available = match self.reader.fill_buf() {
                Ok(available) => available,
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(e) => return Err(ModelError::Io(e)),
            };
            if available.is_empty() {
                if self.buffer.is_empty() {
                    return Err(ModelError::Truncated { reading });
                }
                break;
            }
            let mut start = 0;
            if self.buffer.is_empty() {
                let blank = available.iter().take_while(|b| b.is_ascii_whitespace()).count();
                self.line += available[..blank].split(|&b| b == b'\n').count() - 1;
                start = blank;
            }
            let length = available[start..].iter().take_while(|b| !b.is_ascii_whitespace()).count();
            let ended = start + length < available.len();
            if self.buffer.len() + length > self.most {
                return Err(ModelError::LineTooLong { line: self.line, most: self.most });
            }
            self.buffer.extend_from_slice(&available[start..start + length]);
            self.reader.consume(start + length);
            if ended && !self.buffer.is_empty() {
                break;
            }
        }
        Ok((std::str::from_utf8(&self.buffer).unwrap_or("\u{fffd}"), self.line))
    }
}

/// The number a value of text stands for.
pub(super) fn number(format: &'static str, token: &str, line: usize) -> Result<f64, ModelError> {
    if let Some((value, length)) = decimal::leading(token.as_bytes())
        && length == token.len()
    {
        return Ok(value);
    }
    let what = |e| format!("{} on data line {line} is not a number ({e})", shown(token.as_bytes()));
    token.parse().map_err(|e: std::num::ParseFloatError| ModelError::Data { format, what: what(e) })
}

/// At most 40 characters of what was read, for a message.
pub(super) fn shown(bytes: &[u8]) -> String {
    let text: String = String::from_utf8_lossy(bytes).chars().take(40).collect();
    format!("{text:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_across_buffers_and_lines() {
        let text = std::io::BufReader::with_capacity(3, &b"  12.5\n-3\r\n\n nan"[..]);
        let mut tokens = Tokens::new(text, 8);
        assert_eq!(tokens.next("x").unwrap(), ("12.5", 1));
        assert_eq!(tokens.next("x").unwrap(), ("-3", 2));
        assert_eq!(tokens.next("x").unwrap(), ("nan", 4));
        assert!(matches!(tokens.next("x"), Err(ModelError::Truncated { .. })));
    }

    #[test]
    fn endless_lines_are_refused() {
        let mut lines = Lines::new(&b"short\nmuch too long"[..], 6);
        assert_eq!(lines.next().unwrap(), Some((1, &b"short"[..])));
        assert!(matches!(lines.next(), Err(ModelError::LineTooLong { line: 2, most: 6 })));
        assert!(matches!(Tokens::new(&b"123456789"[..], 8).next("x"), Err(ModelError::LineTooLong { .. })));
    }
}
