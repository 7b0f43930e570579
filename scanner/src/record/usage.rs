//! What the program has used of the computer.

use std::time::Duration;

use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::TimeVal;

/// Processor time and memory since the program began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Usage {
    /// Of this process, on all its threads.
    pub cpu: Duration,
    /// Of the processes it started, as far as they have ended: the sensor's driver.
    pub drivers_cpu: Duration,
    /// Most memory of this process at any time, bytes.
    pub peak_memory_bytes: u64,
}

/// What has been used so far; zeros where the system does not say.
pub fn usage() -> Usage {
    let own = getrusage(UsageWho::RUSAGE_SELF);
    let drivers = getrusage(UsageWho::RUSAGE_CHILDREN);
    let cpu = |usage: &nix::sys::resource::Usage| duration(usage.user_time()) + duration(usage.system_time());
    Usage {
        cpu: own.as_ref().map(cpu).unwrap_or_default(),
        drivers_cpu: drivers.as_ref().map(cpu).unwrap_or_default(),
        peak_memory_bytes: peak_memory()
            .unwrap_or_else(|| own.map_or(0, |usage| usage.max_rss().unsigned_abs() * UNIT)),
    }
}

/// Linux hands the peak of `getrusage` down from the process that started this one, so its own table is asked first.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}

/// Linux counts memory in kilobytes here, macOS in bytes.
const UNIT: u64 = if cfg!(target_os = "macos") { 1 } else { 1024 };

fn duration(time: TimeVal) -> Duration {
    Duration::new(time.tv_sec().unsigned_abs(), time.tv_usec().unsigned_abs() as u32 * 1000)
}
