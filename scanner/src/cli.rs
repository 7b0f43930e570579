//! The command line: what can be asked for. Each command has its arguments and its work in `commands/`.

use std::ffi::OsString;

use clap::{Parser, Subcommand};

use crate::commands;
use crate::ui::Ui;

/// Exit status: done.
pub const DONE: u8 = 0;
/// Exit status: the input could be read but gives no good scan.
pub const NO_GOOD_SCAN: u8 = 1;
/// Exit status: wrong usage or unreadable input.
pub const UNUSABLE: u8 = 2;
/// Exit status: interrupted.
pub const INTERRUPTED: u8 = 130;

/// Scan a product on a marker board and turn it into a measurable 3D listing.
#[derive(Debug, Parser)]
#[command(name = "scan-product", version, max_term_width = 100, propagate_version = true, after_help = AFTER_HELP)]
pub struct Cli {
    /// Print the result as one JSON object, progress as JSON lines on standard error
    #[arg(long, global = true, help_heading = SPEECH, display_order = 900)]
    pub json: bool,
    /// Say only warnings, errors and the result
    #[arg(short, long, global = true, conflicts_with = "verbose", help_heading = SPEECH, display_order = 901)]
    pub quiet: bool,
    /// Say more: what was found in every view
    #[arg(short, long, global = true, help_heading = SPEECH, display_order = 902)]
    pub verbose: bool,
    /// What to do
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// Heading of the options that every command has.
const SPEECH: &str = "What is said";

const AFTER_HELP: &str = "\
A recording is a folder of colour and depth pictures of a product that stands in the middle of a
printed marker board, taken from several sides (views), with recording.json and board.json beside.

Start here:
  scan-product                                       be led through it, with a Kinect or without
  scan-product board --paper a3 --out board          print the marker board
  scan-product simulate --product mug --out rec      a recording without a Kinect
  scan-product build rec --out out                   the 3D model
  scan-product report out                            how good it is, and what is missing
  scan-product upload out --server https://… --title \"Blue mug\"

Exit status: 0 done; 1 the recording gives no good scan (report.json says why);
2 wrong usage or unreadable input; 130 interrupted.";

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Be led from the sensor to the listing, on a page in the browser
    Capture(commands::capture::Args),
    /// Go on with a recording that was not finished
    Resume(commands::resume::Args),
    /// List the depth cameras that are plugged in, and why one cannot be used
    Devices(commands::devices::Args),
    /// Check a sensor live, and say what to do
    Doctor(commands::doctor::Args),
    /// Build an old recording anew, keeping the older result aside
    Rebuild(commands::rebuild::Args),
    /// Build the 3D model of a recording
    Build(commands::build::Args),
    /// Say in words how good a built model is, and what is missing
    Report(commands::report::Args),
    /// Learn how one sensor's depth errs, for all its later recordings
    Calibrate(commands::calibrate::Args),
    /// Write a marker board to print
    Board(commands::board::Args),
    /// Bring in recordings and models of other programs
    Import(commands::import::Args),
    /// Record what a sensor sends, every frame as it comes
    Record(commands::record::Args),
    /// Record a product with a simulated Kinect, with the exact truth beside it
    Simulate(commands::simulate::Args),
    /// Publish a built model on a product server
    Upload(commands::upload::Args),
    /// See all of it at work: from a simulated scan to a listing on your own machine
    Demo(commands::demo::Args),
    /// Print what a shell needs to complete the commands with the tab key
    Completions(commands::completions::Args),
    /// Run a depth camera's driver; the program starts this itself, in a process of its own
    #[command(name = kinect::child::SUBCOMMAND, hide = true, disable_help_flag = true)]
    Driver {
        /// Driver, pipe and sensor
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        args: Vec<OsString>,
    },
}

/// Runs the command; the number is the exit status.
pub fn run(cli: &Cli) -> anyhow::Result<u8> {
    let ui = Ui::new(cli.json, cli.quiet, cli.verbose);
    let usual = Command::Capture(commands::capture::Args::usual());
    match cli.command.as_ref().unwrap_or(&usual) {
        Command::Capture(args) => commands::capture::run(args, &ui),
        Command::Resume(args) => commands::resume::run(args, &ui),
        Command::Devices(args) => commands::devices::run(args, &ui),
        Command::Doctor(args) => commands::doctor::run(args, &ui),
        Command::Rebuild(args) => commands::rebuild::run(args, &ui),
        Command::Report(args) => commands::report::run(args, &ui),
        Command::Build(args) => commands::build::run(args, &ui),
        Command::Calibrate(args) => commands::calibrate::run(args, &ui),
        Command::Board(args) => commands::board::run(args, &ui),
        Command::Import(args) => commands::import::run(args, &ui),
        Command::Record(args) => commands::record::run(args, &ui),
        Command::Simulate(args) => commands::simulate::run(args, &ui),
        Command::Upload(args) => commands::upload::run(args, &ui),
        Command::Demo(args) => commands::demo::run(args, &ui),
        Command::Completions(args) => commands::completions::run(args),
        Command::Driver { args } => Ok(kinect::worker::run(args)),
    }
}
