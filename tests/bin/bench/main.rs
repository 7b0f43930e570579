//! `bench --data DIR`: times this project's stages on the inputs of the side-by-side comparison, a CSV line a stage, in the
//! columns and with the stage names of the peers, so that the two join. `bench report` joins them into `docs/benchmarks.md`.
//!
//! Every line's last column says how good the result was, not only how fast: a stage that cheats shows.

mod clock;
mod features;
mod figure;
mod inputs;
mod load;
mod nearest;
mod normals;
mod pairs;
mod poisson;
mod reference;
mod registration;
mod report;
mod rows;
mod scaling;
mod tags;
mod volume;
mod voxel;

use std::path::PathBuf;

use anyhow::Context;
use clap::{Parser, Subcommand};

use clock::Bench;

/// Times stages on the inputs of the comparison
#[derive(Debug, Parser)]
struct Args {
    #[command(subcommand)]
    order: Option<Order>,
    /// Folder with the inputs
    #[arg(long, default_value = "target/compare/data", value_name = "DIR")]
    data: PathBuf,
    /// Threads that share the work
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Runs of each stage, after one that warms up
    #[arg(long, default_value_t = 7)]
    reps: usize,
    /// Only stages whose name contains this
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
}

#[derive(Debug, Subcommand)]
enum Order {
    Report(report::ReportArgs),
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    if let Some(Order::Report(report)) = &args.order {
        return report::run(report);
    }
    anyhow::ensure!(args.data.is_dir(), "{} is no folder: run `make bench`", args.data.display());
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(args.threads).build().context("starting threads")?;
    let bench = Bench::new(args.data, args.threads, args.reps, args.only)?;
    pool.install(|| run(&bench))
}

/// One call a file of stages; others are added here.
fn run(bench: &Bench) -> anyhow::Result<()> {
    load::run(bench)?;
    voxel::run(bench)?;
    normals::run(bench)?;
    nearest::run(bench)?;
    features::run(bench)?;
    registration::run(bench)?;
    tags::run(bench)?;
    volume::run(bench)?;
    poisson::run(bench)?;
    scaling::run(bench)
}
