//! How much space is left, asked often enough that the disk does not get full.

use std::cell::Cell;
use std::io;
use std::path::{Path, PathBuf};

use super::{Plan, RecordError};

/// What stays free for everything else on the disk, bytes.
const RESERVE: u64 = 256 << 20;
/// Largest share of its raw pixels that a picture takes as a file: it may not get smaller at all.
const WORST: f64 = 1.01;
/// Space is asked for again after so many bytes have been written.
const ASK_EVERY: u64 = 32 << 20;
/// Frames a second, for the estimate.
const RATE: f64 = 30.0;

/// Free space under the folder of a recording.
#[derive(Debug)]
pub(super) struct Space {
    folder: PathBuf,
    free_bytes: fn(&Path) -> io::Result<u64>,
    /// For all of what is planned, where the plan has an end.
    planned: Option<u64>,
    asked_at: Cell<Option<u64>>,
}

impl Space {
    pub(super) fn new(plan: &Plan) -> Self {
        let pixels =
            |camera: &reconstruct::camera::Intrinsics| f64::from(camera.width) * f64::from(camera.height);
        let frame = (pixels(&plan.rig.color) * 3.0 + pixels(&plan.rig.depth) * 2.0) * WORST;
        let planned =
            plan.most.map(|most| (frame * RATE * most.as_secs_f64() / plan.every.max(1) as f64) as u64);
        Self { folder: plan.out.clone(), free_bytes: plan.free_bytes, planned, asked_at: Cell::new(None) }
    }

    /// Refuses to begin where the reserve is used up already, or where what is planned cannot fit even if it gets half
    /// as large as it can get.
    pub(super) fn check_before(&self) -> Result<(), RecordError> {
        let need = RESERVE + self.planned.unwrap_or(0) / 2;
        let free = (self.free_bytes)(&self.folder).map_err(RecordError::Space)?;
        if free < need {
            return Err(RecordError::NoSpace { free_megabytes: free >> 20, need_megabytes: need >> 20 });
        }
        Ok(())
    }

    /// Whether less than the reserve is left, with `written` bytes on the disk so far.
    pub(super) fn is_short(&self, written: u64) -> Result<bool, RecordError> {
        if self.asked_at.get().is_some_and(|asked_at| written < asked_at + ASK_EVERY) {
            return Ok(false);
        }
        self.asked_at.set(Some(written));
        Ok((self.free_bytes)(&self.folder).map_err(RecordError::Space)? < RESERVE)
    }
}
