//! `scan-product`: parse, run, exit status.

use std::process::ExitCode;

use clap::Parser;
use scanner::cli::{self, Cli, UNUSABLE};
use scanner::ui::Ui;

fn main() -> ExitCode {
    let cli = Cli::parse();
    match cli::run(&cli) {
        Ok(status) => ExitCode::from(status),
        Err(error) => {
            Ui::new(cli.json, cli.quiet, cli.verbose).error(&format!("{error:#}"));
            ExitCode::from(UNUSABLE)
        }
    }
}
