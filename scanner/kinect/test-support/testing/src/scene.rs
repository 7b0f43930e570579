//! What the simulated Kinects see: the same pixels for the bus that sends them and the test that waits for them.

/// Columns of the images.
pub const WIDTH: usize = 640;
/// Rows of the images.
pub const HEIGHT: usize = 480;

/// Registration numbers as a device stores them, in its order, of the size that real ones have: colour and depth camera
/// are shifted by some twenty pixels and differ in scale and distortion.
pub const REGISTRATION: [i32; 29] = [
    2_048_000_000,
    1900,
    60,
    -30,
    580,
    5200,
    -15,
    2800,
    660,
    8,
    5900,
    10_000,
    130_800,
    0,
    0,
    170,
    136,
    2_095_900,
    870,
    740,
    2_096_400,
    134_215_500,
    134_217_100,
    134_217_000,
    134_216_900,
    0,
    134_217_000,
    0,
    134_214_700,
];

/// Raw depth of image `index`: a wall that leans, a box before it, noise, holes, and pixels beyond all that is measured.
pub fn raw_depth(index: u32) -> Vec<u16> {
    let shift = index as usize;
    let pixel = |i: usize| {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let noise = (x * 7 + y * 13 + shift * 31) % 5;
        match () {
            () if (x / 3 + y + shift).is_multiple_of(97) => 2047,
            () if (x + 3 * y + shift).is_multiple_of(211) => 1060 + (x % 24) as u16,
            () if (200 + shift..360 + shift).contains(&x) && (150..300).contains(&y) => {
                (560 + noise + y / 8) as u16
            }
            () => (700 + x / 4 + y / 3 + noise) as u16,
        }
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}

/// Colour of the area that [`bayer`] fills evenly.
pub fn even_color(index: u32) -> [u8; 3] {
    [200, 120, 40 + (index % 64) as u8]
}

/// The colour chip's pixels of picture `index`: rows of green and red, and of blue and green. The left half is of one
/// colour, the right half differs from pixel to pixel.
pub fn bayer(index: u32, width: usize, height: usize) -> Vec<u8> {
    let [red, green, blue] = even_color(index);
    let pixel = |i: usize| {
        let (x, y) = (i % width, i / width);
        match (x < width / 2, y.is_multiple_of(2), x.is_multiple_of(2)) {
            (false, ..) => (x * 3 + y * 5 + index as usize * 11) as u8,
            (true, true, true) | (true, false, false) => green,
            (true, true, false) => red,
            (true, false, true) => blue,
        }
    };
    (0..width * height).map(pixel).collect()
}

/// A picture as a dump stores it.
pub fn picture(index: u32) -> Vec<[u8; 3]> {
    let pixel = |i: usize| {
        let (x, y) = (i % WIDTH, i / WIDTH);
        [(x + index as usize) as u8, (y * 3) as u8, (x * y + index as usize * 17) as u8]
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}
