//! Procedural colour: noise, stripes and printed words as functions of a place. Colours are sRGB in 0..1.

use super::sdf::Vec3;

/// sRGB colour in 0..1.
pub type Rgb = [f32; 3];

/// Between two colours.
pub fn mix(a: Rgb, b: Rgb, t: f32) -> Rgb {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t)
}

/// A colour made lighter or darker.
pub fn scale(a: Rgb, by: f32) -> Rgb {
    a.map(|v| v * by)
}

/// Colour of a hue in turns (0 red, 1/3 green, 2/3 blue), a saturation and a brightness in 0..1.
pub fn hue(turn: f32, saturation: f32, value: f32) -> Rgb {
    std::array::from_fn(|k| {
        let t = ((turn + [1.0, 2.0 / 3.0, 1.0 / 3.0][k]).rem_euclid(1.0) * 6.0 - 3.0).abs() - 1.0;
        value * (1.0 + saturation * (t.clamp(0.0, 1.0) - 1.0))
    })
}

/// Fixed pseudo-random number in 0..1 of three integers and a seed.
fn lattice(x: i32, y: i32, z: i32, seed: u32) -> f32 {
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77)
        ^ (z as u32).wrapping_mul(0xc2b2_ae3d)
        ^ seed.wrapping_mul(0x27d4_eb2f);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    ((h ^ (h >> 15)) >> 8) as f32 / 16_777_216.0
}

/// Smooth noise in 0..1 with one bump about every unit.
pub fn noise(p: Vec3, seed: u32) -> f32 {
    // Cheaper than `floor`, which is a call on plain x86-64.
    let cell = p.map(|v| (v as i32 - i32::from(v < 0.0)) as f32);
    let [x, y, z] = [cell.x as i32, cell.y as i32, cell.z as i32];
    let t = (p - cell).map(|v| v * v * (3.0 - 2.0 * v));
    let line = |y: i32, z: i32| {
        let a = lattice(x, y, z, seed);
        a + (lattice(x + 1, y, z, seed) - a) * t.x
    };
    let face = |z: i32| {
        let a = line(y, z);
        a + (line(y + 1, z) - a) * t.y
    };
    let a = face(z);
    a + (face(z + 1) - a) * t.z
}

/// Three octaves of [`noise`], 0..1.
pub fn clouds(p: Vec3, seed: u32) -> f32 {
    0.55 * noise(p, seed) + 0.3 * noise(p * 2.17, seed ^ 1) + 0.15 * noise(p * 4.6, seed ^ 2)
}

/// Whether `t` is in the painted share of its period.
pub fn stripe(t: f32, period: f32, share: f32) -> bool {
    (t / period).rem_euclid(1.0) < share
}

/// Thin and thick bars, as on a price code, along `t` in units of the thinnest bar.
pub fn bars(t: f32, seed: u32) -> bool {
    lattice(t.floor() as i32, 7, 3, seed) < 0.5
}

/// Capital letters, three columns and five rows, top row first, the leftmost column the highest bit.
const LETTERS: [u16; 26] = [
    0b010_101_111_101_101, // A
    0b110_101_110_101_110, // B
    0b011_100_100_100_011, // C
    0b110_101_101_101_110, // D
    0b111_100_110_100_111, // E
    0b111_100_110_100_100, // F
    0b011_100_101_101_011, // G
    0b101_101_111_101_101, // H
    0b111_010_010_010_111, // I
    0b001_001_001_101_010, // J
    0b101_101_110_101_101, // K
    0b100_100_100_100_111, // L
    0b101_111_111_101_101, // M
    0b111_101_101_101_101, // N
    0b010_101_101_101_010, // O
    0b110_101_110_100_100, // P
    0b010_101_101_011_001, // Q
    0b110_101_110_110_101, // R
    0b011_100_010_001_110, // S
    0b111_010_010_010_010, // T
    0b101_101_101_101_111, // U
    0b101_101_101_101_010, // V
    0b101_101_111_111_101, // W
    0b101_101_010_101_101, // X
    0b101_101_010_010_010, // Y
    0b111_001_010_100_111, // Z
];

/// Whether `(u, v)` lies on the ink of a word in capitals: `u` from its left, `v` from its foot, in letter heights.
pub fn word(u: f32, v: f32, text: &str) -> bool {
    if !(0.0..1.0).contains(&v) || u < 0.0 {
        return false;
    }
    let column = (u * 5.0) as usize;
    let letter = text.as_bytes().get(column / 4).copied().unwrap_or(b' ');
    if column % 4 == 3 || !letter.is_ascii_uppercase() {
        return false;
    }
    let row = ((1.0 - v) * 5.0) as usize;
    let bits = LETTERS[usize::from(letter - b'A')];
    bits >> (14 - 3 * row.min(4) - column % 4) & 1 == 1
}

/// Width of a word in letter heights.
pub fn word_width(text: &str) -> f32 {
    text.len() as f32 * 0.8 - 0.2
}

/// Whether `(u, v)` lies on rows of small print: words of random length, `row` metres a row.
pub fn small_print(u: f32, v: f32, row: f32, seed: u32) -> bool {
    let line = (v / row).floor();
    let inside = (v / row - line) < 0.55;
    let letter = (u / (row * 0.45)).floor();
    inside && lattice(letter as i32, line as i32, 5, seed) > 0.3 && (u / (row * 0.45) - letter) < 0.75
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_read_left_to_right_and_upright() {
        // "L": a full left column and a foot that goes to the right.
        assert!(word(0.1, 0.9, "L") && word(0.1, 0.1, "L") && word(0.5, 0.1, "L"));
        assert!(!word(0.5, 0.9, "L") && !word(0.7, 0.1, "L"));
    }

    #[test]
    fn hues_are_where_painters_put_them() {
        assert_eq!(hue(0.0, 1.0, 1.0), [1.0, 0.0, 0.0]);
        let blue = hue(2.0 / 3.0, 1.0, 1.0);
        assert!(blue[2] > 0.99 && blue[0] < 0.01);
    }
}
