//! A token bucket for each key: attempts come back one by one.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Keys remembered; above this, those with a full bucket are forgotten.
const MOST_KEYS: usize = 10_000;

/// Counts attempts by key.
#[derive(Debug)]
pub struct Throttle {
    burst: f64,
    every: Duration,
    buckets: Mutex<HashMap<String, Bucket>>,
}

#[derive(Debug, Clone, Copy)]
struct Bucket {
    left: f64,
    at: Instant,
}

impl Throttle {
    pub fn new(burst: u32, every: Duration) -> Self {
        Self { burst: f64::from(burst), every, buckets: Mutex::default() }
    }

    /// Whether there is an attempt left for every one of the keys; takes one of each, up to the first
    /// that has none.
    pub fn allow(&self, keys: &[&str]) -> bool {
        self.allow_at(keys, Instant::now())
    }

    fn allow_at(&self, keys: &[&str], now: Instant) -> bool {
        let mut buckets = self.buckets.lock().unwrap_or_else(PoisonError::into_inner);
        if buckets.len() > MOST_KEYS {
            buckets.retain(|_, bucket| self.refilled(*bucket, now) < self.burst);
        }
        for key in keys {
            let left = buckets.get(*key).map_or(self.burst, |bucket| self.refilled(*bucket, now));
            if left < 1.0 {
                return false;
            }
            buckets.insert((*key).to_string(), Bucket { left: left - 1.0, at: now });
        }
        true
    }

    fn refilled(&self, bucket: Bucket, now: Instant) -> f64 {
        let back = now.duration_since(bucket.at).as_secs_f64() / self.every.as_secs_f64().max(1e-9);
        (bucket.left + back).min(self.burst)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attempts_run_out_and_come_back() {
        let throttle = Throttle::new(2, Duration::from_secs(10));
        let start = Instant::now();
        assert!(throttle.allow_at(&["ann"], start));
        assert!(throttle.allow_at(&["ann"], start));
        assert!(!throttle.allow_at(&["ann"], start));
        assert!(throttle.allow_at(&["bob"], start));
        assert!(throttle.allow_at(&["ann"], start + Duration::from_secs(11)));
        assert!(!throttle.allow_at(&["ann"], start + Duration::from_secs(12)));
    }
}
