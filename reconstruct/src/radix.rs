//! Sorting integers by some of their bits, digit by digit from the lowest: linear in their number, and stable.

/// Bits a digit: its counters stay in the first-level cache.
const DIGIT_BITS: u32 = 11;
const VALUES: usize = 1 << DIGIT_BITS;

/// Sorts by the bits `from..from + bits`; what stands in other bits keeps its order.
pub(crate) fn sort_by_bits(keys: &mut Vec<u64>, from: u32, bits: u32) {
    let mut other = Vec::new();
    for first in (0..bits).step_by(DIGIT_BITS as usize) {
        let mask = (1u64 << DIGIT_BITS.min(bits - first)) - 1;
        let shift = from + first;
        let digit = |key: u64| ((key >> shift) & mask) as usize & (VALUES - 1);
        let mut places = [0u32; VALUES];
        for &key in keys.iter() {
            places[digit(key)] += 1;
        }
        if places.iter().any(|&count| count as usize == keys.len()) {
            continue;
        }
        let mut next = 0;
        for place in &mut places {
            next += std::mem::replace(place, next);
        }
        other.resize(keys.len(), 0);
        let out: &mut [u64] = &mut other;
        for &key in keys.iter() {
            let place = &mut places[digit(key)];
            out[*place as usize] = key;
            *place += 1;
        }
        std::mem::swap(keys, &mut other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_a_stable_sort(mut keys in prop::collection::vec(any::<u64>(), 0..300), from in 0u32..30, bits in 0u32..34) {
            let digit = |key: &u64| (key >> from) & ((1 << bits) - 1);
            let mut expected = keys.clone();
            expected.sort_by_key(digit);
            sort_by_bits(&mut keys, from, bits);
            prop_assert_eq!(keys, expected);
        }
    }
}
