//! `poses --seeds 1,2 --poses side,upside-down`: simulates every product standing and laid over, joins both, and judges the model
//! against the truth in the first recording's frame.
//!
//! A join is right where it displaces no point of the product by more than 2 mm, wrong where it displaces one by more, and refused
//! where no model was made. `--mix` joins every product with the next one instead: all must be refused.

use std::time::Instant;

use clap::Parser;
use nalgebra::Point3;
use reconstruct::mesh::Mesh;
use reconstruct::pose::{Pose, from_row_major};
use reconstruct::report::Report;
use scanner::config::Config;
use scanner::pipeline::{self, Scan};
use scanner::simulate::truth::{Surface, percentile, surface_errors};
use scanner::simulate::{Kind, NoiseLevel, Rest, ScanSpec, SimulatedScan, scan};
use scanner::ui::Ui;

/// Farthest that a right join displaces a point of the product, metres.
const RIGHT: f64 = 0.002;
/// A place of the truth is covered where the model has measured surface this near, metres.
const COVERED: f32 = 0.002;

/// Joining recordings of simulated products in two poses.
#[derive(Debug, Parser)]
struct Args {
    /// Seeds of the products
    #[arg(long, value_delimiter = ',', default_value = "1,2")]
    seeds: Vec<u64>,
    /// Poses of the second recording
    #[arg(long, value_enum, value_delimiter = ',', default_value = "side,upside-down")]
    poses: Vec<Rest>,
    /// Products; all without it
    #[arg(long, value_enum, value_delimiter = ',')]
    products: Vec<Kind>,
    /// Views of each recording
    #[arg(long, default_value_t = 8)]
    views: usize,
    /// Frames of each view
    #[arg(long, default_value_t = 5)]
    frames: usize,
    /// Random errors of depth
    #[arg(long, value_enum, default_value_t = NoiseLevel::Low)]
    noise: NoiseLevel,
    /// How much too long depth reads
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    scale_error: f64,
    /// The second recording shows the next product: nothing may be joined
    #[arg(long)]
    mix: bool,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let kinds = if args.products.is_empty() { Kind::ALL.to_vec() } else { args.products.clone() };
    let mut counts = [0usize; 3];
    println!(
        "{:10} {:11} {:>4}  {:8} {:>7} {:>7} {:>6} {:>6} {:>6} {:>6} {:>6} | {:>6} {:>6} {:>6} {:>7} {:>7} {:>6} {:>6}",
        "product",
        "pose",
        "seed",
        "outcome",
        "off mm",
        "overlap",
        "confl",
        "rms mm",
        "colour",
        "lead",
        "added",
        "median",
        "p95",
        "p95 of A",
        "under",
        "under A",
        "height",
        "of A"
    );
    for seed in args.seeds.iter().copied() {
        for (k, kind) in kinds.iter().copied().enumerate() {
            let first = scan(&spec(&args, kind, seed, Rest::Standing))?;
            let started = Instant::now();
            let alone = pipeline::build(&first, &Config::default(), &Ui::silent())?;
            let alone_ms = started.elapsed().as_millis();
            for rest in args.poses.iter().copied() {
                let other = if args.mix { kinds[(k + 1) % kinds.len()] } else { kind };
                let second = scan(&spec(&args, other, seed, rest))?;
                counts[one(&first, &alone, alone_ms, &second, args.mix)?] += 1;
            }
        }
    }
    println!("right {}, refused {}, wrong {}", counts[0], counts[1], counts[2]);
    Ok(())
}

fn spec(args: &Args, kind: Kind, seed: u64, rest: Rest) -> ScanSpec {
    ScanSpec {
        rest,
        views: args.views,
        frames: args.frames,
        noise: args.noise,
        scale_error: args.scale_error,
        ..ScanSpec::new(kind, seed)
    }
}

/// Joins and prints a line; 0 right, 1 refused, 2 wrong.
fn one(
    first: &SimulatedScan,
    alone: &Scan,
    alone_ms: u128,
    second: &SimulatedScan,
    mix: bool,
) -> anyhow::Result<usize> {
    let config = Config::default();
    let started = Instant::now();
    let built = pipeline::build_together(&[(first, &config), (second, &config)], &Ui::silent())?;
    let added = started.elapsed().as_millis() as f64 - alone_ms as f64;
    let head = format!("{:10} {:11} {:>4}", second.spec.product, second.spec.rest, second.spec.seed);
    let Some(world_from_board) = world_from_board(&built.report) else {
        println!("{head}  refused  {}", built.report.verdict_reason);
        return Ok(1);
    };
    let off = if mix { f64::INFINITY } else { displacement(&world_from_board, first, second) };
    let built_any = !built.model.vertices.is_empty();
    let outcome = usize::from(!built_any) + 2 * usize::from(built_any && off > RIGHT);
    let joined = built.report.recordings.get(1).and_then(|r| r.joined).unwrap_or_default();
    let errors = |mesh: &Mesh| {
        Surface::of(&first.truth.mesh).map_or_else(Vec::new, |s| surface_errors(&s, &mesh.measured().points))
    };
    let (both, a) = (errors(&built.model), errors(&alone.model));
    let height =
        |scan: &Scan| scan.report.dimensions_m.map_or(f64::NAN, |d| d[2]) - truth_height(&first.truth.mesh);
    println!(
        "{head}  {:8} {:>7.2} {:>7.1} {:>6.2} {:>6.2} {:>6} {:>6.0} {:>6.0} | {:>6.2} {:>6.2} {:>6.2} {:>7.1} {:>7.1} {:>6.2} {:>6.2}{}",
        ["right", "refused", "WRONG"][outcome],
        off * 1000.0,
        joined.overlap_percent,
        joined.conflict_percent,
        joined.surface_mm,
        joined.color_percent.map_or("-".to_owned(), |c| format!("{c:.0}")),
        joined.lead_percent,
        added,
        percentile(&both, 0.5) * 1000.0,
        percentile(&both, 0.95) * 1000.0,
        percentile(&a, 0.95) * 1000.0,
        underside_measured(&first.truth.mesh, &built.model),
        underside_measured(&first.truth.mesh, &alone.model),
        height(&built) * 1000.0,
        height(alone) * 1000.0,
        if built_any { String::new() } else { format!("  {}", built.report.verdict_reason) },
    );
    let left_out = built.report.views.iter().filter(|v| !v.used).count();
    if left_out > 0 {
        println!("    {left_out} views left out");
    }
    Ok(outcome)
}

fn world_from_board(report: &Report) -> Option<Pose> {
    from_row_major(report.recordings.get(1)?.world_from_board.as_ref()?)
}

/// Farthest displacement of a point of the product by the join, metres.
fn displacement(found: &Pose, first: &SimulatedScan, second: &SimulatedScan) -> f64 {
    // Vertices of both meshes are the same product's, in the same order.
    let pairs = first.truth.mesh.vertices.points.iter().zip(&second.truth.mesh.vertices.points);
    pairs
        .map(|(a, b)| (found * Point3::from(*b).cast::<f64>() - Point3::from(*a).cast::<f64>()).norm())
        .fold(0.0, f64::max)
}

fn truth_height(mesh: &Mesh) -> f64 {
    mesh.vertices.points.iter().map(|p| f64::from(p[2])).fold(0.0, f64::max)
}

/// Share of the true surface that lies within 3 mm of the board and faces it that the model measured, percent.
fn underside_measured(truth: &Mesh, model: &Mesh) -> f64 {
    let measured = Mesh {
        vertices: model.vertices.clone(),
        triangles: model
            .triangles
            .iter()
            .filter(|t| t.iter().all(|&v| !model.is_invented(v as usize)))
            .copied()
            .collect(),
        deviations_metres: model.deviations_metres.clone(),
    };
    let Some(surface) = Surface::of(&measured) else { return 0.0 };
    let under = truth
        .vertices
        .points
        .iter()
        .zip(&truth.vertices.normals)
        .filter(|(p, n)| p[2] < 0.003 && n[2] < -0.8)
        .step_by(5);
    let (all, covered) = under.fold((0usize, 0usize), |(all, covered), (p, _)| {
        (all + 1, covered + usize::from(surface.distance(*p) < COVERED))
    });
    100.0 * covered as f64 / all.max(1) as f64
}
