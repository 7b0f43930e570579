//! Reads a finished model back.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use reconstruct::mesh::Mesh;
use reconstruct::model_file::{self, Kind, Limits, glb};
use serde_json::{Value, json};

use super::ImportError;
use crate::pictures;

/// Reads a model by its content, else by its name.
pub fn read(path: &Path) -> Result<Mesh, ImportError> {
    let unreadable = |source| ImportError::Unreadable { path: path.to_owned(), source };
    let mut file = File::open(path).map_err(unreadable)?;
    let mut start = Vec::new();
    (&mut file).take(512).read_to_end(&mut start).map_err(unreadable)?;
    file.rewind().map_err(unreadable)?;
    let kind = Kind::sniff(&start).or_else(|| Kind::from_name(&path.to_string_lossy()));
    let kind = kind.ok_or_else(|| ImportError::NotRecognised(path.to_owned()))?;
    let reader = BufReader::with_capacity(1 << 18, file);
    let model = |source| ImportError::Model { path: path.to_owned(), source };
    if kind == Kind::Glb {
        let mut decode = |bytes: &[u8]| pictures::decode_color_of_any_size(bytes).ok();
        return glb::read_with_textures(reader, &Limits::default(), &mut decode).map_err(model);
    }
    model_file::read(kind, reader, &Limits::default()).map_err(model)
}

/// What can be said of a model nobody scanned: its extent along the axes, and the `warnings` of what was made of it.
pub fn report(mesh: &Mesh, source: &str, warnings: &[String]) -> Value {
    let size = mesh
        .vertices
        .bounds()
        .map_or([0.0; 3], |(low, high)| std::array::from_fn(|k| f64::from(high[k]) - f64::from(low[k])));
    let [x, y, height] = size;
    let unknown = format!("imported from {source}: how it was measured is not known");
    let warnings: Vec<&String> = std::iter::once(&unknown).chain(warnings).collect();
    json!({
        "version": 1,
        "views": [],
        "points": mesh.measured_count(),
        "triangles": mesh.triangles.len(),
        "dimensions_m": [x.max(y), x.min(y), height],
        "dimensions_uncertainty_m": null,
        "depth_calibration": null,
        "warnings": warnings,
        "verdict": "acceptable",
        "timings_ms": {},
        "software": env!("CARGO_PKG_VERSION"),
    })
}
