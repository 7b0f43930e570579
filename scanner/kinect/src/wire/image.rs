//! Images on the wire: width, height, lost packets (u32), time (u64), units in a metre (f64), then the pixels, all
//! little-endian.

use std::io::{self, Read, Write};

use reconstruct::image::{ColorImage, DepthImage};

use super::{MOST_IMAGE, MOST_PIXELS, Stamped, nonsense, write_head};

const HEAD: usize = 28;

struct Head {
    width: u32,
    height: u32,
    lost_packets: u32,
    timestamp_nanos: u64,
    units_per_metre: f64,
}

pub(super) fn write_color(
    out: &mut impl Write,
    kind: u8,
    Stamped { image, timestamp_nanos, lost_packets }: &Stamped<ColorImage>,
) -> io::Result<()> {
    write_pixels(out, kind, image, *timestamp_nanos, *lost_packets)
}

pub(super) fn write_still(out: &mut impl Write, kind: u8, image: &ColorImage) -> io::Result<()> {
    write_pixels(out, kind, image, 0, 0)
}

fn write_pixels(
    out: &mut impl Write,
    kind: u8,
    image: &ColorImage,
    timestamp_nanos: u64,
    lost: u32,
) -> io::Result<()> {
    let head = Head::new(image.width, image.height, lost, timestamp_nanos, 0.0)?;
    write_image(out, kind, &head, image.data.as_flattened())
}

pub(super) fn write_depth(out: &mut impl Write, kind: u8, depth: &Stamped<DepthImage>) -> io::Result<()> {
    let image = &depth.image;
    let (lost, time) = (depth.lost_packets, depth.timestamp_nanos);
    let head = Head::new(image.width, image.height, lost, time, image.units_per_metre)?;
    let mut bytes = vec![0u8; image.data.len() * 2];
    for (pair, value) in bytes.as_chunks_mut().0.iter_mut().zip(&image.data) {
        *pair = value.to_le_bytes();
    }
    write_image(out, kind, &head, &bytes)
}

fn write_image(out: &mut impl Write, kind: u8, head: &Head, pixels: &[u8]) -> io::Result<()> {
    write_head(out, kind, HEAD + pixels.len(), MOST_IMAGE)?;
    out.write_all(&head.to_bytes())?;
    out.write_all(pixels)
}

pub(super) fn read_color(input: &mut impl Read, length: u32) -> io::Result<Stamped<ColorImage>> {
    let head = Head::read(input, length, 3)?;
    let mut data = vec![[0u8; 3]; head.pixels()];
    input.read_exact(data.as_flattened_mut())?;
    let image = ColorImage { width: head.width as usize, height: head.height as usize, data };
    Ok(Stamped { image, timestamp_nanos: head.timestamp_nanos, lost_packets: head.lost_packets })
}

pub(super) fn read_depth(input: &mut impl Read, length: u32) -> io::Result<Stamped<DepthImage>> {
    let head = Head::read(input, length, 2)?;
    if !(1.0..=1e6).contains(&head.units_per_metre) {
        return Err(nonsense("depth in no unit"));
    }
    let mut bytes = vec![0u8; head.pixels() * 2];
    input.read_exact(&mut bytes)?;
    let data = bytes.as_chunks().0.iter().map(|&pair| u16::from_le_bytes(pair)).collect();
    let (width, height, units_per_metre) = (head.width as usize, head.height as usize, head.units_per_metre);
    let image = DepthImage { width, height, data, units_per_metre };
    Ok(Stamped { image, timestamp_nanos: head.timestamp_nanos, lost_packets: head.lost_packets })
}

impl Head {
    fn new(width: usize, height: usize, lost: u32, timestamp_nanos: u64, units: f64) -> io::Result<Self> {
        let side = |side: usize| {
            let side = u32::try_from(side).ok().filter(|side| (1..=MOST_PIXELS).contains(side));
            side.ok_or_else(|| nonsense("an image of no size or too large"))
        };
        let (width, height) = (side(width)?, side(height)?);
        Ok(Self { width, height, lost_packets: lost, timestamp_nanos, units_per_metre: units })
    }

    fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    fn to_bytes(&self) -> [u8; HEAD] {
        let mut bytes = [0u8; HEAD];
        bytes[0..4].copy_from_slice(&self.width.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.height.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.lost_packets.to_le_bytes());
        bytes[12..20].copy_from_slice(&self.timestamp_nanos.to_le_bytes());
        bytes[20..28].copy_from_slice(&self.units_per_metre.to_le_bytes());
        bytes
    }

    /// Reads a head and makes sure that the body's length is that of its pixels.
    fn read(input: &mut impl Read, length: u32, bytes_a_pixel: usize) -> io::Result<Self> {
        fn number<const N: usize>(input: &mut impl Read) -> io::Result<[u8; N]> {
            let mut bytes = [0u8; N];
            input.read_exact(&mut bytes).map(|()| bytes)
        }
        let width = u32::from_le_bytes(number(input)?);
        let height = u32::from_le_bytes(number(input)?);
        let lost_packets = u32::from_le_bytes(number(input)?);
        let timestamp_nanos = u64::from_le_bytes(number(input)?);
        let units_per_metre = f64::from_le_bytes(number(input)?);
        let head = Self { width, height, lost_packets, timestamp_nanos, units_per_metre };
        let possible = [width, height].iter().all(|side| (1..=MOST_PIXELS).contains(side));
        if !possible || length > MOST_IMAGE || length as usize != HEAD + head.pixels() * bytes_a_pixel {
            return Err(nonsense(format!("an image of {width} x {height} pixels in {length} bytes")));
        }
        Ok(head)
    }
}
