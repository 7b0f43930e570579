//! Bars on a logarithmic scale as SVG, dark or light as the reader's page is.

use std::fmt::Write as _;

/// One bar.
pub(crate) struct Bar {
    pub(crate) label: String,
    /// Milliseconds.
    pub(crate) value: f64,
    pub(crate) ours: bool,
}

const WIDTH: f64 = 860.0;
/// Where bars begin, and how far they may reach.
const LEFT: f64 = 210.0;
const RIGHT: f64 = 790.0;
const BAR: f64 = 15.0;
const GAP: f64 = 12.0;
const HEAD: f64 = 18.0;
const TOP: f64 = 44.0;

/// Groups of bars below each other, each with its name; milliseconds.
pub(crate) fn bars(title: &str, groups: &[(String, Vec<Bar>)]) -> String {
    let values = || groups.iter().flat_map(|(_, bars)| bars).map(|bar| bar.value.max(1e-3));
    let low = values().fold(f64::INFINITY, f64::min).log10().floor();
    let high = values().fold(f64::NEG_INFINITY, f64::max).log10().ceil().max(low + 1.0);
    let x = |value: f64| LEFT + (RIGHT - LEFT) * (value.max(1e-3).log10() - low) / (high - low);
    let height: f64 =
        TOP + groups.iter().map(|(_, bars)| HEAD + BAR * bars.len() as f64 + GAP).sum::<f64>() + 10.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
         font-size=\"11\">\n<style>text{{fill:#333}}.o{{fill:#0a7d4f}}.p{{fill:#9aa5b1}}.g{{stroke:#ddd}}\
         @media(prefers-color-scheme:dark){{text{{fill:#ddd}}.g{{stroke:#444}}.o{{fill:#35c48d}}.p{{fill:#66707c}}}}</style>\n"
    );
    text(&mut svg, 10.0, 20.0, "start", "15", title);
    for power in low as i32..=high as i32 {
        let at = x(10f64.powi(power));
        line(&mut svg, at, TOP - 8.0, height - 8.0);
        text(&mut svg, at, TOP - 12.0, "middle", "10", &format!("{} ms", 10f64.powi(power)));
    }
    let mut y = TOP;
    for (name, bars) in groups {
        text(&mut svg, 10.0, y + 12.0, "start", "12", name);
        y += HEAD;
        for bar in bars {
            let class = if bar.ours { "o" } else { "p" };
            let length = (x(bar.value) - LEFT).max(1.0);
            text(&mut svg, LEFT - 6.0, y + 11.0, "end", "11", &bar.label);
            writeln!(
                svg,
                "<rect class=\"{class}\" x=\"{LEFT}\" y=\"{:.1}\" width=\"{length:.1}\" height=\"{:.1}\"/>",
                y + 1.0,
                BAR - 2.0
            )
            .expect("a string takes everything");
            text(&mut svg, LEFT + length + 4.0, y + 11.0, "start", "10", &format!("{:.2}", bar.value));
            y += BAR;
        }
        y += GAP;
    }
    svg.push_str("</svg>\n");
    svg
}

fn text(svg: &mut String, x: f64, y: f64, anchor: &str, size: &str, what: &str) {
    let what = what.replace('&', "&amp;").replace('<', "&lt;");
    writeln!(
        svg,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\">{what}</text>"
    )
    .expect("a string takes everything");
}

fn line(svg: &mut String, x: f64, from: f64, to: f64) {
    writeln!(svg, "<line class=\"g\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{from:.1}\" y2=\"{to:.1}\"/>")
        .expect("a string takes everything");
}
