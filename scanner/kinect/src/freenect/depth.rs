//! Raw 11-bit depth of a Kinect: to millimetres by the device's own constants, and into the colour camera's geometry.
//!
//! The device counts in shifts of its infrared pattern. With the reference plane's distance `d` and pixel `p`, the
//! projector's distance `e` (centimetres and millimetres as the device gives them) and the constant shift `c`,
//! `m = (raw / 4 - c - 0.375) p` and the depth is `10 (m d / (e - m) + d)` mm. Where a depth pixel lies in the colour
//! picture is a polynomial of third degree in its column and row, stored as differences, plus a shift along the row that
//! depends on the depth alone. All of it in fixed-point arithmetic, because the device's makers meant it so.

use reconstruct::camera::Intrinsics;

/// The colour camera's focal length as everybody takes it, pixels of 640 x 480; units differ by a few percent.
const FOCAL: f64 = 525.0;
/// Columns of both images.
pub const WIDTH: usize = 640;
/// Rows of both images.
pub const HEIGHT: usize = 480;
/// Raw values there can be.
const RAW_VALUES: usize = 2048;
/// The raw value that says nothing was measured.
const NO_RAW: usize = 2047;
/// Millimetres from which on the values are noise; the counter wraps to nonsense soon after.
pub const FARTHEST: u16 = 10_000;

/// Parts of a pixel in which columns are counted.
const PARTS: i32 = 256;
/// Sensor pixels a depth pixel.
const BINNING: f64 = 2.0;
/// Half a pixel, as the makers round.
const ROUNDING: f64 = 0.375;

/// What a device says of its geometry.
#[derive(Debug, Clone, PartialEq)]
pub struct Constants {
    /// Projector to infrared camera, centimetres.
    pub emitter_cm: f32,
    /// Infrared to colour camera, centimetres.
    pub color_camera_cm: f32,
    /// Distance of the reference plane, millimetres times ten.
    pub reference_distance: f32,
    /// A sensor pixel on the reference plane, millimetres.
    pub reference_pixel: f32,
    /// Shift of the reference plane.
    pub constant_shift: f64,
    /// Rows by which the colour picture is padded at the top.
    pub start_lines: u16,
    /// Where depth pixels lie along the colour picture's rows.
    pub across: Polynomial,
    /// Where depth pixels lie along the colour picture's columns.
    pub down: Polynomial,
}

/// A polynomial of third degree over the image as start values and constant third differences, as the device stores it.
/// `x` counts columns, `y` rows: `dxdy` is the difference along a row of the difference along a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Polynomial {
    /// Value at the first pixel.
    pub start: i32,
    /// First difference along the row.
    pub dx: i32,
    /// First difference along the column.
    pub dy: i32,
    /// Second differences.
    pub dxdx: i32,
    /// Second differences.
    pub dydx: i32,
    /// Second differences.
    pub dydy: i32,
    /// Third difference along the row.
    pub third_xxx: i32,
    /// Third difference, twice along the row and once along the column.
    pub third_xxy: i32,
    /// Third difference, once along the row and twice along the column.
    pub third_xyy: i32,
    /// Third difference along the column.
    pub third_yyy: i32,
}

impl Default for Constants {
    /// A common unit's; for recordings that do not say which unit made them.
    fn default() -> Self {
        Self {
            emitter_cm: 7.5,
            color_camera_cm: 2.4,
            reference_distance: 120.0,
            reference_pixel: 0.1042,
            constant_shift: 200.0,
            start_lines: 0,
            across: Polynomial {
                start: 6000,
                dx: -1150,
                dy: 740,
                dxdx: -2200,
                dydx: -600,
                dydy: -700,
                third_xxx: 1900,
                third_xxy: -30,
                third_xyy: 580,
                third_yyy: 60,
            },
            down: Polynomial {
                start: 6300,
                dx: 870,
                dy: -750,
                dxdx: -700,
                dydx: -800,
                dydy: -3000,
                third_xxx: -15,
                third_xxy: 660,
                third_xyy: 8,
                third_yyy: 2800,
            },
        }
    }
}

impl Constants {
    /// The colour camera that the device's makers had in mind: the pinhole whose picture of the infrared camera's rays fits
    /// the table best in its middle, where lenses bend least. The infrared camera's own axis is taken to go through the
    /// middle of its image. `None` where the numbers are no Kinect's.
    pub fn color_camera(&self) -> Option<Intrinsics> {
        let (across, down) = (self.across.table(), self.down.table());
        // A point infinitely far is shifted by the distance of the cameras alone.
        let far = f64::from(self.color_camera_cm) / (f64::from(self.reference_pixel) * BINNING) + ROUNDING;
        let (middle_x, middle_y) = ((WIDTH - 1) as f64 / 2.0, (HEIGHT - 1) as f64 / 2.0);
        let (mut sum, mut slope, mut square, mut count) = ([0.0; 2], [0.0; 2], [0.0; 2], 0.0);
        for y in HEIGHT / 4..HEIGHT * 3 / 4 {
            for x in WIDTH / 4..WIDTH * 3 / 4 {
                let i = y * WIDTH + x;
                let target = [x as f64 + across[i] + 1.0 + far, y as f64 + down[i] + 1.0];
                let offset = [x as f64 - middle_x, y as f64 - middle_y];
                for axis in 0..2 {
                    sum[axis] += target[axis];
                    slope[axis] += offset[axis] * target[axis];
                    square[axis] += offset[axis] * offset[axis];
                }
                count += 1.0;
            }
        }
        let focal = f64::from(self.reference_distance) / (BINNING * f64::from(self.reference_pixel));
        let [fx, fy] = [focal * slope[0] / square[0], focal * slope[1] / square[1]];
        let [cx, cy] = sum.map(|sum| sum / count);
        let near = |value: f64, middle: f64| (value - middle).abs() < 40.0;
        let is_kinect = near(fx, FOCAL) && near(fy, FOCAL) && near(cx, middle_x) && near(cy, middle_y);
        is_kinect.then(|| Intrinsics::pinhole(WIDTH as u32, HEIGHT as u32, fx, fy, cx, cy))
    }
}

impl Polynomial {
    /// Values at all pixels, row by row, pixels.
    fn table(&self) -> Vec<f64> {
        // The device's numbers have fewer than 32 bits: shifting left drops what is above, shifting back restores the sign.
        let first = |value: i32| i64::from((value << 11) >> 3);
        let second = |value: i32| i64::from((value << 5) << 3);
        let mut value = i64::from((self.start << 13) >> 4);
        let (mut along, mut down) = (first(self.dx), first(self.dy));
        let (mut along2, mut mixed, mut down2) = (second(self.dxdx), second(self.dydx), second(self.dydy));
        let mut table = Vec::with_capacity(WIDTH * HEIGHT);
        for _ in 0..HEIGHT {
            along2 += i64::from(self.third_xxy);
            along += mixed >> 8;
            mixed += i64::from(self.third_xyy);
            value += down >> 6;
            down += down2 >> 8;
            down2 += i64::from(self.third_yyy);
            let (mut here, mut step, mut step2) = (value, along, along2);
            for _ in 0..WIDTH {
                table.push(here as f64 / f64::from(1 << 17));
                here += step >> 6;
                step += step2 >> 8;
                step2 += i64::from(self.third_xxx);
            }
        }
        table
    }
}

/// Tables for one device.
#[derive(Debug, Clone)]
pub struct Mapping {
    millimetres: Vec<u16>,
    shift: Vec<i32>,
    target: Vec<[i32; 2]>,
    offset: usize,
}

impl Mapping {
    /// Works the tables out.
    pub fn new(constants: &Constants) -> Self {
        let mut millimetres: Vec<u16> = (0..RAW_VALUES).map(|raw| to_millimetres(raw, constants)).collect();
        millimetres[NO_RAW] = 0;
        let shift = (0..FARTHEST).map(|depth| shift_at(depth, constants)).collect();
        let (across, down) = (constants.across.table(), constants.down.table());
        let target =
            across.iter().zip(&down).enumerate().map(|(i, (dx, dy))| target_of(i, *dx, *dy)).collect();
        Self { millimetres, shift, target, offset: HEIGHT * usize::from(constants.start_lines) }
    }

    /// Depth in the infrared camera's geometry, millimetres; 0 = nothing measured. Values above 2047 cannot be and are none.
    pub fn millimetres(&self, raw: &[u16]) -> Vec<u16> {
        raw.iter().map(|&raw| self.depth_of(raw)).collect()
    }

    /// Depth in the colour camera's geometry (640 x 480), millimetres; 0 = nothing measured there. The nearest wins.
    pub fn registered(&self, raw: &[u16]) -> Vec<u16> {
        let mut out = vec![0u16; WIDTH * HEIGHT];
        for (&raw, &[column, row]) in raw.iter().zip(&self.target) {
            let depth = self.depth_of(raw);
            if depth == 0 {
                continue;
            }
            let column = column.saturating_add(self.shift[usize::from(depth)]) / PARTS;
            if !(0..WIDTH as i32).contains(&column) || row < 0 {
                continue;
            }
            let target = (row as usize * WIDTH + column as usize).checked_sub(self.offset);
            if let Some(pixel) = target.and_then(|target| out.get_mut(target))
                && (*pixel == 0 || *pixel > depth)
            {
                *pixel = depth;
            }
        }
        out
    }

    fn depth_of(&self, raw: u16) -> u16 {
        let depth = self.millimetres.get(usize::from(raw)).copied().unwrap_or(0);
        if depth < FARTHEST { depth } else { 0 }
    }
}

fn to_millimetres(raw: usize, constants: &Constants) -> u16 {
    let (distance, emitter) = (f64::from(constants.reference_distance), f64::from(constants.emitter_cm));
    let shift = (raw as f64 - 4.0 * constants.constant_shift) / 4.0 - ROUNDING;
    let metric = shift * f64::from(constants.reference_pixel);
    let depth = 10.0 * (metric * distance / (emitter - metric) + distance);
    // Beyond infinity the formula turns negative and the library's own number wraps: nothing measured, either way.
    if (0.0..f64::from(u16::MAX)).contains(&depth) { depth as u16 } else { 0 }
}

/// How far along the row a point lies in the colour picture for its depth alone, parts of a pixel.
fn shift_at(depth: u16, constants: &Constants) -> i32 {
    if depth == 0 {
        return 0;
    }
    let pixels = 1.0 / (f64::from(constants.reference_pixel) * BINNING * 10.0);
    let cameras = f64::from(constants.color_camera_cm) * pixels * 10.0;
    let reference = f64::from(constants.reference_distance) * pixels * 10.0;
    let here = f64::from(depth) * pixels;
    ((cameras * (here - reference) / here + ROUNDING) * f64::from(PARTS)) as i32
}

/// Column in parts and row of a depth pixel in the colour picture, without the shift.
fn target_of(index: usize, dx: f64, dy: f64) -> [i32; 2] {
    let (column, row) = ((index % WIDTH) as f64 + dx + 1.0, (index / WIDTH) as f64 + dy + 1.0);
    let inside = (0.0..WIDTH as f64).contains(&column) && (0.0..HEIGHT as f64).contains(&row);
    // So far to the right that no shift brings it back.
    let column = if inside { column } else { 2.0 * WIDTH as f64 };
    [(column * f64::from(PARTS)) as i32, row as i32]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device whose cameras differ by a shift alone.
    fn flat() -> Constants {
        Constants { across: Polynomial::default(), down: Polynomial::default(), ..Constants::default() }
    }

    #[test]
    fn the_colour_camera_by_the_table() {
        let camera = Constants::default().color_camera().unwrap();
        assert!((camera.fx - 528.0).abs() < 4.0 && (camera.fy - 527.0).abs() < 4.0, "{camera:?}");
        assert!((camera.cx - 336.0).abs() < 4.0 && (camera.cy - 252.0).abs() < 4.0, "{camera:?}");
        assert_eq!(flat().color_camera(), None);
        assert_eq!(Constants { reference_pixel: 0.0, ..Constants::default() }.color_camera(), None);
        assert_eq!(Constants { color_camera_cm: f32::NAN, ..Constants::default() }.color_camera(), None);
    }

    /// The library's own table for the typical constants.
    #[test]
    fn raw_values_as_millimetres() {
        let mapping = Mapping::new(&Constants::default());
        for (raw, depth) in
            [(300, 437), (500, 586), (700, 887), (900, 1824), (1000, 3864), (2047, 0), (1084, 0)]
        {
            assert_eq!(mapping.millimetres(&[raw]), [depth], "{raw}");
        }
        let all: Vec<u16> = (0..u16::MAX).collect();
        assert!(mapping.millimetres(&all).iter().all(|&depth| depth < FARTHEST));
        let near = &mapping.millimetres(&all)[..1000];
        assert!(near.windows(2).all(|pair| pair[0] <= pair[1]));
    }

    #[test]
    fn a_wall_moves_as_a_whole() {
        let mapping = Mapping::new(&flat());
        let wall = mapping.registered(&vec![700; WIDTH * HEIGHT]);
        let measured = wall.iter().filter(|&&depth| depth == 887).count();
        assert_eq!(measured, wall.iter().filter(|&&depth| depth > 0).count());
        // A few columns at one side and the first row have no partner.
        assert!(measured > WIDTH * HEIGHT * 98 / 100, "{measured}");
    }

    #[test]
    fn the_nearer_one_hides_the_farther() {
        let mapping = Mapping::new(&flat());
        let mut raw = vec![900; WIDTH * HEIGHT];
        for (i, raw) in raw.iter_mut().enumerate() {
            if (300..340).contains(&(i % WIDTH)) {
                *raw = 500;
            }
        }
        let out = mapping.registered(&raw);
        let row = &out[200 * WIDTH..201 * WIDTH];
        assert_eq!(row.iter().filter(|&&depth| depth == 586).count(), 40);
        // What the near part uncovers was never measured.
        assert!(row[280..360].contains(&0));
    }

    #[test]
    fn no_table_leads_out_of_the_image() {
        let wild =
            Polynomial { start: i32::MAX, dx: i32::MIN, dydy: 12345, third_xyy: -1, ..Polynomial::default() };
        let constants = Constants {
            across: wild,
            down: wild,
            start_lines: u16::MAX,
            emitter_cm: f32::NAN,
            color_camera_cm: f32::INFINITY,
            ..Constants::default()
        };
        let out = Mapping::new(&constants).registered(&vec![600; WIDTH * HEIGHT]);
        assert!(out.iter().all(|&depth| depth < FARTHEST));
    }
}
