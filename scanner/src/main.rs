//! `scan-product`: parse, run, exit status.

use std::process::ExitCode;

use clap::Parser;
use scanner::cli::{self, Cli, INTERRUPTED, UNUSABLE};
use scanner::output;
use scanner::ui::Ui;

fn main() -> ExitCode {
    let cli = Cli::parse();
    let interrupt = || {
        output::remove_unfinished();
        std::process::exit(i32::from(INTERRUPTED));
    };
    if let Err(error) = ctrlc::set_handler(interrupt) {
        Ui::new(cli.json, cli.quiet, cli.verbose).warn(&format!("Ctrl-C will not clean up: {error}"));
    }
    match cli::run(&cli) {
        Ok(status) => ExitCode::from(status),
        Err(error) => {
            Ui::new(cli.json, cli.quiet, cli.verbose).error(&format!("{error:#}"));
            ExitCode::from(UNUSABLE)
        }
    }
}
