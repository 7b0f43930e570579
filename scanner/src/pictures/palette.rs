//! Fewer colours by median cut (Heckbert 1982) over a histogram of 5 bits a channel.

/// Cells of the histogram: 5 bits a channel.
const CELLS: usize = 1 << 15;

/// One colour of the histogram: the sum of its pixels and how many.
#[derive(Clone, Copy)]
struct Cell {
    number: usize,
    sum: [u64; 3],
    count: u64,
}

impl Cell {
    fn mean(&self, channel: usize) -> u64 {
        self.sum[channel] / self.count
    }
}

/// At most `colors` colours (up to 256) and for every pixel the number of its own.
pub(super) fn reduce(pixels: &[[u8; 3]], colors: usize) -> (Vec<[u8; 3]>, Vec<u8>) {
    let mut cells: Vec<Cell> = (0..CELLS).map(|number| Cell { number, sum: [0; 3], count: 0 }).collect();
    for pixel in pixels {
        let cell = &mut cells[cell_of(*pixel)];
        cell.count += 1;
        for (sum, value) in cell.sum.iter_mut().zip(pixel) {
            *sum += u64::from(*value);
        }
    }
    cells.retain(|cell| cell.count > 0);
    let boxes = cut(cells, colors.clamp(1, 256));
    let mut number_of_cell = vec![0; CELLS];
    let mut palette = Vec::with_capacity(boxes.len());
    for cells in &boxes {
        for cell in cells {
            number_of_cell[cell.number] = palette.len() as u8;
        }
        let count: u64 = cells.iter().map(|cell| cell.count).sum();
        palette.push(std::array::from_fn(|k| {
            ((cells.iter().map(|cell| cell.sum[k]).sum::<u64>() + count / 2) / count.max(1)) as u8
        }));
    }
    (palette, pixels.iter().map(|&pixel| number_of_cell[cell_of(pixel)]).collect())
}

fn cell_of([r, g, b]: [u8; 3]) -> usize {
    (usize::from(r) >> 3) << 10 | (usize::from(g) >> 3) << 5 | usize::from(b) >> 3
}

/// Cuts the box with the widest spread, weighted by the root of its pixels, until there are enough.
fn cut(cells: Vec<Cell>, colors: usize) -> Vec<Vec<Cell>> {
    let mut boxes = vec![cells];
    while boxes.len() < colors {
        let widest =
            boxes.iter().enumerate().map(|(i, cells)| (urgency(cells), i)).max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((spread, i)) = widest.filter(|(spread, _)| *spread > 0.0) else { break };
        debug_assert!(spread.is_finite());
        let mut cells = boxes.swap_remove(i);
        let channel = widest_channel(&cells).0;
        cells.sort_by_key(|cell| (cell.mean(channel), cell.number));
        let half = cells.iter().map(|cell| cell.count).sum::<u64>() / 2;
        let mut passed = 0;
        let middle = cells.iter().position(|cell| {
            passed += cell.count;
            passed > half
        });
        let upper = cells.split_off(middle.unwrap_or(1).clamp(1, cells.len() - 1));
        boxes.extend([cells, upper]);
    }
    boxes
}

fn widest_channel(cells: &[Cell]) -> (usize, u64) {
    let spread = |k: usize| {
        let means = || cells.iter().map(move |cell| cell.mean(k));
        means().max().unwrap_or(0) - means().min().unwrap_or(0)
    };
    (0..3).map(|k| (k, spread(k))).max_by_key(|(_, spread)| *spread).unwrap_or((0, 0))
}

fn urgency(cells: &[Cell]) -> f64 {
    if cells.len() < 2 {
        return 0.0;
    }
    let count = cells.iter().map(|cell| cell.count).sum::<u64>() as f64;
    (widest_channel(cells).1.max(1)) as f64 * count.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_stay_as_they_are() {
        let pixels = [[10, 20, 30], [200, 100, 50], [10, 20, 30], [0, 0, 0]];
        let (palette, numbers) = reduce(&pixels, 256);
        let back: Vec<[u8; 3]> = numbers.iter().map(|&n| palette[usize::from(n)]).collect();
        assert_eq!(back, pixels);
    }

    #[test]
    fn the_number_of_colours_holds() {
        let pixels: Vec<[u8; 3]> =
            (0..5000u32).map(|i| [(i * 7) as u8, (i * 13) as u8, (i / 20) as u8]).collect();
        assert!(reduce(&pixels, 16).0.len() <= 16);
        assert_eq!(reduce(&pixels, 1).0.len(), 1);
        assert_eq!(reduce(&[], 4).1, [0u8; 0]);
    }
}
