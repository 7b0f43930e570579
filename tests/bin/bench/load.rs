//! Reading files: bytes on the disk (in the system's cache) to points in memory.

use reconstruct::model_file::Kind;

use crate::clock::Bench;
use crate::inputs::cloud;

/// Files as the peers read them; text holds whatever unit it holds.
const FILES: [&str; 6] = [
    "tsdf/scene0.pcd",
    "tsdf/scene0_ascii.pcd",
    "tsdf/scene0.ply",
    "tsdf/scene0.asc",
    "tsdf/scene0.xyz",
    "real/milk_cartoon_all_small_clorox.pcd",
];

pub(crate) fn run(bench: &Bench) -> anyhow::Result<()> {
    let whole = cloud(&bench.data.join("tsdf/scene0.pcd"))?;
    for file in FILES {
        let path = bench.data.join(file);
        if !path.exists() {
            continue;
        }
        // Our reader takes text for millimetres.
        let unit = if Kind::from_name(file) == Some(Kind::Asc) { 1000.0 } else { 1.0 };
        bench.stage(
            &format!("load {file}"),
            || cloud(&path),
            |read| match read {
                Err(error) => format!("failed: {error}"),
                Ok(read) if file.starts_with("real") => format!("n={}", read.len()),
                Ok(read) => {
                    let pairs = read.points.iter().flatten().zip(whole.points.iter().flatten());
                    let worst = pairs.map(|(a, b)| (a * unit - b).abs()).fold(0.0, f32::max);
                    format!("n={} worst={:.3}um", read.len(), worst * 1e6)
                }
            },
        );
    }
    Ok(())
}
