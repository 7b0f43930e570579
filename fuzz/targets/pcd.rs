//! PCD models.
#![no_main]

use libfuzzer_sys::fuzz_target;
use reconstruct::model_file::{Kind, pcd};

fn seeds() -> Vec<Vec<u8>> {
    let mut seeds: Vec<Vec<u8>> = vec![
        b"VERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n\
          1 2 3 255\nnan nan nan 0\n"
            .to_vec(),
        b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nDATA binary_compressed\n\
          \x05\0\0\0\x0c\0\0\0\x00a\xe0\x02\x00"
            .to_vec(),
    ];
    for mesh in &fuzz::models() {
        let mut out = Vec::new();
        pcd::write(&mesh.vertices, &mut out).expect("memory takes everything");
        seeds.push(out);
    }
    seeds
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| fuzz::read_model(Kind::Pcd, data));
