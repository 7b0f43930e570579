//! Dumps of libfreenect: the index and both kinds of pictures.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scanner::import::fakenect;

fn seeds() -> Vec<Vec<u8>> {
    let index = "a-1000.1-4294000000.dump\nd-1000.100000-4294000000.pgm\nr-1000.12-1032704.ppm\n";
    let depth = [b"P5 4 3 65535\n".as_slice(), [0x2c, 0x01].repeat(12).as_slice()].concat();
    let color = [b"P6 4 3 255 \n".as_slice(), [7; 36].as_slice()].concat();
    vec![index.as_bytes().to_vec(), depth, color]
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| {
    if let Ok(entries) = fakenect::parse_index(&String::from_utf8_lossy(data)) {
        assert!(entries.iter().all(|entry| !entry.name.contains(['/', '\\'])));
    }
    if let Ok(image) = fakenect::parse_color(data) {
        assert_eq!(image.data.len(), image.width * image.height);
    }
    if let Ok((width, height, raw)) = fakenect::parse_depth(data) {
        assert!(raw.len() == width * height && raw.iter().all(|&raw| raw <= 2047));
    }
});
