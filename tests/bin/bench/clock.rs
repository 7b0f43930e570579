//! Measuring: wall and process CPU time of repeated runs, peak memory, one CSV line.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use rayon::{ThreadPool, ThreadPoolBuilder};
use rustix::time::{ClockId, clock_gettime};

/// Stages that take less than this together are run more often, up to so many times: short ones are the noisiest.
const SHORT_MS: f64 = 200.0;
const MOST_SHORT_RUNS: usize = 50;

/// In the last column of what several threads did: least wall time of one thread in the same minutes, milliseconds.
pub(crate) const ONE_THREAD: &str = "one_thread_min";

/// What is measured, on what, and how often.
pub(crate) struct Bench {
    pub(crate) data: PathBuf,
    pub(crate) threads: usize,
    reps: usize,
    only: Option<String>,
    /// Where several threads are measured: one alone, which runs in turn with them.
    alone: Option<ThreadPool>,
}

impl Bench {
    pub(crate) fn new(
        data: PathBuf,
        threads: usize,
        reps: usize,
        only: Option<String>,
    ) -> anyhow::Result<Self> {
        println!("# peer,stage,threads,n,wall_median_ms,wall_min,wall_max,cpu_median_ms,peak_rss_mb,extra");
        let alone = ThreadPoolBuilder::new().num_threads(1).build().context("starting a thread")?;
        Ok(Self { data, threads, reps: reps.max(1), only, alone: (threads > 1).then_some(alone) })
    }

    /// Whether a stage was asked for; inputs and checks of others need not be prepared.
    pub(crate) fn wants(&self, stage: &str) -> bool {
        self.only.as_ref().is_none_or(|text| stage.contains(text.as_str()))
    }

    /// Times `work` and prints the line; `judge` says how good the result is, outside of the measured time.
    pub(crate) fn stage<T: Send>(
        &self,
        stage: &str,
        mut work: impl FnMut() -> T + Send,
        judge: impl FnOnce(&T) -> String,
    ) {
        if !self.wants(stage) {
            return;
        }
        let mut times = Times::default();
        let result = work();
        let quality = judge(&result);
        drop(result);
        // What a run made is freed in its time, as in the peers'.
        while times.wall.len() < self.reps || (times.sum() < SHORT_MS && times.wall.len() < MOST_SHORT_RUNS) {
            if let Some(alone) = &self.alone {
                alone.install(|| times.add_alone(|| drop(work())));
            }
            times.add(|| drop(work()));
        }
        self.print(stage, &times, &quality);
    }

    /// Prints times that were taken elsewhere.
    pub(crate) fn print(&self, stage: &str, times: &Times, extra: &str) {
        let (wall, cpu) = (sorted(&times.wall), sorted(&times.cpu));
        let alone = times.wall_alone.iter().copied().reduce(f64::min);
        let alone = alone.map_or_else(String::new, |least| format!(" {ONE_THREAD}={least:.3}"));
        println!(
            "allround-{},{stage},{},{},{:.3},{:.3},{:.3},{:.3},{},{extra} cpu_min={:.3}{alone}",
            env!("CARGO_PKG_VERSION"),
            self.threads,
            wall.len(),
            median(&wall),
            wall.first().copied().unwrap_or_default(),
            wall.last().copied().unwrap_or_default(),
            median(&cpu),
            peak_megabytes(),
            cpu.first().copied().unwrap_or_default(),
        );
    }
}

/// Times of repeated runs, milliseconds.
#[derive(Default)]
pub(crate) struct Times {
    wall: Vec<f64>,
    cpu: Vec<f64>,
    /// Wall times of one thread, in turn with those of several.
    wall_alone: Vec<f64>,
}

impl Times {
    fn sum(&self) -> f64 {
        self.wall.iter().sum()
    }

    /// Runs once on one thread and keeps the time.
    fn add_alone(&mut self, work: impl FnOnce()) {
        let wall = Instant::now();
        work();
        self.wall_alone.push(wall.elapsed().as_secs_f64() * 1e3);
    }

    /// Runs once and keeps the time.
    pub(crate) fn add<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (wall, cpu) = (Instant::now(), cpu_ms());
        let result = work();
        self.cpu.push(cpu_ms() - cpu);
        self.wall.push(wall.elapsed().as_secs_f64() * 1e3);
        result
    }
}

fn cpu_ms() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

fn median(sorted: &[f64]) -> f64 {
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

fn peak_megabytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    peak.split_whitespace().next().and_then(|text| text.parse::<u64>().ok()).unwrap_or(0) >> 10
}
