//! Views that agree make a group; what was moved between two views splits them in two.
//!
//! Correlation clustering, greedily: two groups become one as long as the share of what contradicts between them stays below a bound.

/// What two views have in common, both ways.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Shared {
    /// Points that could be compared.
    pub common: usize,
    /// Those of them that contradict.
    pub conflicts: usize,
}

/// The groups of `count` views, each ascending, the largest first. `shared(i, j)` is asked for i < j; more contradicting points than the share
/// `bound` speak for two groups.
pub(super) fn groups(count: usize, shared: impl Fn(usize, usize) -> Shared, bound: f64) -> Vec<Vec<usize>> {
    let price = (1.0 - bound) / bound.max(1e-3);
    let score = |s: Shared| (s.common - s.conflicts) as f64 - price * s.conflicts as f64;
    let mut groups: Vec<Vec<usize>> = (0..count).map(|i| vec![i]).collect();
    let mut ties: Vec<Vec<f64>> = (0..count)
        .map(|i| (0..count).map(|j| if i == j { 0.0 } else { score(shared(i.min(j), i.max(j))) }).collect())
        .collect();
    while let Some((i, j)) = strongest(&ties) {
        let joined = groups.swap_remove(j);
        groups[i].extend(joined);
        merge(&mut ties, i, j);
    }
    for group in &mut groups {
        group.sort_unstable();
    }
    groups.sort_by(|a, b| b.len().cmp(&a.len()).then(a.cmp(b)));
    groups
}

/// The two groups, i < j, that most speaks for being one.
fn strongest(ties: &[Vec<f64>]) -> Option<(usize, usize)> {
    let mut best: Option<(f64, (usize, usize))> = None;
    for (j, row) in ties.iter().enumerate() {
        for (i, &tie) in row.iter().enumerate().take(j) {
            if tie > 0.0 && best.is_none_or(|(most, _)| tie > most) {
                best = Some((tie, (i, j)));
            }
        }
    }
    best.map(|(_, pair)| pair)
}

/// Adds group j's ties to group i's; the last group takes j's place.
fn merge(ties: &mut Vec<Vec<f64>>, i: usize, j: usize) {
    let gone = ties.swap_remove(j);
    for row in ties.iter_mut() {
        row.swap_remove(j);
    }
    let mut gone = gone;
    gone.swap_remove(j);
    for k in (0..ties.len()).filter(|&k| k != i) {
        ties[i][k] += gone[k];
        ties[k][i] = ties[i][k];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neighbours on a ring of eight share 4000 points, those after them 900.
    fn ring(moved: &[usize]) -> Vec<Vec<usize>> {
        let shared = |i: usize, j: usize| {
            let apart = (j - i).min(8 - (j - i));
            let common = [0, 4000, 900, 20, 0][apart];
            let split = moved.contains(&i) != moved.contains(&j);
            Shared { common, conflicts: if split { common / 3 } else { common / 200 } }
        };
        groups(8, shared, 0.06)
    }

    #[test]
    fn views_that_agree_are_one_group() {
        assert_eq!(ring(&[]), [vec![0, 1, 2, 3, 4, 5, 6, 7]]);
    }

    #[test]
    fn what_was_moved_between_two_views_splits_them() {
        assert_eq!(ring(&[3]), [vec![0, 1, 2, 4, 5, 6, 7], vec![3]]);
        assert_eq!(ring(&[6, 7]), [vec![0, 1, 2, 3, 4, 5], vec![6, 7]]);
        assert_eq!(ring(&[5, 6, 7]), [vec![0, 1, 2, 3, 4], vec![5, 6, 7]]);
        assert_eq!(ring(&[4, 5, 6, 7]), [vec![0, 1, 2, 3], vec![4, 5, 6, 7]]);
        assert_eq!(ring(&[1, 3, 5, 7]), [vec![0, 2, 4, 6], vec![1, 3, 5, 7]]);
    }

    #[test]
    fn views_that_share_nothing_are_groups_of_their_own() {
        assert_eq!(groups(3, |_, _| Shared::default(), 0.06), [[0], [1], [2]]);
    }
}
