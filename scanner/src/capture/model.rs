//! The built model while the seller looks at it: points are taken away by hand and put back, and what is on the disk follows.
//!
//! Points are counted in the order of the viewer's stream of the present version. World frame, metres.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use reconstruct::mesh::Mesh;
use reconstruct::report::Report;
use reconstruct::stream::{self, StreamError};

use super::state::{ResultState, ViewUse};
use crate::output::OutputError;
use crate::pipeline::outcome;
use crate::result;

/// Removals that can be taken back.
const MOST_UNDO: usize = 50;

/// One state of the model.
#[derive(Debug)]
pub struct Shape {
    mesh: Mesh,
    /// Index in the mesh of every point of the stream.
    order: Vec<u32>,
    /// The viewer's stream.
    pub stream: Vec<u8>,
}

/// Why points cannot be taken away.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RemoveError {
    /// An index beyond the last point.
    #[error("there is no point {0}: the model has changed meanwhile, load it again")]
    NoSuchPoint(u32),
    /// Nothing would be left.
    #[error("nothing would be left of the model: keep some points")]
    NothingLeft,
    /// The page looks at an older version.
    #[error("the model has changed meanwhile: load it again")]
    Outdated,
    /// Points that cannot be streamed.
    #[error(transparent)]
    Stream(#[from] StreamError),
}

impl Shape {
    /// Of a built model.
    pub fn new(mesh: Mesh) -> Result<Self, StreamError> {
        let order = stream::order_of(&mesh);
        let stream = stream::encode(&mesh)?;
        Ok(Self { mesh, order, stream })
    }

    /// Without the points at these places of the stream.
    pub fn without(&self, places: &[u32]) -> Result<Self, RemoveError> {
        let mut keep = vec![true; self.mesh.vertices.len()];
        for &place in places {
            let index = self.order.get(place as usize).ok_or(RemoveError::NoSuchPoint(place))?;
            keep[*index as usize] = false;
        }
        let left = self.mesh.select(&keep).without_loose_vertices();
        if left.vertices.is_empty() {
            return Err(RemoveError::NothingLeft);
        }
        Ok(Self::new(left)?)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.mesh.vertices.len()
    }
}

/// The model with what was done to it.
#[derive(Debug)]
pub struct Model {
    report: Report,
    built_points: usize,
    shape: Arc<Shape>,
    earlier: Vec<Arc<Shape>>,
    version: u64,
    files: Arc<Files>,
}

impl Model {
    /// A model that was just written to `folder`.
    pub fn new(shape: Shape, report: Report, version: u64, folder: PathBuf) -> Self {
        let files = Arc::new(Files { folder, written: Mutex::new(Some(version)) });
        let built_points = shape.points();
        Self { report, built_points, shape: Arc::new(shape), earlier: Vec::new(), version, files }
    }

    /// The points as they are now.
    pub fn shape(&self) -> Arc<Shape> {
        Arc::clone(&self.shape)
    }

    /// Counts every change.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Puts a shape that was made from version `of` into its place.
    pub fn replace(&mut self, shape: Shape, of: u64) -> Result<(), RemoveError> {
        if of != self.version {
            return Err(RemoveError::Outdated);
        }
        self.earlier.push(std::mem::replace(&mut self.shape, Arc::new(shape)));
        if self.earlier.len() > MOST_UNDO {
            self.earlier.remove(0);
        }
        self.version += 1;
        Ok(())
    }

    /// Takes the last removal back; says whether there was one.
    pub fn undo(&mut self) -> bool {
        let Some(shape) = self.earlier.pop() else { return false };
        self.shape = shape;
        self.version += 1;
        true
    }

    /// What is needed to write the model as it is now, without holding it.
    pub fn edition(&self) -> Edition {
        let removed = self.built_points - self.shape.points();
        Edition {
            files: Arc::clone(&self.files),
            shape: self.shape(),
            report: edited(&self.report, &self.shape, removed),
            version: self.version,
        }
    }

    /// For the page.
    pub fn state(&self) -> ResultState {
        let removed = self.built_points - self.shape.points();
        let report = edited(&self.report, &self.shape, removed);
        let view = |view: &reconstruct::report::ViewReport| ViewUse {
            name: view.name.clone(),
            used: view.used,
            reason: view.reason.clone(),
        };
        ResultState {
            version: self.version,
            points: report.points,
            verdict: report.verdict,
            dimensions_m: report.dimensions_m,
            dimensions_uncertainty_m: report.dimensions_uncertainty_m,
            views: report.views.iter().map(view).collect(),
            warnings: report.warnings,
            removed,
            can_undo: !self.earlier.is_empty(),
        }
    }
}

/// The report of a model from which points were taken away.
fn edited(report: &Report, shape: &Shape, removed: usize) -> Report {
    if removed == 0 {
        return report.clone();
    }
    let mut report = outcome::measured_again(report, &shape.mesh);
    report.warnings.push(format!("edited: {removed} points removed"));
    report
}

/// The folder of the model, and which version lies there.
#[derive(Debug)]
struct Files {
    folder: PathBuf,
    written: Mutex<Option<u64>>,
}

/// One version of the model, ready to be written.
#[derive(Debug)]
pub struct Edition {
    files: Arc<Files>,
    shape: Arc<Shape>,
    report: Report,
    version: u64,
}

impl Edition {
    /// The folder of the model.
    pub fn folder(&self) -> &Path {
        &self.files.folder
    }

    /// Writes this version unless it, or a later one, lies there; waits for whoever writes just now.
    pub fn write(&self) -> Result<(), OutputError> {
        let mut written = self.files.written.lock().unwrap_or_else(PoisonError::into_inner);
        if written.is_some_and(|version| version >= self.version) {
            return Ok(());
        }
        result::write(&self.files.folder, &self.shape.mesh, &self.report)?;
        *written = Some(self.version);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use reconstruct::cloud::PointCloud;
    use reconstruct::report::{CalibrationReport, Ground, Verdict};

    use super::*;

    fn report(points: usize) -> Report {
        Report {
            version: 1,
            views: vec![],
            recordings: vec![],
            points,
            dimensions_m: None,
            dimensions_uncertainty_m: None,
            surface: None,
            ground: Ground::Board,
            joint: None,
            depth_calibration: CalibrationReport::default(),
            warnings: vec!["first".into()],
            verdict: Verdict::Good,
            verdict_reason: "all".into(),
            timings_ms: serde_json::Map::new(),
            software: "0".into(),
            source_chain: None,
        }
    }

    /// A line of points whose x tells them apart.
    fn cloud(count: usize) -> Mesh {
        let points: Vec<[f32; 3]> = (0..count).map(|i| [i as f32 * 0.001, 0.0, 0.02]).collect();
        let colors = vec![[9; 3]; count];
        Mesh::of_points(PointCloud { colors, normals: vec![[0.0, 0.0, 1.0]; count], points })
    }

    fn streamed(shape: &Shape) -> Vec<i32> {
        let (_, mesh) = stream::decode(&shape.stream).unwrap();
        mesh.vertices.points.iter().map(|p| (p[0] * 1000.0).round() as i32).collect()
    }

    #[test]
    fn points_are_counted_as_the_stream_has_them() {
        let shape = Shape::new(cloud(200)).unwrap();
        let before = streamed(&shape);
        let left = shape.without(&[3, 0, 150, 3]).unwrap();
        let mut expected: Vec<i32> =
            before.iter().enumerate().filter(|(i, _)| ![0, 3, 150].contains(i)).map(|(_, x)| *x).collect();
        let mut found = streamed(&left);
        expected.sort_unstable();
        found.sort_unstable();
        assert_eq!(found, expected);
        assert!(matches!(shape.without(&[200]), Err(RemoveError::NoSuchPoint(200))));
        let all: Vec<u32> = (0..200).collect();
        assert!(matches!(shape.without(&all), Err(RemoveError::NothingLeft)));
    }

    #[test]
    fn removals_are_written_and_taken_back() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("model");
        let mut model = Model::new(Shape::new(cloud(300)).unwrap(), report(300), 1, folder.clone());
        let smaller = model.shape().without(&(0..100).collect::<Vec<_>>()).unwrap();
        model.replace(smaller, 1).unwrap();
        let state = model.state();
        assert_eq!((state.version, state.points, state.removed, state.can_undo), (2, 200, 100, true));
        assert_eq!(state.warnings, ["first", "edited: 100 points removed"]);
        assert!(state.dimensions_m.is_some(), "measured again");
        assert!(matches!(model.replace(Shape::new(cloud(5)).unwrap(), 1), Err(RemoveError::Outdated)));
        model.edition().write().unwrap();
        let written: Report =
            serde_json::from_slice(&std::fs::read(folder.join("report.json")).unwrap()).unwrap();
        assert_eq!((written.points, written.warnings.len()), (200, 2));
        assert!(folder.join("model.ply").is_file() && folder.join("poster.png").is_file());
        assert!(model.undo() && !model.undo());
        let state = model.state();
        assert_eq!((state.version, state.points, state.removed, state.can_undo), (3, 300, 0, false));
    }
}
