//! `accuracy --scans 300 --seed 1`: simulates scans, builds each in memory and judges it against the truth.
//!
//! Scan k uses seed + k, so a failure is repeated by `--scans 1 --seed SEED`, or written to disk by
//! `scan-product simulate --random --seed SEED --out DIR`. A scan succeeds where every used view's pose displaces the product by at
//! most 2 mm and half of the model's cells of 1 mm lie within 1 mm of the true surface. More scans have one view before which the product was
//! knocked: it must be named, and no other.

use std::path::PathBuf;
use std::time::Instant;

use clap::Parser;
use nalgebra::Point3;
use reconstruct::knn::Tree;
use reconstruct::measure::extent;
use reconstruct::pose::from_row_major;
use scanner::config::Config;
use scanner::pipeline;
use scanner::simulate::truth::{PoseError, Surface, centre, percentile, pose_error, surface_errors};
use scanner::simulate::{ScanSpec, SimulatedScan, scan};
use scanner::ui::Ui;
use serde::Serialize;

/// Largest pose error and surface median of a good scan, millimetres.
const POSE_LIMIT_MM: f64 = 2.0;
const SURFACE_LIMIT_MM: f64 = 1.0;
/// Farther from the truth than this is an outlier, metres.
const OUTLIER: f32 = 0.003;
/// Farther is background, metres.
const BACKGROUND: f32 = 0.010;

/// Of the pixels in each direction, one in so many is asked for the product.
const PIXEL_STEP: usize = 4;
/// Such a pixel shows the product: higher than this above the board and nearer than that to the true surface, metres.
const ABOVE_BOARD: f32 = 0.005;
const ON_SURFACE: f32 = 0.003;
/// The model has it if it has a point so near, metres.
const HAS_POINT: f32 = 0.005;

/// Takes one figure from a scan.
type Figure = fn(&Judged) -> f64;

/// Accuracy over many simulated scans.
#[derive(Debug, Parser)]
struct Args {
    /// Number of scans
    #[arg(long, default_value_t = 300)]
    scans: u64,
    /// Seed of the first scan; the others follow
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of scans with a knocked view
    #[arg(long, default_value_t = 60)]
    knocked: u64,
    /// Write every scan's figures to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// One scan judged; millimetres.
#[derive(Debug, Serialize)]
struct Judged {
    seed: u64,
    product: &'static str,
    noise: scanner::simulate::NoiseLevel,
    scale_error: f64,
    hidden: f64,
    family: &'static str,
    views: usize,
    views_used: usize,
    pose_median: f64,
    pose_max: f64,
    degrees_max: f64,
    surface_median: f64,
    surface_p95: f64,
    outlier_percent: f64,
    /// Size against the truth, millimetres, and what was stated (95 %).
    size_error: [f64; 3],
    size_stated: [f64; 3],
    size_metres: [f64; 3],
    coverage_percent: f64,
    background_percent: f64,
    /// Of the pixels that show the product, those of which the model has a point nearby.
    kept_percent: f64,
    scale_found: f64,
    good: bool,
    reason: String,
    simulate_ms: u128,
    build_ms: u128,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let mut all = Vec::new();
    for seed in args.seed..args.seed.saturating_add(args.scans) {
        let judged = run(seed)?;
        eprintln!("{}", line(&judged));
        all.push(judged);
    }
    print_summary(&all);
    print_knocked(args.seed, args.knocked)?;
    if let Some(path) = &args.json {
        std::fs::write(path, serde_json::to_vec_pretty(&all)?)?;
    }
    Ok(())
}

fn run(seed: u64) -> anyhow::Result<Judged> {
    let started = Instant::now();
    let scan = scan(&ScanSpec::random(seed))?;
    let simulate_ms = started.elapsed().as_millis();
    let started = Instant::now();
    let built = pipeline::build(&scan, &Config::default(), &Ui::silent())?;
    Ok(judge(&scan, &built, simulate_ms, started.elapsed().as_millis()))
}

fn judge(scan: &SimulatedScan, built: &pipeline::Scan, simulate_ms: u128, build_ms: u128) -> Judged {
    let centre = centre(&scan.truth.mesh);
    let used = built.report.views.iter().zip(&scan.truth.world_from_camera).filter(|(view, _)| view.used);
    let mut poses: Vec<PoseError> = used
        .filter_map(|(view, truth)| {
            let estimate = from_row_major(view.world_from_camera.as_ref()?)?;
            Some(pose_error(truth, &estimate, &centre))
        })
        .collect();
    poses.sort_by(|a, b| a.metres.total_cmp(&b.metres));
    let millimetres: Vec<f32> = poses.iter().map(|p| (p.metres * 1000.0) as f32).collect();
    let errors = Surface::of(&scan.truth.mesh)
        .map_or_else(Vec::new, |surface| surface_errors(&surface, &built.model.measured().points));
    let background = errors.iter().filter(|&&e| e > BACKGROUND).count();
    let truth = extent(&scan.truth.mesh.vertices.points);
    let found = built.report.dimensions_m.unwrap_or([f64::NAN; 3]);
    let outliers = errors.iter().filter(|&&e| e > OUTLIER).count();
    let (pose_max, surface_median) = (percentile(&millimetres, 1.0), percentile(&errors, 0.5) * 1000.0);
    let reasons =
        built.report.views.iter().filter_map(|v| Some(format!("{}: {}", v.name, v.reason.as_ref()?)));
    Judged {
        seed: scan.spec.seed,
        product: scan.spec.product.name(),
        noise: scan.spec.noise,
        scale_error: scan.spec.scale_error,
        hidden: scan.spec.hide_board,
        family: scan.spec.board.family.name(),
        views: scan.views.len(),
        views_used: poses.len(),
        pose_median: percentile(&millimetres, 0.5),
        pose_max,
        degrees_max: poses.iter().map(|p| p.degrees).fold(f64::NAN, f64::max),
        surface_median,
        surface_p95: percentile(&errors, 0.95) * 1000.0,
        outlier_percent: 100.0 * outliers as f64 / errors.len().max(1) as f64,
        size_error: std::array::from_fn(|k| (found[k] - truth[k]) * 1000.0),
        size_stated: built.report.dimensions_uncertainty_m.unwrap_or([0.0; 3]).map(|u| u * 1000.0),
        size_metres: truth,
        coverage_percent: built.report.surface.as_ref().map_or(0.0, |s| s.coverage_percent),
        background_percent: 100.0 * background as f64 / errors.len().max(1) as f64,
        kept_percent: kept_percent(scan, &built.model.measured().points),
        scale_found: built.report.depth_calibration.scale,
        // Not a number where nothing was built: no success.
        good: pose_max <= POSE_LIMIT_MM && surface_median <= SURFACE_LIMIT_MM,
        reason: reasons.collect::<Vec<_>>().join("; "),
        simulate_ms,
        build_ms,
    }
}

/// Pixels whose true place lies on the product's surface, well above the board, and how many of them the model has.
fn kept_percent(scan: &SimulatedScan, model: &[[f32; 3]]) -> f64 {
    let Some(surface) = Surface::of(&scan.truth.mesh) else { return f64::NAN };
    let tree = Tree::new(model);
    let rays = scan.rig.depth.ray_table();
    let width = scan.rig.depth.width as usize;
    let (mut product, mut kept) = (0usize, 0usize);
    for (view, world_from_camera) in scan.views.iter().zip(&scan.truth.world_from_camera) {
        let depth = &view.depths[0];
        let is_asked =
            |i: &usize| (i % width).is_multiple_of(PIXEL_STEP) && (i / width).is_multiple_of(PIXEL_STEP);
        for i in (0..depth.data.len()).filter(is_asked) {
            // As the sensor would read it were its scale right.
            let z = f64::from(depth.data[i]) / depth.units_per_metre / (1.0 + scan.spec.scale_error);
            let [x, y] = rays[i].map(f64::from);
            let place: [f32; 3] = (world_from_camera * Point3::new(x * z, y * z, z)).cast::<f32>().into();
            if z <= 0.0 || place[2] < ABOVE_BOARD || surface.distance(place) > ON_SURFACE {
                continue;
            }
            product += 1;
            kept += usize::from(tree.nearest_within(&place, HAS_POINT).is_some());
        }
    }
    100.0 * kept as f64 / product.max(1) as f64
}

/// Scans in which the product was knocked before one view: how often that view is named, and how often another.
fn print_knocked(seed: u64, scans: u64) -> anyhow::Result<()> {
    let (mut named, mut others) = (0, 0);
    for seed in seed..seed.saturating_add(scans) {
        let spec = ScanSpec::random(seed);
        let knocked = seed as usize % spec.views;
        let scan = scan(&ScanSpec { knock: Some(knocked), ..spec })?;
        let built = pipeline::build(&scan, &Config::default(), &Ui::silent())?;
        let moved = |reason: &String| reason.contains("stands differently");
        let left_out = |view: usize| built.report.views[view].reason.as_ref().is_some_and(moved);
        named += usize::from(left_out(knocked));
        let wrong = (0..built.report.views.len()).filter(|&view| view != knocked && left_out(view)).count();
        others += usize::from(wrong > 0);
        let words = if left_out(knocked) { "named" } else { "NOT NAMED" };
        eprintln!(
            "{seed:>5} {:10} view {knocked} knocked: {words}, {wrong} others",
            scan.spec.product.name()
        );
    }
    let percent = |count: usize| 100.0 * count as f64 / scans.max(1) as f64;
    let (low, high) = wilson(named, scans as usize);
    println!(
        "a knocked view is named: {named} of {scans} = {:.1} % (95 % interval {:.1} to {:.1} %); another one too: {:.1} %",
        percent(named),
        100.0 * low,
        100.0 * high,
        percent(others),
    );
    Ok(())
}

fn line(j: &Judged) -> String {
    format!(
        "{:>5} {:10} {:4} scale {:+.3} hidden {:.1} {:12} views {}/{}  pose {:.2}/{:.2} mm  surface {:.2}/{:.2} mm  out {:.2} %  {} + {} ms{}",
        j.seed,
        j.product,
        if j.noise == scanner::simulate::NoiseLevel::Low { "low" } else { "high" },
        j.scale_error,
        j.hidden,
        j.family,
        j.views_used,
        j.views,
        j.pose_median,
        j.pose_max,
        j.surface_median,
        j.surface_p95,
        j.outlier_percent,
        j.simulate_ms,
        j.build_ms,
        if j.good { String::new() } else { format!("  FAILED {}", j.reason) },
    )
}

fn print_summary(all: &[Judged]) {
    println!("{:24} {:>8} {:>8} {:>8}", "over all scans", "median", "p95", "worst");
    let figures: [(&str, Figure); 13] = [
        ("pose median, mm", |j| j.pose_median),
        ("pose worst view, mm", |j| j.pose_max),
        ("pose worst view, degrees", |j| j.degrees_max),
        ("surface median, mm", |j| j.surface_median),
        ("surface p95, mm", |j| j.surface_p95),
        ("outliers, percent", |j| j.outlier_percent),
        ("background left, percent", |j| j.background_percent),
        ("product lost, percent", |j| 100.0 - j.kept_percent),
        ("coverage stated, percent", |j| j.coverage_percent),
        ("length error, mm", |j| j.size_error[0].abs()),
        ("width error, mm", |j| j.size_error[1].abs()),
        ("height error, mm", |j| j.size_error[2].abs()),
        ("build, ms", |j| j.build_ms as f64),
    ];
    for (name, figure) in figures {
        let mut values: Vec<f32> = all.iter().map(|j| figure(j) as f32).filter(|v| v.is_finite()).collect();
        values.sort_by(f32::total_cmp);
        let at = |share| percentile(&values, share);
        println!("{name:24} {:>8.3} {:>8.3} {:>8.3}", at(0.5), at(0.95), at(1.0));
    }
    let good = all.iter().filter(|j| j.good).count();
    let (low, high) = wilson(good, all.len());
    let left_out: usize = all.iter().map(|j| j.views - j.views_used).sum();
    println!("views left out: {left_out} of {}", all.iter().map(|j| j.views).sum::<usize>());
    println!(
        "within {POSE_LIMIT_MM} mm pose and {SURFACE_LIMIT_MM} mm surface median: {good} of {} = {:.1} % (95 % interval {:.1} to {:.1} %)",
        all.len(),
        100.0 * good as f64 / all.len().max(1) as f64,
        100.0 * low,
        100.0 * high,
    );
    print_sizes(all);
    for failed in all.iter().filter(|j| !j.good) {
        println!("failed: {}", line(failed));
    }
}

/// How many sizes are right, and how many lie within what was stated.
fn print_sizes(all: &[Judged]) {
    let sizes = || {
        all.iter().flat_map(|j| {
            (0..3).map(move |k| (k, j.size_error[k], j.size_stated[k], j.size_metres[k] * 1000.0))
        })
    };
    let of = |name: &str, fits: &dyn Fn(f64, f64, f64) -> bool| {
        let good = sizes().filter(|&(_, error, stated, size)| fits(error, stated, size)).count();
        let (low, high) = wilson(good, sizes().count());
        let share = 100.0 * good as f64 / sizes().count().max(1) as f64;
        println!("{name}: {share:.1} % (95 % interval {:.1} to {:.1} %)", 100.0 * low, 100.0 * high);
    };
    of("sizes within 1 mm or 0.7 %", &|error, _, size| error.abs() <= (0.007 * size).max(1.0));
    of("sizes within the stated \u{b1}", &|error, stated, _| error.abs() <= stated);
    for (k, name) in ["length", "width", "height"].iter().enumerate() {
        let of_side = || sizes().filter(move |s| s.0 == k && s.1.is_finite());
        let mean = of_side().map(|s| s.1).sum::<f64>() / of_side().count().max(1) as f64;
        println!("mean {name} error: {mean:+.2} mm");
    }
}

/// 95 % interval of a share (Wilson 1927).
fn wilson(good: usize, of: usize) -> (f64, f64) {
    if of == 0 {
        return (0.0, 1.0);
    }
    let (n, z) = (of as f64, 1.959_964);
    let share = good as f64 / n;
    let middle = (share + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    (middle - half, middle + half)
}
