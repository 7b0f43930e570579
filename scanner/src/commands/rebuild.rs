//! `scan-product rebuild`: an old recording through the present pipeline, with the older result kept aside.

use std::path::{Path, PathBuf};

use anyhow::Context;

use super::build;
use crate::recording::Recording;
use crate::result::FILES;
use crate::ui::Ui;

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
A recording keeps every raw picture, so a later version of this program can make a better model of it.
An older result in the folder is kept beside it, as OUT.before, OUT.before-2 and so on.

Examples:
  scan-product rebuild ~/scans/2026-11-22-1 --out ~/scans/2026-11-22-1/model")]
pub struct Args {
    /// Folder of the recording
    pub recording: PathBuf,
    /// Folder for the result
    #[arg(short, long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Builds; the exit status is the build's.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    // Looked at first: a recording that cannot be read moves nothing.
    Recording::open(&args.recording)?;
    if FILES.iter().any(|name| args.out.join(name).is_file()) {
        let kept = keep_aside(&args.out)?;
        ui.note(&format!("the older result is kept in {}", kept.display()));
    }
    build::run(&build::Args::of(args.recording.clone(), args.out.clone()), ui)
}

/// Copies the files of a result into a new folder beside it.
fn keep_aside(out: &Path) -> anyhow::Result<PathBuf> {
    let out = out.canonicalize().with_context(|| format!("cannot open {}", out.display()))?;
    let name = out.file_name().context("name a folder for the result, not the root of the disk")?;
    let beside = |number: usize| {
        let mut name = name.to_owned();
        name.push(if number == 1 { ".before".to_owned() } else { format!(".before-{number}") });
        out.with_file_name(name)
    };
    let folder = (1..10_000).map(beside).find(|folder| !folder.exists()).context("no folder name is free")?;
    let owned: Vec<&str> = FILES.to_vec();
    let dir = crate::output::OutputDir::begin(&folder, &owned)?;
    for name in FILES.iter().filter(|name| out.join(name).is_file()) {
        let bytes = std::fs::read(out.join(name))
            .with_context(|| format!("cannot read {name} of the older result"))?;
        dir.write(name, &bytes)?;
    }
    dir.commit()?;
    Ok(folder)
}
