//! `scan-product simulate`: a recording without a Kinect.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use reconstruct::board::{BoardFile, Family, KnownBoard};
use serde_json::json;

use crate::cli::DONE;
use crate::recording::{check_place, parse_board};
use crate::simulate::{Kind, NoiseLevel, Paper, Rest, ScanSpec, ring, scan_with, write};
use crate::ui::Ui;

/// Largest board file that is read, bytes.
const MAX_BOARD_BYTES: u64 = 8 << 20;

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The recording is as one of a real Kinect; truth/poses.json and truth/mesh.ply say what really was.
The same arguments and seed give the same bytes.

Examples:
  scan-product simulate --product mug --out rec
  scan-product simulate --product mug --pose side --out rec-lying
  scan-product simulate --product shoe --noise high --scale-error 0.015 --knock 3 --out rec
  scan-product simulate --product camera --no-board --out rec")]
pub struct Args {
    /// What to scan
    #[arg(long, value_enum, required_unless_present = "random")]
    product: Option<Kind>,
    /// How the product lies on the board; with the same seed it is the same product
    #[arg(long, value_enum, value_name = "POSE", default_value_t = Rest::Standing)]
    pose: Rest,
    /// A scan of the accuracy run: product, views, errors and board are drawn by the seed
    #[arg(long, conflicts_with_all = ["product", "pose", "no_board", "scale_error", "warp_px", "noise", "board", "family", "hide_board", "knock"])]
    random: bool,
    /// Folder of the recording
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Start of all random choices: the same seed gives the same recording
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Number of views around the product [default: 8, or 36 with --no-board]
    #[arg(long, value_name = "N")]
    views: Option<usize>,
    /// Depth frames a view [default: 5, or 1 with --no-board]
    #[arg(long, value_name = "N")]
    frames: Option<usize>,
    /// Random errors of depth: 0.9 mm (low) or 1.5 mm and more on slopes (high) at 0.8 m
    #[arg(long, value_enum, default_value_t = NoiseLevel::Low)]
    noise: NoiseLevel,
    /// Largest smooth error of disparity, pixels
    #[arg(long, value_name = "PX", default_value_t = 0.1)]
    warp_px: f64,
    /// How much too long depth reads: 0.015 for 1.5 %
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, allow_hyphen_values = true)]
    scale_error: f64,
    /// The board: a4, a3, a2 or a board.json
    #[arg(long, value_name = "PAPER|FILE", default_value = "a3")]
    board: String,
    /// Tags on the board: aruco_4x4_50, aruco_5x5_100, aruco_6x6_250, aruco_original or tag36h11
    #[arg(long, value_name = "FAMILY", default_value = "aruco_4x4_50", value_parser = family)]
    family: Family,
    /// Share of the board's tags that lies hidden in every view, on changing sides
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    hide_board: f64,
    /// In this view the product has been knocked: 12 mm and 6 degrees
    #[arg(long, value_name = "VIEW")]
    knock: Option<usize>,
    /// No board: a stream of single frames around the product
    #[arg(long, conflicts_with_all = ["knock", "hide_board", "board", "family"])]
    no_board: bool,
    /// Elevations of the camera in degrees, taken in turn
    #[arg(long, value_name = "DEG,…", value_delimiter = ',', num_args = 1..)]
    elevations: Vec<f64>,
    /// Distances of the camera in metres, taken in turn
    #[arg(long, value_name = "M,…", value_delimiter = ',', num_args = 1..)]
    distances: Vec<f64>,
    /// Depth from a camera of its own, beside the colour camera
    #[arg(long)]
    unregistered: bool,
    /// Store the images flipped left-right
    #[arg(long)]
    mirrored: bool,
}

fn family(name: &str) -> Result<Family, String> {
    Family::ALL.into_iter().find(|f| f.name() == name).ok_or_else(|| "no such family of tags".to_owned())
}

/// Runs the command.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let spec = spec(args)?;
    spec.check()?;
    check_place(&args.out)?;
    let stage = ui.stage("simulating", spec.views);
    let scan = scan_with(&spec, || stage.step())?;
    stage.done();
    let stage = ui.stage("writing", 1);
    write(&scan, &args.out)?;
    stage.done();
    let words = format!(
        "{}: a {} in {} views of {} frames",
        args.out.display(),
        spec.product,
        spec.views,
        spec.frames
    );
    ui.result(
        &words,
        &json!({"recording": args.out, "product": spec.product, "views": spec.views, "frames": spec.frames}),
    );
    Ok(DONE)
}

fn spec(args: &Args) -> anyhow::Result<ScanSpec> {
    let Some(product) = args.product else { return Ok(random_spec(args)) };
    let mut spec = ScanSpec::new(product, args.seed);
    spec.views = args.views.unwrap_or(if args.no_board { 36 } else { 8 });
    spec.frames = args.frames.unwrap_or(if args.no_board { 1 } else { 5 });
    if args.no_board {
        spec.elevations_deg = vec![35.0];
        spec.distances_m = vec![0.72];
    }
    if !args.elevations.is_empty() {
        spec.elevations_deg.clone_from(&args.elevations);
    }
    if !args.distances.is_empty() {
        spec.distances_m.clone_from(&args.distances);
    }
    spec.board = board(&args.board, args.family)?;
    Ok(ScanSpec {
        rest: args.pose,
        noise: args.noise,
        warp_px: args.warp_px,
        scale_error: args.scale_error,
        hide_board: args.hide_board,
        knock: args.knock,
        no_board: args.no_board,
        unregistered: args.unregistered,
        mirrored: args.mirrored,
        ..spec
    })
}

fn random_spec(args: &Args) -> ScanSpec {
    let mut spec = ScanSpec::random(args.seed);
    spec.views = args.views.unwrap_or(spec.views);
    spec.frames = args.frames.unwrap_or(spec.frames);
    ScanSpec { unregistered: args.unregistered, mirrored: args.mirrored, ..spec }
}

fn board(name: &str, family: Family) -> anyhow::Result<KnownBoard> {
    match <Paper as clap::ValueEnum>::from_str(name, true) {
        Ok(paper) => Ok(ring(paper, family)),
        Err(_) => read_board(Path::new(name)),
    }
}

/// The board that a paper's name or a file means, with the usual family.
pub(super) fn board_named(name: &str) -> anyhow::Result<KnownBoard> {
    board(name, Family::Aruco4x4_50)
}

fn read_board(path: &Path) -> anyhow::Result<KnownBoard> {
    let unreadable =
        || format!("{} is neither a paper (a4, a3, a2) nor a board file that can be read", path.display());
    let bytes = fs::metadata(path).with_context(unreadable)?.len();
    ensure!(bytes <= MAX_BOARD_BYTES, "{} is too large to be a board file", path.display());
    let bytes = fs::read(path).with_context(unreadable)?;
    match parse_board(&bytes).with_context(|| format!("{} can't be used", path.display()))? {
        BoardFile::Known(board) => Ok(board),
        BoardFile::Loose(_) => bail!(
            "{} says that nobody knows where its tags lie; name a board with tags at known places",
            path.display()
        ),
    }
}
