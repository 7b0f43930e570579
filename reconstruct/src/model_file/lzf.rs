//! LZF decompression (Marc Lehmann's format, as PCD files use it), bounded on both sides.

/// Bytes that are copied at once.
const WORD: usize = 8;

/// Decompresses to exactly `expected` bytes; `None` where the data is damaged.
pub(super) fn decompress(input: &[u8], expected: usize) -> Option<Vec<u8>> {
    // A back reference of three bytes gives at most 264: more cannot be meant, so nothing is allocated for it.
    if expected > input.len().saturating_mul(88).saturating_add(32) {
        return None;
    }
    let mut out = vec![0u8; expected];
    let mut at = 0;
    let mut rest = input;
    while let Some(control) = take_byte(&mut rest) {
        if control < 32 {
            let (literal, after) = rest.split_at_checked(control + 1)?;
            out.get_mut(at..at + literal.len())?.copy_from_slice(literal);
            at += literal.len();
            rest = after;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += take_byte(&mut rest)?;
            }
            let distance = ((control & 0x1f) << 8) + take_byte(&mut rest)? + 1;
            let length = length + 2;
            let start = at.checked_sub(distance)?;
            if at + length > expected {
                return None;
            }
            copy_within(&mut out, start, at, length);
            at += length;
        }
    }
    (at == expected).then_some(out)
}

/// Copies what may overlap what is written: first to last. Where there is room, words are copied, and what the last one writes too much is
/// written over later.
fn copy_within(out: &mut [u8], from: usize, to: usize, length: usize) {
    if to - from < WORD || to + length + WORD > out.len() {
        for i in 0..length {
            out[to + i] = out[from + i];
        }
        return;
    }
    for i in (0..length).step_by(WORD) {
        let word: [u8; WORD] = *out[from + i..].first_chunk().expect("it lies before what is written");
        out[to + i..to + i + WORD].copy_from_slice(&word);
    }
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
        // So overlaps a reference with room behind it.
        let mut packed = vec![0, b'a', 4 << 5, 0, 19];
        packed.extend([b'z'; 20]);
        assert_eq!(decompress(&packed, 27).unwrap(), [[b'a'; 7].as_slice(), &[b'z'; 20]].concat());
        // Ten letters, then what lies ten and nine before: a word at a time where there is room, and byte by byte at the end.
        let mut packed = vec![9];
        packed.extend(b"abcdefghij");
        packed.extend([7 << 5, 4, 9, 7 << 5, 2, 8]);
        let mut plain = b"abcdefghij".to_vec();
        (0..13).for_each(|_| plain.push(plain[plain.len() - 10]));
        (0..11).for_each(|_| plain.push(plain[plain.len() - 9]));
        assert_eq!(decompress(&packed, plain.len()).unwrap(), plain);
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
