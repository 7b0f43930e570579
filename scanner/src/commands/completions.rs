//! `scan-product completions SHELL`.

use std::io::Write;

use clap::CommandFactory;
use clap_complete::{Shell, generate};

use crate::cli::{Cli, DONE};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Shell to complete in
    pub shell: Shell,
}

/// Prints the completion script to standard output.
pub fn run(args: &Args) -> anyhow::Result<u8> {
    let mut script = Vec::new();
    generate(args.shell, &mut Cli::command(), "scan-product", &mut script);
    // A closed pipe is the reader's choice, not an error of ours.
    let _ = std::io::stdout().write_all(&script);
    Ok(DONE)
}
