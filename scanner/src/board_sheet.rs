//! The marker board as a sheet to print: tags, ids, a ruler to check the print, where the product stands.
//!
//! Drawn once as marks in millimetres (origin in the paper's middle, x right, y up: the board's own frame), then written
//! as PDF or SVG at true scale. The same board gives the same bytes.

mod pdf;
mod svg;

pub use pdf::to_pdf;
pub use svg::to_svg;

use reconstruct::board::{KnownBoard, Tag};
use reconstruct::marker::Dictionary;

/// Grey of what the eye needs and the camera does not, 0 = black.
const LIGHT: f64 = 0.62;
/// Grey of the outline in which the product stands.
const LIGHTER: f64 = 0.8;
const RULER_MM: f64 = 100.0;

/// A sheet of paper with marks.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// What it is, for the file's title.
    pub title: String,
    /// Width and height of the paper, millimetres.
    pub size_mm: [f64; 2],
    /// Marks in drawing order.
    pub marks: Vec<Mark>,
}

/// Something printed.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// Black where an odd number of the quadrilaterals lies: a tag is its square and its white cells.
    Tag(Vec<[[f64; 2]; 4]>),
    /// A thin line.
    Line {
        /// One end, millimetres.
        from: [f64; 2],
        /// The other end.
        to: [f64; 2],
        /// Thickness, millimetres.
        width: f64,
        /// 0 = black, 1 = white.
        gray: f64,
    },
    /// A line of text, centred on a point of its base line.
    Text {
        /// Middle of the base line, millimetres.
        at: [f64; 2],
        /// Letter size, millimetres.
        size: f64,
        /// 0 = black, 1 = white.
        gray: f64,
        /// Printable ASCII.
        text: String,
    },
}

/// Draws a board on paper of a size in metres; `paper` names it for the reader.
pub fn draw(board: &KnownBoard, size: [f64; 2], paper: &str) -> Sheet {
    let size_mm = size.map(|v| v * 1e3);
    let mut marks: Vec<Mark> = board.tags.iter().map(|tag| draw_tag(board, tag)).collect();
    marks.extend(board.tags.iter().map(draw_id));
    marks.extend(draw_region(&board.inner_region_m));
    marks.extend(draw_ruler(&board.inner_region_m, paper, board.family.name()));
    Sheet { title: format!("Allround marker board {paper} {}", board.family.name()), size_mm, marks }
}

/// The tag's square and, as further quadrilaterals, its white cells.
fn draw_tag(board: &KnownBoard, tag: &Tag) -> Mark {
    let dictionary = Dictionary::of(board.family);
    let n = dictionary.cells();
    let [tl, tr, _, bl] = tag.corners_m.map(|c| [c[0] * 1e3, c[1] * 1e3]);
    let place = |row: usize, column: usize| {
        let (u, v) = (column as f64 / n as f64, row as f64 / n as f64);
        [0, 1].map(|k| tl[k] + (tr[k] - tl[k]) * u + (bl[k] - tl[k]) * v)
    };
    let block = |r0: usize, c0: usize, r1: usize, c1: usize| {
        [place(r0, c0), place(r0, c1), place(r1, c1), place(r1, c0)]
    };
    let mut shapes = vec![block(0, 0, n, n)];
    for row in 0..n {
        for column in 0..n {
            if dictionary.is_white(tag.id, row, column) == Some(true) {
                shapes.push(block(row, column, row + 1, column + 1));
            }
        }
    }
    Mark::Tag(shapes)
}

/// The id between the tag and the board's middle, outside of the tag's white surrounding where there is room.
fn draw_id(tag: &Tag) -> Mark {
    let middle = [0, 1].map(|k| tag.corners_m.iter().map(|c| c[k] * 250.0).sum::<f64>());
    let half =
        0.5e3 * (tag.corners_m[1][0] - tag.corners_m[0][0]).hypot(tag.corners_m[1][1] - tag.corners_m[0][1]);
    let size = 1.6;
    // Below the upper tags, above the lower ones: towards the middle, 5 mm from the black.
    let towards = if middle[1] > 0.0 { -(half + 5.0 + 0.7 * size) } else { half + 5.0 };
    Mark::Text { at: [middle[0], middle[1] + towards], size, gray: LIGHT, text: tag.id.to_string() }
}

/// The outline in which the product stands, and a small cross in the middle.
fn draw_region(region: &[[f64; 2]]) -> Vec<Mark> {
    let line = |from: [f64; 2], to: [f64; 2]| Mark::Line { from, to, width: 0.3, gray: LIGHTER };
    let corner = |k: usize| region[k % region.len()].map(|v| v * 1e3);
    let outline = (0..region.len()).map(|k| line(corner(k), corner(k + 1)));
    outline.chain([line([-4.0, 0.0], [4.0, 0.0]), line([0.0, -4.0], [0.0, 4.0])]).collect()
}

/// A ruler inside the region's lower edge, and what to do.
fn draw_ruler(region: &[[f64; 2]], paper: &str, family: &str) -> Vec<Mark> {
    let lowest = region.iter().map(|p| p[1] * 1e3).fold(f64::INFINITY, f64::min);
    let y = lowest + 9.0;
    let line = |from, to| Mark::Line { from, to, width: 0.2, gray: LIGHT };
    let left = -0.5 * RULER_MM;
    let mut marks = vec![line([left, y], [-left, y])];
    for tick in 0..=10 {
        let x = left + 10.0 * f64::from(tick);
        let length = if tick % 5 == 0 { 3.0 } else { 1.8 };
        marks.push(line([x, y], [x, y + length]));
    }
    let text = |dy: f64, text: String| Mark::Text { at: [0.0, y + dy], size: 2.4, gray: LIGHT, text };
    marks.push(text(-3.2, "This line is 100 mm long: measure it. If it is not, print again at 100 % without fitting to the page.".to_owned()));
    marks.push(text(-6.4, format!("Allround board {} {family}. Lay it flat, stand the product inside the outline, leave the tags in view.", paper.to_uppercase())));
    marks
}

#[cfg(test)]
mod tests;
