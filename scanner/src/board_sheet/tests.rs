use super::*;
use crate::simulate::{Paper, ring};
use reconstruct::board::Family;
use reconstruct::image::GrayImage;
use reconstruct::marker::{DetectConfig, detect};

/// Pixels a millimetre of the test's own print.
const DPMM: f64 = 4.0;

/// Quadrilaterals of one `<path>` of a tag, millimetres from the paper's top left.
fn shapes_of(path: &str) -> Vec<[[f64; 2]; 4]> {
    let data = path.split("d=\"").nth(1).unwrap().trim_end_matches("\"/>");
    let shape = |part: &str| {
        let numbers: Vec<f64> = part.split(['M', 'L', ' ']).filter_map(|n| n.parse().ok()).collect();
        std::array::from_fn(|k| [numbers[2 * k], numbers[2 * k + 1]])
    };
    data.split('Z').filter(|part| !part.is_empty()).map(shape).collect()
}

/// Prints the tags of an SVG: black where an odd number of upright rectangles covers a sample.
fn print(svg: &str, size_mm: [f64; 2]) -> GrayImage {
    let [width, height] = size_mm.map(|v| (v * DPMM).round() as usize);
    let mut dark = vec![0u32; width * height];
    for path in svg.lines().filter(|l| l.contains("evenodd")) {
        let shapes = shapes_of(path);
        let outer = shapes[0];
        let pixels = |k: usize| (outer[0][k] * DPMM).floor() as usize..(outer[2][k] * DPMM).ceil() as usize;
        for y in pixels(1) {
            for x in pixels(0) {
                for sample in 0..16 {
                    let at = |pixel: usize, i: usize| (pixel as f64 + (i as f64 + 0.5) / 4.0) / DPMM;
                    let (px, py) = (at(x, sample % 4), at(y, sample / 4));
                    let covers =
                        |s: &&[[f64; 2]; 4]| px >= s[0][0] && px < s[2][0] && py >= s[0][1] && py < s[2][1];
                    dark[y * width + x] += (shapes.iter().filter(covers).count() % 2) as u32;
                }
            }
        }
    }
    let data = dark.iter().map(|&d| (250 - d * 220 / 16) as u8).collect();
    GrayImage { width, height, data }
}

fn check_print(paper: Paper, family: Family) {
    let board = ring(paper, family);
    let sheet = draw(&board, paper.size(), "test");
    let image = print(&to_svg(&sheet), sheet.size_mm);
    let found = detect(&image, Dictionary::of(family), None, &DetectConfig::default());
    let ids: Vec<u32> = found.iter().map(|d| d.id).collect();
    assert_eq!(ids, board.tags.iter().map(|t| t.id).collect::<Vec<_>>(), "{paper:?} {family:?}");
    for (d, tag) in found.iter().zip(&board.tags) {
        for (pixel, corner) in d.corners.iter().zip(&tag.corners_m) {
            let x = (pixel.x + 0.5) / DPMM - 0.5 * sheet.size_mm[0];
            let y = 0.5 * sheet.size_mm[1] - (pixel.y + 0.5) / DPMM;
            let off = (x - corner[0] * 1e3).hypot(y - corner[1] * 1e3);
            assert!(off < 0.1, "{paper:?} {family:?} tag {}: {off} mm", tag.id);
        }
    }
}

#[test]
fn the_printed_tags_lie_where_the_board_file_says() {
    for family in Family::ALL {
        check_print(Paper::A4, family);
    }
    check_print(Paper::A3, Family::Aruco4x4_50);
    check_print(Paper::A2, Family::Tag36h11);
}

#[test]
fn marks_stay_on_the_paper_and_text_off_the_tags() {
    for paper in [Paper::A4, Paper::A3, Paper::A2] {
        let board = ring(paper, Family::Aruco4x4_50);
        let sheet = draw(&board, paper.size(), "test");
        let [w, h] = sheet.size_mm.map(|v| 0.5 * v - 4.0);
        for mark in &sheet.marks {
            let Mark::Text { at, size, text, .. } = mark else { continue };
            let half = 0.28 * size * text.len() as f64;
            assert!(at[0].abs() + half < w && at[1].abs() + size < h, "{paper:?} {text} leaves the paper");
            for tag in &board.tags {
                let [tl, _, br, _] = tag.corners_m.map(|c| [c[0] * 1e3, c[1] * 1e3]);
                let apart = at[0] + half < tl[0] - 2.0
                    || at[0] - half > br[0] + 2.0
                    || at[1] > tl[1] + 2.0
                    || at[1] + size < br[1] - 2.0;
                assert!(apart, "{paper:?} {text:?} touches tag {}", tag.id);
            }
        }
    }
}

#[test]
fn a_pdf_has_a_sound_table_and_the_same_bytes_every_time() {
    let board = ring(Paper::A3, Family::Aruco4x4_50);
    let pdf = to_pdf(&draw(&board, Paper::A3.size(), "a3"));
    assert_eq!(pdf, to_pdf(&draw(&board, Paper::A3.size(), "a3")));
    let text = String::from_utf8(pdf).unwrap();
    assert!(text.contains("/MediaBox [0 0 1190.5512 841.8898]"), "A3 lying is 420 x 297 mm");
    let table: usize = text.split("startxref\n").nth(1).unwrap().lines().next().unwrap().parse().unwrap();
    assert!(text[table..].starts_with("xref\n0 7\n"));
    for (i, line) in text[table..].lines().skip(3).take(6).enumerate() {
        let offset: usize = line[..10].parse().unwrap();
        assert!(text[offset..].starts_with(&format!("{} 0 obj", i + 1)));
    }
    let stream = text.split("stream\n").nth(1).unwrap();
    let length: usize = text.split("/Length ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert_eq!(stream.len(), length + "end".len());
}
