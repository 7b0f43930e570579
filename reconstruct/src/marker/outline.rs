//! Outer outlines of black regions, followed along the cracks between pixels.
//!
//! Black lies to the right of the walk: outer outlines run clockwise in the picture. Every crack is walked once.

use super::threshold::BlackMask;

/// Vertices of an outline: (x, y) is the top-left corner of pixel (x, y), which is at (x - 0.5, y - 0.5) in pixels.
pub(super) type Outline = Vec<[i32; 2]>;

/// Up, right, down, left.
const STEPS: [[i32; 2]; 4] = [[0, -1], [1, 0], [0, 1], [-1, 0]];

/// Which pixels of a region hang together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Connected {
    /// Over sides only: neighbouring tags do not merge over a corner.
    Sides,
    /// Over corners too: borders that are thinner than two pixels stay whole.
    Corners,
}

/// Calls `visit` with every outer outline of `min_length` to `max_length` cracks, top to bottom.
pub(super) fn for_each_outline(
    mask: &BlackMask,
    connected: Connected,
    min_length: usize,
    max_length: usize,
    mut visit: impl FnMut(&Outline),
) {
    let mut walked = vec![false; mask.data.len()];
    let mut outline = Outline::new();
    let mut at = mask.stride;
    while let Some(start) = next_left_crack(mask, at) {
        if !walked[start] {
            let twice_area = follow(mask, connected, start, &mut walked, &mut outline);
            if twice_area > 0 && (min_length..=max_length).contains(&outline.len()) {
                visit(&outline);
            }
        }
        at = start + 1;
    }
}

/// The next black pixel whose left neighbour is not black, from a place that has a left neighbour.
fn next_left_crack(mask: &BlackMask, from: usize) -> Option<usize> {
    let here = mask.data.get(from..)?;
    let left = &mask.data[from - 1..];
    let words = here.as_chunks::<8>().0.iter().zip(left.as_chunks::<8>().0);
    for (i, (here, left)) in words.enumerate() {
        let cracks = u64::from_le_bytes(*here) & !u64::from_le_bytes(*left);
        if cracks != 0 {
            return Some(from + 8 * i + cracks.trailing_zeros() as usize / 8);
        }
    }
    let rest = here.len() / 8 * 8;
    (rest..here.len()).find(|&i| here[i] == 1 && left[i] == 0).map(|i| from + i)
}

/// Walks from the left crack of a black pixel until it closes; returns twice the enclosed area, negative for holes.
fn follow(
    mask: &BlackMask,
    connected: Connected,
    start: usize,
    walked: &mut [bool],
    outline: &mut Outline,
) -> i64 {
    outline.clear();
    let stride = mask.stride as i32;
    // Index of the pixels ahead of a vertex, relative to the pixel right below it: ahead-left, ahead-right.
    let ahead = [[-stride - 1, -stride], [-stride, 0], [0, -1], [-1, -stride - 1]];
    let leap = [-stride, 1, stride, -1];
    let (row, column) = (start / mask.stride, start % mask.stride);
    let first = (start + mask.stride) as i32;
    let (mut below, mut direction) = (first, 0);
    let (mut x, mut y) = (column as i32 - 1, row as i32);
    let mut twice_area = 0;
    loop {
        outline.push([x, y]);
        let step = STEPS[direction];
        below += leap[direction];
        if direction == 0 {
            walked[below as usize] = true;
        }
        twice_area += i64::from(x) * i64::from(step[1]) - i64::from(y) * i64::from(step[0]);
        x += step[0];
        y += step[1];
        let [left, right] = ahead[direction].map(|pixel| mask.data[(below + pixel) as usize] == 1);
        if left && (right || connected == Connected::Corners) {
            direction = (direction + 3) % 4;
        } else if !right {
            direction = (direction + 1) % 4;
        }
        if below == first && direction == 0 {
            return twice_area;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outlines(rows: &[&str], connected: Connected) -> Vec<Outline> {
        let stride = rows[0].len() + 2;
        let mut data = vec![0; stride];
        for row in rows {
            data.push(0);
            data.extend(row.bytes().map(|b| u8::from(b == b'#')));
            data.push(0);
        }
        data.extend(vec![0; stride]);
        let mut found = Vec::new();
        for_each_outline(&BlackMask { stride, data }, connected, 1, 1000, |o| found.push(o.clone()));
        found
    }

    #[test]
    fn one_pixel_has_four_cracks() {
        let found = outlines(&["...", ".#.", "..."], Connected::Sides);
        assert_eq!(found, vec![vec![[1, 2], [1, 1], [2, 1], [2, 2]]]);
    }

    #[test]
    fn holes_are_left_out_and_diagonal_neighbours_are_apart_or_not() {
        let lengths = |connected| {
            let found = outlines(&["####.", "#..#.", "####.", "....#"], connected);
            found.iter().map(Vec::len).collect::<Vec<_>>()
        };
        assert_eq!(lengths(Connected::Sides), [14, 4]);
        assert_eq!(lengths(Connected::Corners), [18]);
    }
}
