//! PLY models.
#![no_main]

use libfuzzer_sys::fuzz_target;
use reconstruct::model_file::{Kind, ply};

fn seeds() -> Vec<Vec<u8>> {
    let mut seeds: Vec<Vec<u8>> = vec![
        b"ply\nformat ascii 1.0\ncomment c\nelement vertex 3\nproperty float x\nproperty double y\nproperty short z\n\
          property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
          property list uchar int vertex_indices\nend_header\n1 2 3 4 5 6\n1 2 3 4 5 6\n0 0 0 0 0 0\n3 0 1 2\n"
            .to_vec(),
        b"ply\nformat binary_big_endian 1.0\nelement other 1\nproperty list uint char k\nelement vertex 1\n\
          property char x\nproperty char y\nproperty char z\nend_header\n\0\0\0\x02ab123"
            .to_vec(),
    ];
    for mesh in &fuzz::models() {
        let mut out = Vec::new();
        ply::write(mesh, &mut out).expect("memory takes everything");
        seeds.push(out);
    }
    seeds
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| fuzz::read_model(Kind::Ply, data));
