//! `scan-product board`: a marker board to print.

use std::path::PathBuf;

use anyhow::Context;
use reconstruct::board::Family;
use serde_json::json;

use crate::board_sheet::{draw, to_pdf, to_svg};
use crate::cli::DONE;
use crate::output::OutputDir;
use crate::simulate::{Paper, ring};
use crate::ui::Ui;

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Writes board.pdf and board.svg to print at 100 %, and board.json, which belongs beside recording.json.
Measure the printed ruler: where it is not 100 mm long, the model will have the wrong size.

Examples:
  scan-product board --paper a3 --out board
  scan-product board --paper a2 --family tag36h11 --out board")]
pub struct Args {
    /// Paper to print on
    #[arg(long, value_enum, default_value_t = Paper::A3)]
    paper: Paper,
    /// Tags: aruco_4x4_50, aruco_5x5_100, aruco_6x6_250, aruco_original or tag36h11
    #[arg(long, value_name = "FAMILY", default_value = "aruco_4x4_50", value_parser = family)]
    family: Family,
    /// Folder to write into
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Runs the command.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let board = ring(args.paper, args.family);
    let paper = format!("{:?}", args.paper).to_lowercase();
    let sheet = draw(&board, args.paper.size(), &paper);
    let mut description = serde_json::to_string_pretty(&board).context("writing board.json")?;
    description.push('\n');
    let out = OutputDir::begin(&args.out, &["board.pdf", "board.svg", "board.json"])?;
    out.write("board.pdf", &to_pdf(&sheet))?;
    out.write("board.svg", to_svg(&sheet).as_bytes())?;
    out.write("board.json", description.as_bytes())?;
    out.commit()?;
    let words = format!(
        "{}: board.pdf to print on {} at 100 %, {} tags; keep board.json beside recording.json",
        args.out.display(),
        paper.to_uppercase(),
        board.tags.len()
    );
    let machine = json!({
        "out": args.out.display().to_string(),
        "paper": paper,
        "family": args.family.name(),
        "tags": board.tags.len(),
    });
    ui.result(&words, &machine);
    Ok(DONE)
}

fn family(name: &str) -> Result<Family, String> {
    let known = || Family::ALL.map(Family::name).join(", ");
    Family::ALL.into_iter().find(|f| f.name() == name).ok_or_else(|| format!("choose one of {}", known()))
}
