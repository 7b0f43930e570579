//! Several recordings of one product, standing in the first and laid over in the others, become one model.
//!
//! Each is placed on its own board and refined alone; then the product itself says how they belong together
//! ([`reconstruct::register::flip`]), and all views are refined once more. The first recording's board is the world.

mod join;
mod words;

use reconstruct::fuse::{self, FuseConfig};
use reconstruct::pose;
use reconstruct::report::recordings::RecordingReport;
use reconstruct::surface::{self, Surface};

use super::load::Work;
use super::stages::Stages;
use super::{Scan, ViewSource, align, outcome, place};
use crate::config::Config;
use crate::recording::RecordingError;
use crate::ui::Ui;

/// A recording and how to build it; what concerns all together is taken from the first.
pub type Recorded<'a> = (&'a dyn ViewSource, &'a Config);

/// Builds one model of several recordings; of a single one, just what [`super::build`] does.
///
/// # Errors
/// As [`super::build`]. Recordings that cannot be joined come back with an empty model and a report that says what to do.
pub fn build_together(recordings: &[Recorded<'_>], ui: &Ui) -> Result<Scan, RecordingError> {
    let Some((&(first, config), others)) = recordings.split_first() else {
        return Err(RecordingError::NoSuchView(0));
    };
    if others.is_empty() {
        return super::build(first, config, ui);
    }
    let mut stages = Stages::new(ui);
    let mut merged = Merged::first(alone(1, first, config, &mut stages)?);
    for (k, &(source, own)) in others.iter().enumerate() {
        let next = alone(k + 2, source, own, &mut stages)?;
        stages.run("join", |_| merged.join(next, k + 2, config))?;
    }
    let surface = if merged.scan.failure.is_some() {
        Surface::default()
    } else {
        merged.surface(config, &mut stages)?
    };
    let (model, mut report) = outcome::judge(&merged.scan, surface, merged.turned, config, stages.timings());
    report.recordings = merged.recordings;
    Ok(Scan { model, report })
}

/// A recording on its own board, refined alone; its views are named by its number where it is not the first.
fn alone(
    number: usize,
    source: &dyn ViewSource,
    config: &Config,
    stages: &mut Stages,
) -> Result<Work, RecordingError> {
    let mut scan = place(source, config, stages)?;
    stages.run("align", |_| align::refine_together(&mut scan, config))?;
    join::hold_views(&mut scan);
    if number > 1 {
        let prefix = prefix(number);
        scan.views.iter_mut().for_each(|v| v.name.insert_str(0, &prefix));
        scan.warnings.iter_mut().for_each(|w| w.insert_str(0, &format!("recording {number}: ")));
    }
    if scan.failure.is_none() && scan.placed_views().is_empty() {
        scan.failure = Some("none of its views could be used".to_owned());
    }
    scan.failure = scan.failure.map(|why| format!("recording {number}: {why}"));
    Ok(scan)
}

fn prefix(number: usize) -> String {
    format!("{number}/")
}

/// The recordings joined so far.
struct Merged {
    scan: Work,
    recordings: Vec<RecordingReport>,
    /// Views of each recording.
    sessions: Vec<std::ops::Range<usize>>,
    /// Whether some recording shows the product off its foot, so that the floor bounds nothing.
    turned: bool,
}

impl Merged {
    fn first(scan: Work) -> Self {
        let recording = RecordingReport {
            world_from_board: Some(pose::to_row_major(&pose::Pose::identity())),
            ..described(&scan, 1)
        };
        let sessions = std::iter::once(0..scan.views.len()).collect();
        Self { scan, recordings: vec![recording], sessions, turned: false }
    }

    fn fuse_config(&self, config: &Config) -> FuseConfig {
        if self.turned { FuseConfig { floor_metres: f32::NEG_INFINITY, ..config.fuse } } else { config.fuse }
    }

    fn surface(&self, config: &Config, stages: &mut Stages) -> Result<Surface, RecordingError> {
        let views = self.scan.placed_views();
        let fused = stages.run("fuse", |_| fuse::fuse(&views, &self.fuse_config(config)))?;
        // Where it was seen from below, what is still missing there is a hole like any other.
        let stands = self.scan.ground.up_is_known() && !self.turned;
        stages.run("surface", |_| surface::surface(&fused, &views, stands, &config.surface))
    }
}

fn described(scan: &Work, number: usize) -> RecordingReport {
    RecordingReport {
        prefix: if number > 1 { prefix(number) } else { String::new() },
        views: scan.views.len(),
        depth_scale: (scan.calibration.depth_scale() * 1e5).round() / 1e5,
        ..RecordingReport::default()
    }
}
