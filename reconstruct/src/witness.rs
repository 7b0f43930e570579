//! Which other views a view is compared with, in the order in which they were taken: all of a few, and of many an even choice, so that
//! the work grows with the views and not with their square.

/// A view is compared with about so many others at most.
const MOST: usize = 16;

/// Whether views `i` and `j` of `count` are compared; the same for both.
pub(crate) fn are_compared(i: usize, j: usize, count: usize) -> bool {
    let apart = i.abs_diff(j).min(count - i.abs_diff(j));
    apart > 0 && (apart - 1).is_multiple_of((count - 1).div_ceil(MOST))
}

/// The views that view `i` of `count` is compared with.
pub(crate) fn witnesses(i: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..count).filter(move |&j| are_compared(i, j, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_of_a_few_and_as_many_of_a_multitude() {
        for count in [1, 2, 8, 17] {
            assert!((0..count).all(|i| witnesses(i, count).count() == count - 1), "{count}");
        }
        for count in [18, 30, 60, 61, 720] {
            let counts: Vec<usize> = (0..count).map(|i| witnesses(i, count).count()).collect();
            assert!(counts.iter().all(|n| (8..=17).contains(n)), "{count}: {counts:?}");
        }
    }

    #[test]
    fn both_views_say_the_same_and_neighbours_are_among_them() {
        for (i, j) in (0..60).flat_map(|i| (0..60).map(move |j| (i, j))) {
            assert_eq!(are_compared(i, j, 60), are_compared(j, i, 60));
        }
        assert!(are_compared(0, 59, 60) && are_compared(30, 31, 60) && !are_compared(7, 7, 60));
    }
}
