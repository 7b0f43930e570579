//! `scan-product build`: a recording becomes a model.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::ensure;
use reconstruct::register::source_chain::SourceReport;
use reconstruct::report::{Report, Verdict, ViewReport};
use serde_json::json;

use crate::cli::{DONE, NO_GOOD_SCAN};
use crate::config::{Config, Method};
use crate::output;
use crate::pipeline::{self, ViewSource, sessions::Recorded};
use crate::recording::Recording;
use crate::result;
use crate::ui::Ui;
use crate::unit_calibration;

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Writes model.asc (millimetres), model.ply and model.glb (metres), poster.png and report.json.
Several recordings of one product become one model: it stands on its board in the first, whose
board is the world, and lies on its side or upside down on a board in the others. How they belong
together is found by shape and colour.
In the report the views of the second recording are named 2/000, 2/001 and so on.
With exit status 1 only report.json is written: it says which views could not be used, why, and what to do.

Examples:
  scan-product build rec --out out
  scan-product build standing lying --out out         underside included
  scan-product build rec --out out --method source    for comparison: the source's own chain
  scan-product build stream --out out --no-board      placed by the surfaces alone")]
pub struct Args {
    /// Folder of the recording: recording.json, its pictures, and board.json; more of them show the same product turned over
    #[arg(value_name = "RECORDING", required = true, num_args = 1..)]
    pub recordings: Vec<PathBuf>,
    /// Folder for the result; older results in it are replaced
    #[arg(short, long, value_name = "DIR")]
    pub out: PathBuf,
    /// How the views are brought together
    #[arg(long, value_enum, default_value_t)]
    pub method: Method,
    /// Place the views by their surfaces alone, without the marker board
    #[arg(long)]
    pub no_board: bool,
    /// Do without what `scan-product calibrate` found out about this sensor
    #[arg(long)]
    pub no_calibration: bool,
    /// Seed of every random choice: the same seed gives the same bytes
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

impl Args {
    /// The usual build of a recording.
    pub fn of(recording: PathBuf, out: PathBuf) -> Self {
        Self {
            recordings: vec![recording],
            out,
            method: Method::Joint,
            no_board: false,
            no_calibration: false,
            seed: 1,
        }
    }
}

/// Builds and writes; the exit status says whether there is a model.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let recordings = open(args)?;
    output::check_writable(&args.out)?;
    if recordings.len() == 1 && recordings[0].board().is_none() && !args.no_board {
        ui.note("no board.json lies beside recording.json: the views are placed by their surfaces, as with --no-board");
    }
    let configs = recordings.iter().map(|r| config(args, r)).collect::<anyhow::Result<Vec<Config>>>()?;
    let recorded: Vec<Recorded<'_>> =
        recordings.iter().zip(&configs).map(|(r, c)| (r as &dyn ViewSource, c)).collect();
    let scan = pipeline::build_together(&recorded, ui)?;
    let writing = ui.stage("write", 1);
    result::write(&args.out, &scan.model, &scan.report)?;
    writing.done();
    scan.report.views.iter().filter(|v| v.used).for_each(|view| ui.detail(&view_in_words(view)));
    for warning in &scan.report.warnings {
        ui.warn(warning);
    }
    let machine = json!({"out": args.out, "report": scan.report});
    ui.result(&words(&scan.report, &args.out.display().to_string()), &machine);
    Ok(if scan.model.vertices.is_empty() { NO_GOOD_SCAN } else { DONE })
}

/// The recordings; several must each have a board and be built the usual way.
fn open(args: &Args) -> anyhow::Result<Vec<Recording>> {
    let recordings =
        args.recordings.iter().map(|path| Recording::open(path)).collect::<Result<Vec<_>, _>>()?;
    if recordings.len() > 1 {
        ensure!(
            !args.no_board && args.method == Method::Joint,
            "several recordings are joined with their boards only: leave out --no-board and --method source"
        );
        for (path, recording) in args.recordings.iter().zip(&recordings) {
            ensure!(recording.board().is_some(), "{} has no board.json, which joining needs", path.display());
        }
        let mut places: Vec<PathBuf> =
            args.recordings.iter().map(|p| p.canonicalize()).collect::<Result<_, _>>()?;
        places.sort_unstable();
        places.dedup();
        ensure!(places.len() == recordings.len(), "one recording is named twice");
    }
    Ok(recordings)
}

fn config(args: &Args, recording: &Recording) -> anyhow::Result<Config> {
    let depth_prior = if args.no_calibration { None } else { unit_calibration::prior_of(recording)? };
    let (method, no_board, seed) = (args.method, args.no_board, args.seed);
    Ok(Config { method, no_board, seed, depth_prior, ..Config::default() })
}

/// What is known of a used view, for the curious.
fn view_in_words(view: &ViewReport) -> String {
    let mut text = format!("view {}: {} markers", view.name, view.tags);
    if let Some(pixels) = view.reprojection_px {
        let _ = write!(text, ", corners {pixels:.2} pixels off");
    }
    if let Some(millimetres) = view.inlier_rmse_mm {
        let _ = write!(text, ", surface {millimetres:.2} mm off the other views'");
    }
    text
}

/// The result in words.
fn words(report: &Report, out: &str) -> String {
    let used = report.views.iter().filter(|v| v.used).count();
    let mut text = String::new();
    if let Some(chain) = &report.source_chain {
        text.push_str(&source_tables(chain));
    }
    if report.points == 0 {
        let _ = writeln!(text, "No model: {}.", report.verdict_reason);
        for view in report.views.iter().filter(|v| v.reason.is_some()) {
            let _ = writeln!(text, "  view {}: {}", view.name, view.reason.as_deref().unwrap_or_default());
        }
        let _ = write!(text, "{out}/report.json says the same.");
        return text;
    }
    let _ = writeln!(text, "{} points from {used} of {} views, in {out}", report.points, report.views.len());
    if let (Some(size), Some(off)) = (report.dimensions_m, report.dimensions_uncertainty_m) {
        let mm = |i: usize| format!("{:.1} ± {:.1}", size[i] * 1000.0, off[i] * 1000.0);
        let _ = writeln!(text, "length {} mm, width {} mm, height {} mm (95 %)", mm(0), mm(1), mm(2));
    }
    if let Some(percent) = report.surface.as_ref().and_then(|s| s.underside_measured_percent) {
        let _ = writeln!(text, "underside: {percent:.0} % measured");
    }
    let verdict = match report.verdict {
        Verdict::Good => "good",
        Verdict::Acceptable => "acceptable",
        Verdict::Poor => "poor",
    };
    let _ = write!(text, "scan quality: {verdict} ({})", report.verdict_reason);
    text
}

/// The source document's tables (slides 31 to 33) for this scan.
fn source_tables(chain: &SourceReport) -> String {
    let mut text = String::from(
        "view   points  model   down-sampled     key points   matches  RANSAC inliers  ICP iterations  ICP error mm\n",
    );
    let _ = writeln!(text, "first  {:>6}", chain.points_first_view);
    for pair in &chain.pairs {
        let _ = write!(
            text,
            "{:<6} {:>6} {:>7} {:>7}/{:<7} {:>5}/{:<6} {:>7} {:>8} of {:<7} {:>8} {:>17.2}",
            pair.view,
            pair.points,
            pair.model_points,
            pair.points_down_sampled,
            pair.model_points_down_sampled,
            pair.key_points,
            pair.model_key_points,
            pair.matches,
            pair.ransac_inliers,
            pair.matches,
            pair.icp_iterations,
            pair.icp_rmse_metres * 1000.0
        );
        let _ = writeln!(text, "{}", pair.failure.as_ref().map(|f| format!("  {f}")).unwrap_or_default());
    }
    let worst = chain.worst_icp_rmse_metres().map_or("none".to_owned(), |e| format!("{:.2} mm", e * 1000.0));
    let _ = writeln!(
        text,
        "model: {} points; {} ICP iterations in all; largest minimised error: {worst}",
        chain.points_model,
        chain.icp_iterations()
    );
    text
}
