//! GLB models.
#![no_main]

use libfuzzer_sys::fuzz_target;
use reconstruct::model_file::{Kind, glb};

fn seeds() -> Vec<Vec<u8>> {
    let mut seeds: Vec<Vec<u8>> = Vec::new();
    for mesh in &fuzz::models() {
        let mut out = Vec::new();
        glb::write(mesh, &mut out).expect("memory takes everything");
        seeds.push(out);
    }
    seeds
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| fuzz::read_model(Kind::Glb, data));
