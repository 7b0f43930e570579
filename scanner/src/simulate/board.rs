//! The printed sheet: a ring of tags around an empty middle, and how it looks at any of its points.

use reconstruct::board::{Family, KnownBoard, Tag};
use reconstruct::marker::Dictionary;
use serde::{Deserialize, Serialize};

use super::texture::Rgb;

/// White border kept between the paper's edge and the tags, metres.
const MARGIN: f64 = 0.008;
/// Side of the cells in which tags are looked up, metres.
const LOOKUP: f64 = 0.005;
/// Printed black and paper white.
const INK: Rgb = [0.07, 0.07, 0.075];
const PAPER: Rgb = [0.93, 0.93, 0.91];

/// Sheets a ring can be laid out on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Paper {
    /// 297 × 210 mm.
    A4,
    /// 420 × 297 mm.
    A3,
    /// 594 × 420 mm.
    A2,
}

impl Paper {
    /// Width and height in metres, lying on its long side.
    pub fn size(self) -> [f64; 2] {
        match self {
            Self::A4 => [0.297, 0.210],
            Self::A3 => [0.420, 0.297],
            Self::A2 => [0.594, 0.420],
        }
    }

    /// Side of the tags that a ring on this paper uses: large enough that a cell covers three pixels where the whole sheet is in
    /// the picture.
    fn tag_side(self, family: Family) -> f64 {
        let finer = Dictionary::of(family).cells() as f64 / 6.0;
        let side: f64 = match self {
            Self::A4 => 0.036,
            Self::A3 => 0.045,
            Self::A2 => 0.055,
        };
        (side * finer * 1000.0).round().min(1000.0 * self.size()[1] / 5.0) / 1000.0
    }
}

/// A ring of tags on a paper: evenly spread, ids from the lower left corner along the columns.
pub fn ring(paper: Paper, family: Family) -> KnownBoard {
    let ([width, height], side) = (paper.size(), paper.tag_side(family));
    let places = |length: f64| {
        let room = length - 2.0 * MARGIN - side;
        let gaps = (room / (side * 1.3)).floor().max(1.0);
        (0..=gaps as usize).map(|k| -0.5 * room + room * k as f64 / gaps).collect::<Vec<_>>()
    };
    let (columns, rows) = (places(width), places(height));
    let mut tags = Vec::new();
    for (i, x) in columns.iter().enumerate() {
        for (j, y) in rows.iter().enumerate() {
            if i == 0 || j == 0 || i == columns.len() - 1 || j == rows.len() - 1 {
                tags.push(upright(tags.len() as u32, *x, *y, side));
            }
        }
    }
    let inner = |length: f64| 0.5 * length - MARGIN - side - MARGIN;
    let (x, y) = (in_micrometres(inner(width)), in_micrometres(inner(height)));
    KnownBoard { version: 1, family, tags, inner_region_m: vec![[-x, -y], [x, -y], [x, y], [-x, y]] }
}

fn upright(id: u32, x: f64, y: f64, side: f64) -> Tag {
    let h = 0.5 * side;
    let corners = [[x - h, y + h], [x + h, y + h], [x + h, y - h], [x - h, y - h]];
    Tag { id, corners_m: corners.map(|[x, y]| [in_micrometres(x), in_micrometres(y), 0.0]) }
}

/// The nearest whole micrometre, so that files hold short numbers that are read back to the last bit.
fn in_micrometres(metres: f64) -> f64 {
    (metres * 1e6).round() / 1e6
}

/// A board ready to be looked at.
#[derive(Debug, Clone)]
pub struct Sheet {
    /// Lowest and highest corner of the paper, metres.
    pub low: [f64; 2],
    /// Highest corner.
    pub high: [f64; 2],
    tags: Vec<Tag>,
    family: Family,
    cells: f64,
    /// For every look-up cell, row by row, the tags that touch it.
    lookup: Vec<Vec<u16>>,
    columns: usize,
}

impl Sheet {
    /// The sheet of a board; `None` where the board has no tag, a tag that is not flat on z = 0, or is larger than 5 m.
    pub fn of(board: &KnownBoard) -> Option<Self> {
        let corners = || board.tags.iter().flat_map(|t| t.corners_m);
        let flat = corners().all(|c| c.iter().all(|v| v.abs() < 2.5) && c[2].abs() < 1e-6);
        if board.tags.is_empty() || !flat {
            return None;
        }
        let low = [0, 1].map(|k| corners().map(|c| c[k]).fold(f64::INFINITY, f64::min) - MARGIN);
        let high = [0, 1].map(|k| corners().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max) + MARGIN);
        let count = [0, 1].map(|k| ((high[k] - low[k]) / LOOKUP).ceil() as usize);
        let mut lookup = vec![Vec::new(); count[0] * count[1]];
        for (i, tag) in board.tags.iter().enumerate() {
            let range = |k: usize| {
                let values = tag.corners_m.map(|c| c[k]);
                let cell = |v: f64| ((v - low[k]) / LOOKUP) as usize;
                cell(values.iter().copied().fold(f64::INFINITY, f64::min))
                    ..=cell(values.iter().copied().fold(f64::NEG_INFINITY, f64::max)).min(count[k] - 1)
            };
            for y in range(1) {
                range(0).for_each(|x| lookup[y * count[0] + x].push(i as u16));
            }
        }
        let cells = Dictionary::of(board.family).cells() as f64;
        Some(Self {
            low,
            high,
            tags: board.tags.clone(),
            family: board.family,
            cells,
            lookup,
            columns: count[0],
        })
    }

    /// Whether there is ink at a point of the sheet.
    pub fn is_ink(&self, x: f64, y: f64) -> bool {
        if x < self.low[0] || y < self.low[1] || x >= self.high[0] || y >= self.high[1] {
            return false;
        }
        let cell =
            ((y - self.low[1]) / LOOKUP) as usize * self.columns + ((x - self.low[0]) / LOOKUP) as usize;
        let near = self.lookup.get(cell).map_or(&[][..], Vec::as_slice);
        near.iter().any(|&i| self.tag_is_ink(&self.tags[usize::from(i)], x, y))
    }

    fn tag_is_ink(&self, tag: &Tag, x: f64, y: f64) -> bool {
        let [tl, tr, _, bl] = tag.corners_m;
        let along = |to: [f64; 3]| {
            let (ex, ey) = (to[0] - tl[0], to[1] - tl[1]);
            ((x - tl[0]) * ex + (y - tl[1]) * ey) / (ex * ex + ey * ey)
        };
        let (column, row) = (along(tr) * self.cells, along(bl) * self.cells);
        if column < 0.0 || row < 0.0 {
            return false;
        }
        // Outside the tag there is no such cell: paper.
        Dictionary::of(self.family).is_white(tag.id, row as usize, column as usize) == Some(false)
    }

    /// Colour at a point of the sheet.
    pub fn color(&self, x: f64, y: f64) -> Rgb {
        if self.is_ink(x, y) { INK } else { PAPER }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_fit_their_paper_and_have_their_ids_once() {
        for paper in [Paper::A4, Paper::A3, Paper::A2] {
            for family in Family::ALL {
                let board = ring(paper, family);
                assert!(board.tags.len() >= 12, "{paper:?} {family:?}: {}", board.tags.len());
                assert!(board.tags.len() <= Dictionary::of(family).len());
                let [w, h] = paper.size();
                for c in board.tags.iter().flat_map(|t| t.corners_m) {
                    assert!(c[0].abs() < 0.5 * w - 0.007 && c[1].abs() < 0.5 * h - 0.007);
                    let [x, y] = board.inner_region_m[2];
                    assert!(c[0].abs() > x || c[1].abs() > y, "a tag reaches into the middle");
                }
            }
        }
    }

    #[test]
    fn the_print_is_the_published_code_upright() {
        let board = ring(Paper::A3, Family::Aruco4x4_50);
        let (sheet, dictionary) = (Sheet::of(&board).unwrap(), Dictionary::of(board.family));
        for tag in &board.tags {
            let [tl, tr, ..] = tag.corners_m;
            let cell = (tr[0] - tl[0]) / 6.0;
            for (row, column) in (0..36).map(|i| (i / 6, i % 6)) {
                let (x, y) = (tl[0] + (column as f64 + 0.5) * cell, tl[1] - (row as f64 + 0.5) * cell);
                assert_eq!(Some(!sheet.is_ink(x, y)), dictionary.is_white(tag.id, row, column));
            }
            assert!(!sheet.is_ink(tl[0] - 0.001, tl[1]));
        }
    }
}
