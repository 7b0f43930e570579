//! ASC models.
#![no_main]

use libfuzzer_sys::fuzz_target;
use reconstruct::model_file::{Kind, asc};

fn seeds() -> Vec<Vec<u8>> {
    let mut seeds: Vec<Vec<u8>> = vec![b"# comment\nx,y,z\n12\n1,2;3\t4 5 6 7\r\n".to_vec()];
    for mesh in &fuzz::models() {
        let mut out = Vec::new();
        asc::write(&mesh.vertices, &mut out).expect("memory takes everything");
        seeds.push(out);
    }
    seeds
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| fuzz::read_model(Kind::Asc, data));
