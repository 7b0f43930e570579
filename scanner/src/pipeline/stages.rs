//! Runs the stages: says which is at work and keeps how long each took.

use serde_json::{Map, Value, json};

use crate::recording::RecordingError;
use crate::ui::{Stage, Ui};

/// The stages so far.
#[derive(Debug)]
pub struct Stages<'a> {
    ui: &'a Ui,
    timings_ms: Map<String, Value>,
}

impl<'a> Stages<'a> {
    /// None yet.
    pub fn new(ui: &'a Ui) -> Self {
        Self { ui, timings_ms: Map::new() }
    }

    /// Runs one stage that cannot fail; none begins once the work is no longer wanted.
    pub fn run<T>(&mut self, name: &str, work: impl FnOnce(&Stage) -> T) -> Result<T, RecordingError> {
        self.try_run(name, 1, |stage| Ok(work(stage)))
    }

    /// Runs one stage of `steps` steps that may fail.
    pub fn try_run<T>(
        &mut self,
        name: &str,
        steps: usize,
        work: impl FnOnce(&Stage) -> Result<T, RecordingError>,
    ) -> Result<T, RecordingError> {
        if !self.ui.is_wanted() {
            return Err(RecordingError::Cancelled);
        }
        let stage = self.ui.stage(name, steps);
        let result = work(&stage)?;
        self.keep(name, stage);
        Ok(result)
    }

    /// Wall time of every stage in milliseconds, over all recordings.
    pub fn timings(self) -> Map<String, Value> {
        self.timings_ms
    }

    fn keep(&mut self, name: &str, stage: Stage) {
        let before = self.timings_ms.get(name).and_then(Value::as_f64).unwrap_or(0.0);
        let millis = before + stage.done().as_secs_f64() * 1000.0;
        self.timings_ms.insert(name.to_owned(), json!((millis * 10.0).round() / 10.0));
    }
}
