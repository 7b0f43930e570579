//! What the sensor sees: pictures that are known for every frame and show the state the sensor is in.

/// Pixels a row.
pub const WIDTH: usize = 640;
/// Rows.
pub const HEIGHT: usize = 480;
/// Depth is this much larger where it is not registered to colour, millimetres.
pub const UNREGISTERED_MM: u16 = 1000;

/// Depth in millimetres of frame `index`, registered to colour, not mirrored; 0 = nothing measured.
pub fn depth(index: u32) -> Vec<u16> {
    let pixel = |i: usize| {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let hole = (x ^ y) & 31 == 0;
        if hole { 0 } else { 500 + ((x * 7 + y * 13 + index as usize * 31) % 2500) as u16 }
    };
    let mut depth: Vec<u16> = (0..WIDTH * HEIGHT).map(pixel).collect();
    depth[0] = (index % 60_000) as u16;
    depth
}

/// Colour of frame `index`, not mirrored; the first pixel says the frame's number and what is automatic.
pub fn color(index: u32, auto_exposure: bool, auto_white_balance: bool) -> Vec<[u8; 3]> {
    let pixel = |i: usize| {
        let (x, y) = (i % WIDTH, i / WIDTH);
        [(x + index as usize) as u8, (y * 3) as u8, (x + y + index as usize * 17) as u8]
    };
    let mut color: Vec<[u8; 3]> = (0..WIDTH * HEIGHT).map(pixel).collect();
    color[0] = [index as u8, auto_exposure.into(), auto_white_balance.into()];
    color
}
