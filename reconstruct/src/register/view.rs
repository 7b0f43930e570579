//! A view as placement without a board needs it: thinned clouds for ICP and an organised depth map for verification.
//!
//! Camera frame, metres. Lengths are chosen by the distance of what the camera looks at: a cell of the grid stays about as many
//! pixels wide for a product at 0.7 m and for a room.

use crate::camera::Intrinsics;
use crate::cloud::PointCloud;
use crate::normals::{DepthJump, normals_of_depth};
use crate::voxel::{VoxelError, downsample};

/// Edge of a fine cell as a share of the distance.
const CELL_PER_DISTANCE: f32 = 0.008;
/// What is farther than this many times the distance of the middle is left out: noise there grows with z².
const REACH: f32 = 2.2;
/// Half side of the normals' window at half resolution, pixels.
const NORMAL_RADIUS_PX: usize = 3;

/// A depth map at half resolution with the colours of its pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMap {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The full-resolution camera that [`DepthMap::pixel_of`] projects with.
    camera: Intrinsics,
    /// Points, camera frame; NaN where nothing was measured.
    pub points: Vec<[f32; 3]>,
    /// Normals towards the camera; zero where none could be told.
    pub normals: Vec<[f32; 3]>,
    /// sRGB.
    pub colors: Vec<[u8; 3]>,
}

impl DepthMap {
    /// Halves an organised map of `camera.width * camera.height` points (z = 0 or NaN where there is none).
    fn halved(camera: Intrinsics, points: &[[f32; 3]], colors: &[[u8; 3]]) -> Self {
        let (full, width, height) =
            (camera.width as usize, camera.width as usize / 2, camera.height as usize / 2);
        let jump = DepthJump::default();
        let mut map = Self {
            width,
            height,
            camera,
            points: Vec::with_capacity(width * height),
            normals: Vec::new(),
            colors: Vec::with_capacity(width * height),
        };
        for v in 0..height {
            for u in 0..width {
                let first = 2 * v * full + 2 * u;
                let (point, color) =
                    mean_of_block([first, first + 1, first + full, first + full + 1], points, colors, jump);
                map.points.push(point);
                map.colors.push(color);
            }
        }
        map.normals = normals_of_depth(&map.points, width, height, NORMAL_RADIUS_PX, jump).normals;
        map
    }

    /// Index of the pixel that sees a point of this camera's frame.
    pub fn pixel_of(&self, p_in_camera: &nalgebra::Point3<f64>) -> Option<usize> {
        let pixel = self.camera.project(p_in_camera)?;
        // The centre of a block of four lies between their centres.
        let (u, v) = (((pixel.x - 0.5) / 2.0).round(), ((pixel.y - 0.5) / 2.0).round());
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64;
        inside.then(|| v as usize * self.width + u as usize)
    }
}

/// Mean of those of four pixels that lie on the nearest one's surface.
fn mean_of_block(
    block: [usize; 4],
    points: &[[f32; 3]],
    colors: &[[u8; 3]],
    jump: DepthJump,
) -> ([f32; 3], [u8; 3]) {
    let nearest = block.iter().map(|i| points[*i][2]).filter(|z| *z > 0.0).fold(f32::INFINITY, f32::min);
    let limit = nearest + jump.metres + jump.per_square_metre * nearest * nearest;
    let (mut point, mut color, mut count) = ([0.0f32; 3], [0u32; 3], 0u32);
    for i in block.into_iter().filter(|i| points[*i][2] > 0.0 && points[*i][2] <= limit) {
        count += 1;
        for k in 0..3 {
            point[k] += points[i][k];
            color[k] += u32::from(colors[i][k]);
        }
    }
    if count == 0 {
        return ([f32::NAN; 3], colors[block[0]]);
    }
    (point.map(|v| v / count as f32), color.map(|v| ((v + count / 2) / count) as u8))
}

/// One view to be placed.
#[derive(Debug, Clone, PartialEq)]
pub struct RegisterView {
    /// Thinned to one point a [`RegisterView::cell`], with colours and normals.
    pub fine: PointCloud,
    /// Thinned to twice the cell.
    pub coarse: PointCloud,
    /// The measured pixels, where the view is organised.
    pub depth: Option<DepthMap>,
    /// Edge of a fine cell, metres.
    pub cell: f32,
    /// Distance of what the camera looks at, metres.
    pub distance: f32,
}

impl RegisterView {
    /// A view of an organised depth map: `points` and `colors` have one entry a pixel of `camera`, z = 0 or NaN where nothing
    /// was measured.
    ///
    /// `cell` fixes the grid for all views of a scan (see [`RegisterView::cell_for`]). `None` where the lengths don't fit the
    /// camera or nothing was measured.
    pub fn organised(camera: Intrinsics, points: &[[f32; 3]], colors: &[[u8; 3]], cell: f32) -> Option<Self> {
        let pixels = camera.width as usize * camera.height as usize;
        if points.len() != pixels || colors.len() != pixels || pixels < 4 {
            return None;
        }
        let map = DepthMap::halved(camera, points, colors);
        let distance = distance_of_middle(&map.points, map.width, map.height)?;
        Self::of_map(map, cell, distance)
    }

    /// A view of a halved map, what is far beyond `distance` left out; `None` where nothing is left.
    pub(crate) fn of_map(map: DepthMap, cell: f32, distance: f32) -> Option<Self> {
        let mut cloud = PointCloud::default();
        for (i, (p, n)) in map.points.iter().zip(&map.normals).enumerate() {
            if p[2] > 0.0 && p[2] < REACH * distance && *n != [0.0; 3] {
                cloud.points.push(*p);
                cloud.normals.push(*n);
                cloud.colors.push(map.colors[i]);
            }
        }
        let view = Self::of_cloud(&cloud, cell).ok().filter(|view| !view.fine.is_empty())?;
        Some(Self { distance, depth: Some(map), ..view })
    }

    /// A view of a bare cloud with colours and normals, camera frame.
    pub fn of_cloud(cloud_in_camera: &PointCloud, cell: f32) -> Result<Self, VoxelError> {
        let fine = downsample(cloud_in_camera, cell)?.cloud;
        let coarse = downsample(cloud_in_camera, 2.0 * cell)?.cloud;
        let mut depths: Vec<f32> = fine.points.iter().map(|p| p[2].abs()).collect();
        depths.sort_unstable_by(f32::total_cmp);
        let distance = depths.get(depths.len() / 2).copied().unwrap_or(cell / CELL_PER_DISTANCE);
        Ok(Self { fine, coarse, depth: None, cell, distance })
    }

    /// The cell for views of an organised depth map like this one; `None` where nothing was measured.
    pub fn cell_for(camera: &Intrinsics, points: &[[f32; 3]]) -> Option<f32> {
        let (width, height) = (camera.width as usize, camera.height as usize);
        if points.len() != width * height {
            return None;
        }
        Some((distance_of_middle(points, width, height)? * CELL_PER_DISTANCE).max(1e-4))
    }
}

/// Lower quartile of the depths in the middle third of the picture: what the camera is pointed at.
fn distance_of_middle(points: &[[f32; 3]], width: usize, height: usize) -> Option<f32> {
    let mut depths: Vec<f32> = (height / 3..height - height / 3)
        .flat_map(|v| (width / 3..width - width / 3).map(move |u| v * width + u))
        .map(|i| points[i][2])
        .filter(|z| z.is_finite() && *z > 0.0)
        .collect();
    depths.sort_unstable_by(f32::total_cmp);
    depths.get(depths.len() / 4).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_keeps_its_place_normal_and_colour() {
        let camera = Intrinsics::pinhole(64, 48, 60.0, 60.0, 31.5, 23.5);
        let points: Vec<[f32; 3]> =
            camera.ray_table().iter().map(|r| [r[0] * 0.8, r[1] * 0.8, 0.8]).collect();
        let colors = vec![[10, 200, 30]; points.len()];
        let cell = RegisterView::cell_for(&camera, &points).unwrap();
        assert!((cell - 0.0064).abs() < 1e-6);
        let view = RegisterView::organised(camera, &points, &colors, 0.05).unwrap();
        assert!(view.fine.len() > view.coarse.len() && view.coarse.len() > 10);
        assert!(view.fine.points.iter().all(|p| (p[2] - 0.8).abs() < 1e-5));
        assert!(view.fine.normals.iter().all(|n| n[2] < -0.999));
        assert!(view.fine.colors.iter().all(|c| *c == [10, 200, 30]));
        let map = view.depth.as_ref().unwrap();
        let p = map.points[10 * 32 + 7];
        assert_eq!(map.pixel_of(&nalgebra::Point3::from(p).cast()), Some(10 * 32 + 7));
    }

    #[test]
    fn nothing_measured_is_no_view() {
        let camera = Intrinsics::pinhole(8, 6, 60.0, 60.0, 3.5, 2.5);
        assert!(RegisterView::organised(camera, &[[0.0; 3]; 48], &[[0; 3]; 48], 0.01).is_none());
        assert!(RegisterView::organised(camera, &[[0.0; 3]; 9], &[[0; 3]; 48], 0.01).is_none());
    }
}
