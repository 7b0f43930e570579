//! One page of PDF 1.4: paths and Helvetica, which every reader has.

use std::fmt::Write as _;

use super::{Mark, Sheet};

const POINTS_PER_MM: f64 = 72.0 / 25.4;
/// Mean width of Helvetica's letters in sizes of the font, to centre a line.
const LETTER_WIDTH: f64 = 0.5;

/// The sheet as a PDF of its paper's size, at true scale.
pub fn to_pdf(sheet: &Sheet) -> Vec<u8> {
    let [width, height] = sheet.size_mm.map(points);
    let content = content(sheet);
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width} {height}] /Contents 4 0 R \
             /Resources << /Font << /F 5 0 R >> >> >>"
        ),
        format!("<< /Length {} >>\nstream\n{content}endstream", content.len()),
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>".to_owned(),
        format!("<< /Title ({}) >>", escaped(&sheet.title)),
    ];
    let mut file = String::from("%PDF-1.4\n");
    let mut offsets = Vec::new();
    for (i, object) in objects.iter().enumerate() {
        offsets.push(file.len());
        let _ = write!(file, "{} 0 obj\n{object}\nendobj\n", i + 1);
    }
    let table = file.len();
    let _ = write!(file, "xref\n0 {}\n0000000000 65535 f \n", objects.len() + 1);
    for offset in offsets {
        let _ = writeln!(file, "{offset:010} 00000 n ");
    }
    let size = objects.len() + 1;
    let _ = write!(file, "trailer\n<< /Size {size} /Root 1 0 R /Info 6 0 R >>\nstartxref\n{table}\n%%EOF\n");
    file.into_bytes()
}

fn points(mm: f64) -> f64 {
    (mm * POINTS_PER_MM * 1e4).round() / 1e4
}

/// The page's drawing operators.
fn content(sheet: &Sheet) -> String {
    let place = |p: [f64; 2]| [0, 1].map(|k| points(p[k] + 0.5 * sheet.size_mm[k]));
    let mut out = String::new();
    for mark in &sheet.marks {
        let _ = match mark {
            Mark::Tag(shapes) => {
                out.push_str("0 g\n");
                for shape in shapes {
                    let [a, b, c, d] = shape.map(place);
                    let _ = writeln!(
                        out,
                        "{} {} m {} {} l {} {} l {} {} l h",
                        a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1]
                    );
                }
                writeln!(out, "f*")
            }
            Mark::Line { from, to, width, gray } => {
                let ([x0, y0], [x1, y1]) = (place(*from), place(*to));
                writeln!(out, "{gray} G {} w {x0} {y0} m {x1} {y1} l S", points(*width))
            }
            Mark::Text { at, size, gray, text } => {
                let [x, y] = place([at[0] - 0.5 * LETTER_WIDTH * size * text.len() as f64, at[1]]);
                writeln!(out, "BT {gray} g /F {} Tf {x} {y} Td ({}) Tj ET", points(*size), escaped(text))
            }
        };
    }
    out
}

fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\").replace('(', "\\(").replace(')', "\\)")
}
