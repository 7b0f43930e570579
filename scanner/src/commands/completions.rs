//! `scan-product completions SHELL`.

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
    generate(args.shell, &mut Cli::command(), "scan-product", &mut std::io::stdout());
    Ok(DONE)
}
