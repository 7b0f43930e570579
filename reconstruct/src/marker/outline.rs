//! Outer outlines of black regions, followed along the cracks between pixels.
//!
//! Black is 4-connected (so that neighbouring tags do not merge over a corner) and lies to the right of the walk:
//! outer outlines run clockwise in the picture. Every crack is walked once.

use super::threshold::BlackMask;

/// Vertices of an outline: (x, y) is the top-left corner of pixel (x, y), which is at (x - 0.5, y - 0.5) in pixels.
pub(super) type Outline = Vec<[i32; 2]>;

/// Up, right, down, left.
const STEPS: [[i32; 2]; 4] = [[0, -1], [1, 0], [0, 1], [-1, 0]];

/// Calls `visit` with every outer outline of `min_length` to `max_length` cracks, top to bottom.
pub(super) fn for_each_outline(
    mask: &BlackMask,
    min_length: usize,
    max_length: usize,
    mut visit: impl FnMut(&Outline),
) {
    let mut walked = vec![false; mask.data.len()];
    let mut outline = Outline::new();
    for start in mask.stride..mask.data.len() {
        if mask.data[start] == 1 && mask.data[start - 1] == 0 && !walked[start] {
            let twice_area = follow(mask, start, &mut walked, &mut outline);
            if twice_area > 0 && (min_length..=max_length).contains(&outline.len()) {
                visit(&outline);
            }
        }
    }
}

/// Walks from the left crack of a black pixel until it closes; returns twice the enclosed area, negative for holes.
fn follow(mask: &BlackMask, start: usize, walked: &mut [bool], outline: &mut Outline) -> i64 {
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
        let [left, right] = ahead[direction];
        if mask.data[(below + right) as usize] == 0 {
            direction = (direction + 1) % 4;
        } else if mask.data[(below + left) as usize] == 1 {
            direction = (direction + 3) % 4;
        }
        if below == first && direction == 0 {
            return twice_area;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outlines(rows: &[&str]) -> Vec<Outline> {
        let stride = rows[0].len() + 2;
        let mut data = vec![0; stride];
        for row in rows {
            data.push(0);
            data.extend(row.bytes().map(|b| u8::from(b == b'#')));
            data.push(0);
        }
        data.extend(vec![0; stride]);
        let mut found = Vec::new();
        for_each_outline(&BlackMask { stride, data }, 1, 1000, |o| found.push(o.clone()));
        found
    }

    #[test]
    fn one_pixel_has_four_cracks() {
        let found = outlines(&["...", ".#.", "..."]);
        assert_eq!(found, vec![vec![[1, 2], [1, 1], [2, 1], [2, 2]]]);
    }

    #[test]
    fn holes_are_left_out_and_diagonal_neighbours_are_apart() {
        let found = outlines(&["####.", "#..#.", "####.", "....#"]);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [14, 4]);
    }
}
