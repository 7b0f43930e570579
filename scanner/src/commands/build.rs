//! `scan-product build`.

use std::path::PathBuf;

use crate::cli::{DONE, NO_GOOD_SCAN};
use crate::config::{Config, Method};
use crate::pipeline;
use crate::recording::Recording;
use crate::ui::Ui;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the recording: recording.json, its pictures, and board.json
    pub recording: PathBuf,
    /// Folder for the result
    #[arg(short, long)]
    pub out: PathBuf,
    /// How the views are brought together
    #[arg(long, value_enum, default_value_t)]
    pub method: Method,
    /// Place the views by their surfaces alone, without the marker board
    #[arg(long)]
    pub no_board: bool,
    /// Seed of every random choice: the same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// Runs the command.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let recording = Recording::open(&args.recording)?;
    let config =
        Config { method: args.method, no_board: args.no_board, seed: args.seed, ..Config::default() };
    let scan = pipeline::build(&recording, &config, ui)?;
    std::fs::create_dir_all(&args.out)?;
    let mut ply = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n", scan.cloud.len()).into_bytes();
    for i in 0..scan.cloud.len() {
        for v in scan.cloud.points[i].iter().chain(&scan.cloud.normals[i]) {
            ply.extend(v.to_le_bytes());
        }
        ply.extend(scan.cloud.colors[i]);
    }
    std::fs::write(args.out.join("model.ply"), ply)?;
    std::fs::write(args.out.join("report.json"), serde_json::to_string_pretty(&scan.report)?)?;
    Ok(if scan.cloud.is_empty() { NO_GOOD_SCAN } else { DONE })
}
