//! Joins our lines and the peers' into `docs/benchmarks.md` and its figures.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;

use crate::clock::ONE_THREAD;
use crate::figure::{Bar, bars};
use crate::rows::{Row, is_same, read};

/// Join CSV files of one run into a page with figures
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// CSV files of the peers and ours
    #[arg(required = true, value_name = "CSV")]
    files: Vec<PathBuf>,
    /// Folder that gets benchmarks.md and benchmarks/
    #[arg(long, default_value = "docs", value_name = "DIR")]
    out: PathBuf,
    /// Day of the run, as in 2026-11-22
    #[arg(long)]
    date: String,
}

/// Stages that belong in one table and one figure.
struct Group {
    title: &'static str,
    /// Name of the figure's file.
    name: &'static str,
    starts: &'static [&'static str],
}

/// Others add theirs here.
const GROUPS: [Group; 12] = [
    Group {
        title: "Eight views to a surface, from files to files",
        name: "build",
        starts: &["8-view build"],
    },
    Group { title: "Reading files", name: "load", starts: &["load"] },
    Group { title: "Voxel grid", name: "voxel", starts: &["voxel"] },
    Group { title: "Normals", name: "normals", starts: &["normals", "integral-image"] },
    Group { title: "Nearest neighbours", name: "nearest", starts: &["kdtree", "knn"] },
    Group {
        title: "Features and matching",
        name: "features",
        starts: &["fpfh", "pair features", "feature matching"],
    },
    Group { title: "Volumes of depth pictures", name: "volume", starts: &["tsdf"] },
    Group { title: "Screened Poisson", name: "poisson", starts: &["poisson"] },
    Group { title: "Global registration", name: "global", starts: &["global"] },
    Group { title: "Fine registration", name: "fine", starts: &["icp", "gicp", "pair surfels", "one round"] },
    Group { title: "Tag detection", name: "tags", starts: &["ARUCO", "AprilTag"] },
    Group { title: "Growth with the number of points and views", name: "scaling", starts: &["scaling"] },
];

/// One of our stages beside the peers'.
struct Joined<'a> {
    ours: &'a Row,
    /// Fastest first.
    peers: Vec<&'a Row>,
    two_threads: Option<&'a Row>,
}

impl Joined<'_> {
    fn ratio(&self) -> Option<f64> {
        self.peers.first().map(|best| best.cpu_ms / self.ours.cpu_ms.max(1e-6))
    }

    /// Least wall time of one thread, taken in turn with two where the stage allows that.
    fn one_thread_ms(&self, two: &Row) -> f64 {
        two.said(ONE_THREAD).and_then(|text| text.parse().ok()).unwrap_or(self.ours.wall_min_ms)
    }
}

pub(crate) fn run(args: &ReportArgs) -> anyhow::Result<()> {
    let rows = read(&args.files)?;
    let joined = join(&rows);
    anyhow::ensure!(!joined.is_empty(), "there is no line of ours in the files given");
    let figures = args.out.join("benchmarks");
    std::fs::create_dir_all(&figures).with_context(|| figures.display().to_string())?;
    let mut page = introduction(&args.date, &rows)?;
    for group in &GROUPS {
        let stages: Vec<&Joined> = joined
            .iter()
            .filter(|j| group.starts.iter().any(|start| j.ours.stage.starts_with(start)))
            .collect();
        if !stages.is_empty() {
            section(&mut page, group, &stages, &figures)?;
        }
    }
    let path = args.out.join("benchmarks.md");
    std::fs::write(&path, &page).with_context(|| path.display().to_string())?;
    println!("{page}");
    Ok(())
}

fn join(rows: &[Row]) -> Vec<Joined<'_>> {
    let one = |row: &&Row| row.is_ours() && row.threads == 1;
    let joined = rows.iter().filter(one).map(|ours| {
        let mut peers: Vec<&Row> = rows
            .iter()
            .filter(|row| !row.is_ours() && row.threads == 1 && is_same(&ours.stage, &row.stage))
            .collect();
        peers.sort_by(|a, b| a.cpu_ms.total_cmp(&b.cpu_ms));
        let two_threads =
            rows.iter().find(|row| row.is_ours() && row.threads == 2 && row.stage == ours.stage);
        Joined { ours, peers, two_threads }
    });
    joined.collect()
}

fn introduction(date: &str, rows: &[Row]) -> anyhow::Result<String> {
    let mut peers: Vec<&str> =
        rows.iter().filter(|row| !row.is_ours()).map(|row| row.peer.as_str()).collect();
    peers.sort_unstable();
    peers.dedup();
    let mut page = String::new();
    writeln!(page, "# Benchmarks\n")?;
    writeln!(
        page,
        "Written by `bench report` (see `make bench`) on {date}: {}, {} cores. One thread, process CPU time (median of the runs), the same input \
         files and the same parameters for everyone, on one machine on one day. It was busy with other work: ratios say more \
         than digits.\n",
        processor(),
        std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
    )?;
    writeln!(page, "Compared with: {}.\n", peers.join(", "))?;
    writeln!(
        page,
        "Inputs: a Kinect's noise on 640x480 pictures. `view0`: one view of a 25 cm object; `fused_raw`: eight views of it; \
         `scene0`: a table in a room; `milk_scene`: a real Kinect's picture. Best peer: the fastest that does the same. \
         Two threads: wall time of one thread against that of two, both at their best: in turn, but for registration, matching, tags and \
         integration, which one thread did in the run before.\n"
    )?;
    Ok(page)
}

fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| "an unnamed processor".to_owned(), |(_, name)| name.trim().to_owned())
}

fn section(page: &mut String, group: &Group, stages: &[&Joined], figures: &Path) -> anyhow::Result<()> {
    writeln!(page, "## {}\n\n![{}](benchmarks/{}.svg)\n", group.title, group.title, group.name)?;
    writeln!(
        page,
        "| stage | best peer | its ms | ours, ms (least) | times faster | two threads | our result |"
    )?;
    writeln!(page, "|---|---|---|---|---|---|---|")?;
    for stage in stages {
        let best = stage.peers.first();
        let least = stage.ours.said("cpu_min").unwrap_or("–");
        let speedup = stage.two_threads.map(|two| stage.one_thread_ms(two) / two.wall_min_ms.max(1e-6));
        let extra: Vec<&str> =
            stage.ours.extra.split_whitespace().filter(|word| !word.starts_with("cpu_min=")).collect();
        writeln!(
            page,
            "| {} | {} | {} | {:.2} ({least}) | {} | {} | {} |",
            stage.ours.stage,
            best.map_or("–", |row| row.peer.as_str()),
            best.map_or("–".to_owned(), |row| format!("{:.2}", row.cpu_ms)),
            stage.ours.cpu_ms,
            stage.ratio().map_or("–".to_owned(), |ratio| format!("**{ratio:.1}**")),
            speedup.map_or("–".to_owned(), |ratio| format!("{ratio:.2}x")),
            extra.join(" "),
        )?;
    }
    writeln!(page)?;
    qualities(page, stages)?;
    let bars_of: Vec<(String, Vec<Bar>)> =
        stages.iter().map(|stage| (stage.ours.stage.clone(), lines(stage))).collect();
    let path = figures.join(format!("{}.svg", group.name));
    std::fs::write(&path, bars(group.title, &bars_of)).with_context(|| path.display().to_string())
}

/// Words in a row that says how good its result is.
const QUALITIES: [&str; 4] = ["corner_rms", "right_total", "chamfer", "rot_med"];

/// What the peers say of their results, where it is more than a number of points.
fn qualities(page: &mut String, stages: &[&Joined]) -> anyhow::Result<()> {
    let said: Vec<&Row> = stages
        .iter()
        .flat_map(|stage| stage.peers.iter().copied())
        .filter(|row| QUALITIES.iter().any(|name| row.extra.contains(name)))
        .collect();
    if said.is_empty() {
        return Ok(());
    }
    writeln!(page, "What the peers' results are:\n\n| peer | stage | ms | result |\n|---|---|---|---|")?;
    for row in said {
        writeln!(page, "| {} | {} | {:.2} | {} |", row.peer, row.stage, row.cpu_ms, row.extra)?;
    }
    writeln!(page)?;
    Ok(())
}

/// Ours and the three fastest peers.
fn lines(stage: &Joined) -> Vec<Bar> {
    let bar = |row: &Row| Bar { label: row.peer.clone(), value: row.cpu_ms, ours: row.is_ours() };
    std::iter::once(bar(stage.ours)).chain(stage.peers.iter().take(3).map(|row| bar(row))).collect()
}
