//! `scan-product`: parse, run, exit status.

use std::process::ExitCode;

use clap::Parser;
use scanner::capture;
use scanner::cli::{self, Cli, Command, DONE, INTERRUPTED, UNUSABLE};
use scanner::commands;
use scanner::output;
use scanner::ui::Ui;

fn main() -> ExitCode {
    let cli = Cli::parse();
    if let Some(Command::Driver { args }) = &cli.command {
        // It handles signals itself: the sensor's projector must not stay on.
        return ExitCode::from(kinect::worker::run(args));
    }
    let interrupt = || {
        // A capture ends in order and a recording is kept, unless it is asked a second time.
        if capture::ask_to_stop() || commands::record::end_recording() {
            return;
        }
        output::remove_unfinished();
        // A demo that is served ends as it should; anything else was cut short.
        let served = commands::demo::stop_server();
        std::process::exit(i32::from(if served { DONE } else { INTERRUPTED }));
    };
    if let Err(error) = ctrlc::set_handler(interrupt) {
        Ui::new(cli.json, cli.quiet, cli.verbose).warn(&format!("Ctrl-C will not clean up: {error}"));
    }
    match cli::run(&cli) {
        Ok(status) => ExitCode::from(status),
        // The handler has taken the files away under the work's feet: what the work says of that is no news.
        Err(_) if output::is_interrupted() => ExitCode::from(INTERRUPTED),
        Err(error) => {
            Ui::new(cli.json, cli.quiet, cli.verbose).error(&in_one_line(&error));
            ExitCode::from(UNUSABLE)
        }
    }
}

/// What went wrong and why, each said once.
fn in_one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain().map(|cause| cause.to_string().replace('\n', " ")) {
        if !line.contains(&cause) {
            line.push_str(if line.is_empty() { "" } else { ": " });
            line.push_str(&cause);
        }
    }
    line
}
