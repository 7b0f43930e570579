//! LZF decompression (Marc Lehmann's format, as PCD files use it), bounded on both sides.

/// Decompresses to exactly `expected` bytes; `None` where the data is damaged.
pub(super) fn decompress(input: &[u8], expected: usize) -> Option<Vec<u8>> {
    // A back reference of three bytes gives at most 264: more cannot be meant, so nothing is allocated for it.
    if expected > input.len().saturating_mul(88).saturating_add(32) {
        return None;
    }
    let mut out: Vec<u8> = Vec::with_capacity(expected);
    let mut rest = input;
    while let Some(control) = take_byte(&mut rest) {
        if control < 32 {
            let (literal, after) = rest.split_at_checked(control + 1)?;
            if out.len() + literal.len() > expected {
                return None;
            }
            out.extend_from_slice(literal);
            rest = after;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += take_byte(&mut rest)?;
            }
            let distance = ((control & 0x1f) << 8) + take_byte(&mut rest)? + 1;
            let length = length + 2;
            let start = out.len().checked_sub(distance)?;
            if out.len() + length > expected {
                return None;
            }
            // Byte by byte: the reference may overlap what it writes.
            for i in start..start + length {
                out.push(out[i]);
            }
        }
    }
    (out.len() == expected).then_some(out)
}

fn take_byte(rest: &mut &[u8]) -> Option<usize> {
    let (&first, after) = rest.split_first()?;
    *rest = after;
    Some(usize::from(first))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_and_overlapping_references() {
        assert_eq!(decompress(&[2, b'a', b'b', b'c'], 3).unwrap(), b"abc");
        assert_eq!(decompress(&[0, b'a', 4 << 5, 0], 7).unwrap(), b"aaaaaaa");
        assert_eq!(decompress(&[1, b'a', b'b', 7 << 5, 3, 1], 14).unwrap(), b"ababababababab");
    }

    #[test]
    fn damage_is_noticed() {
        for (input, expected) in [
            (&[5, b'a'][..], 6),
            (&[0, b'a', 1 << 5, 9], 4),
            (&[0, b'a', 7 << 5], 4),
            (&[0, b'a'], 2),
            (&[1, b'a', b'b'], 1),
            (&[0, b'a'], usize::MAX),
        ] {
            assert_eq!(decompress(input, expected), None, "{input:?}");
        }
    }
}
