//! PNG and JPEG pictures.
#![no_main]

use libfuzzer_sys::fuzz_target;
use reconstruct::image::{ColorImage, DepthImage};
use scanner::pictures;

/// A grey JPEG of one block, written by hand: tables, frame, scan of one flat block.
const JPEG: &[u8] = b"\xff\xd8\xff\xdb\x00\x43\x00\x10\x0b\x0c\x0e\x0c\x0a\x10\x0e\x0d\x0e\x12\x11\x10\x13\x18\x28\x1a\x18\x16\x16\
\x18\x31\x23\x25\x1d\x28\x3a\x33\x3d\x3c\x39\x33\x38\x37\x40\x48\x5c\x4e\x40\x44\x57\x45\x37\x38\x50\x6d\x51\x57\x5f\x62\x67\
\x68\x67\x3e\x4d\x71\x79\x70\x64\x78\x5c\x65\x67\x63\xff\xc0\x00\x0b\x08\x00\x08\x00\x08\x01\x01\x11\x00\xff\xc4\x00\x14\x00\
\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\xff\xc4\x00\x14\x10\x01\x00\x00\x00\x00\x00\x00\x00\x00\
\x00\x00\x00\x00\x00\x00\x00\x00\xff\xda\x00\x08\x01\x01\x00\x00\x3f\x00\x3f\xff\xd9";

fn seeds() -> Vec<Vec<u8>> {
    let data = (0..64).map(|i| [i as u8, 255 - i as u8, (i * 3) as u8]).collect();
    let color = ColorImage { width: 8, height: 8, data };
    let data = (0..64).map(|i| i * 999).collect();
    let depth = DepthImage { width: 8, height: 8, data, units_per_metre: 1000.0 };
    let written = [
        pictures::encode_color(&color),
        pictures::encode_depth(&depth),
        pictures::encode_small(&color, 1 << 20),
    ];
    let mut seeds: Vec<Vec<u8>> =
        written.into_iter().map(|bytes| bytes.expect("memory takes everything")).collect();
    seeds.push(JPEG.to_vec());
    seeds
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| {
    let Ok(size) = pictures::size(data) else { return };
    // Large pictures are slow, not wrong.
    if size.width * size.height > 1 << 16 {
        return;
    }
    if let Ok(image) = pictures::decode_color(data, size.width, size.height) {
        assert_eq!(image.data.len(), size.width * size.height);
    }
    if let Ok(image) = pictures::decode_depth(data, size.width, size.height, 1000.0) {
        assert_eq!(image.data.len(), size.width * size.height);
    }
});
