//! `scan-product resume`: goes on with a recording that was not finished.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use anyhow::{Context, bail};

use super::capture::{DaemonArgs, options, scans_folder};
use crate::capture;
use crate::cli::DONE;
use crate::ui::Ui;

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Every view that was confirmed is there, also after a crash or a power cut; what was left of a view in work is removed.

Examples:
  scan-product resume                            the latest recording in the folder of the scans
  scan-product resume ~/scans/2026-11-22-1")]
pub struct Args {
    /// Folder of the recording, or a folder of recordings whose latest is meant [default: `scans` in the home folder]
    pub folder: Option<PathBuf>,
    /// Where and how it listens
    #[command(flatten)]
    pub daemon: DaemonArgs,
    /// Sensor to go on with, where it is not to be found by itself
    #[arg(long, value_name = "ADDRESS")]
    pub sensor: Option<String>,
}

/// Runs until it is told to end.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let named = args.folder.clone().map_or_else(scans_folder, Ok)?;
    let folder = recording_in(&named)?;
    let home = folder.parent().map_or_else(|| PathBuf::from("."), Path::to_owned);
    let mut options = options(&args.daemon, args.sensor.clone(), home);
    options.resume = Some(folder);
    capture::run(&options, ui)?;
    Ok(DONE)
}

/// The folder itself where it holds a recording, else the recording in it that was changed last.
fn recording_in(named: &Path) -> anyhow::Result<PathBuf> {
    let named = named.canonicalize().with_context(|| format!("cannot open {}", named.display()))?;
    if named.join("recording.json").is_file() {
        return Ok(named);
    }
    let changed = |folder: &Path| -> Option<SystemTime> {
        folder.join("recording.json").metadata().and_then(|file| file.modified()).ok()
    };
    let folders = std::fs::read_dir(&named).with_context(|| format!("cannot read {}", named.display()))?;
    let folders = folders.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    match folders.filter_map(|folder| Some((changed(&folder)?, folder))).max() {
        Some((_, folder)) => Ok(folder),
        None => {
            bail!("there is no recording in {}; name the folder that holds recording.json", named.display())
        }
    }
}
