//! BOP scene folders: `scene_camera.json` with `cam_K` and `depth_scale` per image, pictures in `rgb/` and `depth/`
//! (Hodan et al., BOP challenge's dataset format). Depth is registered to colour.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Matrix4, Vector3};
use reconstruct::pose::{self, Pose};
use serde::Deserialize;

use super::folder::{pictures, stem, sub_folder};
use super::{ImportError, Options, Source, SourceFrame, read_file};

const FILE: &str = "scene_camera.json";

/// One image's camera.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Camera {
    /// 3x3, row-major.
    #[serde(rename = "cam_K")]
    pub matrix: [f64; 9],
    /// Millimetres a depth unit.
    #[serde(default = "one")]
    pub depth_scale: f64,
    /// Camera from world, 3x3 row-major.
    #[serde(rename = "cam_R_w2c")]
    rotation: Option<[f64; 9]>,
    /// Camera from world, millimetres.
    #[serde(rename = "cam_t_w2c")]
    translation: Option<[f64; 3]>,
}

fn one() -> f64 {
    1.0
}

impl Camera {
    /// The pose, where the scene gives one that is rigid.
    pub fn world_from_camera(&self) -> Option<Pose> {
        let (rotation, millimetres) = (self.rotation?, self.translation?);
        let mut matrix = Matrix4::identity();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::from_row_slice(&rotation));
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&(Vector3::from(millimetres) / 1000.0));
        let rows: [f64; 16] = std::array::from_fn(|i| matrix[(i / 4, i % 4)]);
        pose::from_row_major(&rows).map(|camera_from_world| camera_from_world.inverse())
    }
}

/// Cameras by image number.
pub fn parse_scene_camera(bytes: &[u8]) -> Result<BTreeMap<u64, Camera>, ImportError> {
    let wrong = |what: String| ImportError::Json { file: FILE, what };
    let named: BTreeMap<String, Camera> = serde_json::from_slice(bytes).map_err(|e| wrong(e.to_string()))?;
    let mut cameras = BTreeMap::new();
    for (name, camera) in named {
        let number = name.parse().map_err(|e| wrong(format!("{name:?} is no image number ({e})")))?;
        if !(camera.depth_scale > 0.0 && camera.depth_scale <= 10.0) {
            return Err(wrong(format!("depth_scale of image {number} is {}", camera.depth_scale)));
        }
        cameras.insert(number, camera);
    }
    Ok(cameras)
}

pub(super) fn read(folder: &Path) -> Result<Source, ImportError> {
    let cameras = parse_scene_camera(&read_file(&folder.join(FILE))?)?;
    let first = cameras.values().next().ok_or(ImportError::NoFrames)?;
    let color_folder = sub_folder(folder, &["rgb", "gray"]).ok_or(ImportError::NoFrames)?;
    let depth_folder = sub_folder(folder, &["depth"]).ok_or(ImportError::NoFrames)?;
    let by_number = |folder: &Path| -> Result<BTreeMap<u64, std::path::PathBuf>, ImportError> {
        Ok(pictures(folder)?.into_iter().filter_map(|path| Some((stem(&path).parse().ok()?, path))).collect())
    };
    let (colors, depths) = (by_number(&color_folder)?, by_number(&depth_folder)?);
    let mut frames = Vec::new();
    for (number, camera) in &cameras {
        let (Some(color), Some(depth)) = (colors.get(number), depths.get(number)) else { continue };
        if (&camera.matrix, camera.depth_scale) != (&first.matrix, first.depth_scale) {
            return Err(ImportError::CameraChanges(number.to_string()));
        }
        frames.push(SourceFrame {
            name: format!("{number:03}"),
            color: color.clone(),
            depth: depth.clone(),
            timestamp_nanos: 0,
            world_from_camera: camera.world_from_camera(),
        });
    }
    let k = first.matrix;
    let known = Options {
        color_camera: Some([k[0], k[4], k[2], k[5]]),
        units_per_metre: Some(1000.0 / first.depth_scale),
        ..Options::default()
    };
    Ok(Source { known, frames, is_stream: false, invalid_depth: None })
}
