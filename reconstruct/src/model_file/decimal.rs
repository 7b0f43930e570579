//! Plain decimal numbers as point files are full of: digits, a point, digits. Whatever needs more thought is left to the
//! standard library.

/// Powers of ten that double precision holds exactly.
const POWERS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
/// Most digits: their integer is below 2^53.
const DIGITS: usize = 15;

/// The number a text begins with and its length; `None` for anything that is not plain, or longer than 15 digits.
///
/// Exact: an integer and a power of ten that are both held exactly have a correctly rounded quotient (Clinger 1990).
#[inline]
pub(super) fn leading(text: &[u8]) -> Option<(f64, usize)> {
    let negative = text.first() == Some(&b'-');
    let start = usize::from(negative);
    let (mut mantissa, mut at) = (0u64, start);
    let mut digits = |at: &mut usize| {
        while let Some(digit) = text.get(*at).map(|b| b.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
            *at += 1;
        }
    };
    digits(&mut at);
    let (mut count, mut decimals) = (at - start, 0);
    if text.get(at) == Some(&b'.') {
        let point = at + 1;
        at = point;
        digits(&mut at);
        decimals = at - point;
        count += decimals;
    }
    let plain = (1..=DIGITS).contains(&count)
        && !text.get(at).is_some_and(|b| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'+' | b'-' | b'_'));
    if !plain {
        return None;
    }
    let size = mantissa as f64 / POWERS[decimals];
    Some((if negative { -size } else { size }, at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_the_standard_library(text in "-?[0-9]{0,17}[.]?[0-9]{0,9}(e[0-9])?") {
            let expected = text.parse::<f64>().ok();
            if let Some((value, length)) = leading(text.as_bytes()) {
                prop_assert_eq!(length, text.len());
                prop_assert_eq!(Some(value.to_bits()), expected.map(f64::to_bits));
            }
        }

        #[test]
        fn plain_decimals_are_never_left_to_others(whole in 0u32..1_000_000, rest in 0u32..1_000_000) {
            let text = format!("-{whole}.{rest:06} 7");
            let (value, length) = leading(text.as_bytes()).unwrap();
            prop_assert_eq!(value, text[..length].parse::<f64>().unwrap());
            prop_assert_eq!(length, text.len() - 2);
        }
    }

    #[test]
    fn what_is_not_plain_is_refused() {
        for text in ["", "-", ".", "+1", "1e3", "nan", "inf", "1.2.3", "1-2", "1234567890123456", "0x1"] {
            assert_eq!(leading(text.as_bytes()), None, "{text}");
        }
    }
}
