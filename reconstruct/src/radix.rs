//! Sorting integers by some of their bits, digit by digit from the lowest: linear in their number, and stable.

/// Bits a digit: its counters stay in the first-level cache.
const DIGIT_BITS: u32 = 11;
const VALUES: usize = 1 << DIGIT_BITS;

/// Sorts by the bits `from..from + bits`; what stands in other bits keeps its order.
pub(crate) fn sort_by_bits(keys: &mut Vec<u64>, from: u32, bits: u32) {
    let digit = |first: u32| {
        let mask = (1u64 << DIGIT_BITS.min(bits.saturating_sub(first))) - 1;
        // Past the last digit the mask is empty; a shift by all 64 bits would be none at all.
        let shift = (from + first.min(bits)).min(u64::BITS - 1);
        move |key: u64| ((key >> shift) & mask) as usize & (VALUES - 1)
    };
    let mut counts = [0u32; VALUES];
    let this = digit(0);
    for &key in keys.iter() {
        counts[this(key)] += 1;
    }
    let mut other = Vec::new();
    for first in (0..bits).step_by(DIGIT_BITS as usize) {
        let (this, next) = (digit(first), digit(first + DIGIT_BITS));
        let mut places = counts;
        let mut before = 0;
        for place in &mut places {
            before += std::mem::replace(place, before);
        }
        counts = [0; VALUES];
        other.resize(keys.len(), 0);
        let out: &mut [u64] = &mut other;
        for &key in keys.iter() {
            let place = &mut places[this(key)];
            out[*place as usize] = key;
            *place += 1;
            counts[next(key)] += 1;
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

    #[test]
    fn sorts_by_the_highest_bits_and_by_none() {
        let mut keys = vec![u64::MAX, 5, 1 << 63, 7 << 40, 5];
        sort_by_bits(&mut keys, 30, 0);
        assert_eq!(keys, [u64::MAX, 5, 1 << 63, 7 << 40, 5]);
        sort_by_bits(&mut keys, 31, 33);
        assert_eq!(keys, [5, 5, 7 << 40, 1 << 63, u64::MAX]);
    }
}
