//! Sorting integers by some of their bits, digit by digit from the lowest: linear in their number, and stable.

/// Most bits a digit: its counters stay in the first-level cache.
const DIGIT_BITS: u32 = 11;

/// Sorts by the bits `from..from + bits`; what stands in other bits keeps its order.
pub(crate) fn sort_by_bits(keys: &mut Vec<u64>, from: u32, bits: u32) {
    if keys.len() < 2 || bits == 0 {
        return;
    }
    let passes = bits.div_ceil(DIGIT_BITS);
    let digit_bits = bits.div_ceil(passes);
    let digit = |key: u64, pass: u32| {
        let width = digit_bits.min(bits - pass * digit_bits);
        ((key >> (from + pass * digit_bits)) & ((1 << width) - 1)) as usize
    };
    let mut counts = vec![0u32; passes as usize * (1 << digit_bits)];
    for key in keys.iter() {
        for (pass, counts) in (0u32..).zip(counts.chunks_exact_mut(1 << digit_bits)) {
            counts[digit(*key, pass)] += 1;
        }
    }
    let mut other = vec![0; keys.len()];
    for (pass, counts) in (0u32..).zip(counts.chunks_exact_mut(1 << digit_bits)) {
        if counts.iter().any(|&count| count as usize == keys.len()) {
            continue;
        }
        let mut next = 0;
        for count in counts.iter_mut() {
            next += std::mem::replace(count, next);
        }
        for &key in keys.iter() {
            let place = &mut counts[digit(key, pass)];
            other[*place as usize] = key;
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
