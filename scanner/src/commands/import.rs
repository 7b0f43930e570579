//! `scan-product import`.

use crate::ui::Ui;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Runs the command.
pub fn run(_args: &Args, _ui: &Ui) -> anyhow::Result<u8> {
    anyhow::bail!("not there yet")
}
