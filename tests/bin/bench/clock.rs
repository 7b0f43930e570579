//! Measuring: wall and process CPU time of repeated runs, peak memory, one CSV line.

use std::path::PathBuf;
use std::time::Instant;

use rustix::time::{ClockId, clock_gettime};

/// What is measured, on what, and how often.
pub(crate) struct Bench {
    pub(crate) data: PathBuf,
    pub(crate) threads: usize,
    reps: usize,
    only: Option<String>,
}

impl Bench {
    pub(crate) fn new(data: PathBuf, threads: usize, reps: usize, only: Option<String>) -> Self {
        println!("# peer,stage,threads,n,wall_median_ms,wall_min,wall_max,cpu_median_ms,peak_rss_mb,extra");
        Self { data, threads, reps: reps.max(1), only }
    }

    /// Whether a stage was asked for; inputs and checks of others need not be prepared.
    pub(crate) fn wants(&self, stage: &str) -> bool {
        self.only.as_ref().is_none_or(|text| stage.contains(text.as_str()))
    }

    /// Times `work` and prints the line; `judge` says how good the result is, outside of the measured time.
    pub(crate) fn stage<T>(
        &self,
        stage: &str,
        mut work: impl FnMut() -> T,
        judge: impl FnOnce(&T) -> String,
    ) {
        if !self.wants(stage) {
            return;
        }
        let mut times = Times::default();
        let mut result = work();
        for _ in 0..self.reps {
            result = times.add(&mut work);
        }
        self.print(stage, &times, &judge(&result));
    }

    /// Prints times that were taken elsewhere.
    pub(crate) fn print(&self, stage: &str, times: &Times, extra: &str) {
        let (wall, cpu) = (sorted(&times.wall), sorted(&times.cpu));
        println!(
            "allround-{},{stage},{},{},{:.3},{:.3},{:.3},{:.3},{},{extra} cpu_min={:.3}",
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
}

impl Times {
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
