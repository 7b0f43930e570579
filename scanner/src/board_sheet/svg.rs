//! The sheet as SVG in millimetres.

use std::fmt::Write as _;

use super::{Mark, Sheet};

/// The sheet as an SVG of its paper's size, at true scale.
pub fn to_svg(sheet: &Sheet) -> String {
    let [width, height] = sheet.size_mm;
    let place = |p: [f64; 2]| [rounded(p[0] + 0.5 * width), rounded(0.5 * height - p[1])];
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" \
         viewBox=\"0 0 {width} {height}\">\n<title>{}</title>\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n",
        sheet.title
    );
    for mark in &sheet.marks {
        let _ = match mark {
            Mark::Tag(shapes) => {
                out.push_str("<path fill-rule=\"evenodd\" d=\"");
                for shape in shapes {
                    let [a, b, c, d] = shape.map(place);
                    let _ = write!(
                        out,
                        "M{} {}L{} {}L{} {}L{} {}Z",
                        a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1]
                    );
                }
                writeln!(out, "\"/>")
            }
            Mark::Line { from, to, width, gray } => {
                let ([x0, y0], [x1, y1]) = (place(*from), place(*to));
                let color = color(*gray);
                writeln!(
                    out,
                    "<path stroke=\"{color}\" stroke-width=\"{width}\" d=\"M{x0} {y0}L{x1} {y1}\"/>"
                )
            }
            Mark::Text { at, size, gray, text } => {
                let ([x, y], color) = (place(*at), color(*gray));
                writeln!(
                    out,
                    "<text x=\"{x}\" y=\"{y}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"{size}\" \
                     text-anchor=\"middle\" fill=\"{color}\">{text}</text>"
                )
            }
        };
    }
    out.push_str("</svg>\n");
    out
}

/// Ten micrometres' tenth: more digits mean nothing on paper.
fn rounded(mm: f64) -> f64 {
    (mm * 1e4).round() / 1e4
}

fn color(gray: f64) -> String {
    let level = (gray * 255.0).round() as u8;
    format!("#{level:02x}{level:02x}{level:02x}")
}
