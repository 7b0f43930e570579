//! From a recording to a model: **start reading here**. One call a stage, in the order of the data's way.
//!
//! Each stage is a module of `reconstruct` (the mathematics) with a thin driver below `pipeline/` that runs it over all
//! views. World frame = board, z up, metres; `world_from_camera` is the colour camera's.

pub mod align;
pub mod alone;
pub mod cut;
pub mod depth;
pub mod free;
pub mod load;
pub mod markers;
pub mod outcome;
pub mod sessions;
pub mod source;
pub mod source_chain;
pub mod stages;
pub mod unit;

use reconstruct::fuse;
use reconstruct::mesh::Mesh;
use reconstruct::report::Report;
use reconstruct::surface::{self, Surface};

use crate::config::{Config, Method};
use crate::recording::RecordingError;
use crate::ui::Ui;
use load::Work;
pub use sessions::build_together;
pub use source::ViewSource;
use stages::Stages;

/// A built model, or the report that says why there is none.
#[derive(Debug, Clone)]
pub struct Scan {
    /// The product's surface with colours, normals and deviations, world frame, metres; empty where nothing could be built,
    /// points alone by the source's own method.
    pub model: Mesh,
    /// What is said about it.
    pub report: Report,
}

/// Builds the model of a recording.
///
/// # Errors
/// Where the recording cannot be read, or where the work is no longer wanted. A recording that can be read but gives no good scan comes back with an empty cloud
/// and a report that says why.
pub fn build(source: &dyn ViewSource, config: &Config, ui: &Ui) -> Result<Scan, RecordingError> {
    let mut stages = Stages::new(ui);
    let mut scan = place(source, config, &mut stages)?;
    let (surface, source_report) = match config.method {
        Method::Joint => {
            stages.run("align", |_| align::refine_together(&mut scan, config))?;
            let views = scan.placed_views();
            let fused = stages.run("fuse", |_| fuse::fuse(&views, &config.fuse))?;
            let make = || surface::surface(&fused, &views, scan.ground.up_is_known(), &config.surface);
            (stages.run("surface", |_| make())?, None)
        }
        Method::Source => {
            let (cloud, report) = stages
                .run("source chain", |_| source_chain::register_as_the_source(&mut scan, config.seed))?;
            (Surface { mesh: Mesh::of_points(cloud), holes: Vec::new() }, report)
        }
    };
    let (model, mut report) = outcome::judge(&scan, surface, false, config, stages.timings());
    report.source_chain = source_report;
    Ok(Scan { model, report })
}

/// The first stages: every view has geometry and a first pose, and only the product is left.
fn place(source: &dyn ViewSource, config: &Config, stages: &mut Stages) -> Result<Work, RecordingError> {
    let mut scan =
        stages.try_run("load", source.view_count(), |stage| load::load_and_average(source, config, stage))?;
    stages.run("markers", |_| markers::place_on_board(&mut scan, source.board(), config))?;
    if scan.has_board() {
        if config.method == Method::Joint {
            stages.run("calibrate", |_| depth::calibrate(&mut scan, config))?;
        }
        stages.run("cut", |_| cut::cut_background(&mut scan, config))?;
    } else {
        stages.run("place", |_| free::place_by_surfaces(&mut scan, config))?;
    }
    Ok(scan)
}
