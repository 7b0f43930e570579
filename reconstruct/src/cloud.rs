//! Point clouds as a struct of arrays. The frame is named by the variable: `cloud_in_camera`, `cloud_in_world`.

use nalgebra::{Point3, Vector3};

use crate::pose::Pose;

/// Points in metres; an attribute exists where its length equals the points'.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PointCloud {
    /// Coordinates `[x, y, z]`, metres.
    pub points: Vec<[f32; 3]>,
    /// sRGB colours: empty or one a point.
    pub colors: Vec<[u8; 3]>,
    /// Unit normals: empty or one a point.
    pub normals: Vec<[f32; 3]>,
}

impl PointCloud {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Whether every point has a colour.
    pub fn has_colors(&self) -> bool {
        !self.is_empty() && self.colors.len() == self.len()
    }

    /// Whether every point has a normal.
    pub fn has_normals(&self) -> bool {
        !self.is_empty() && self.normals.len() == self.len()
    }

    /// The points named by `indices`, in that order, with their attributes.
    pub fn select(&self, indices: &[usize]) -> Self {
        let pick = |values: &Vec<[f32; 3]>| indices.iter().filter_map(|&i| values.get(i).copied()).collect();
        Self {
            points: pick(&self.points),
            colors: indices.iter().filter_map(|&i| self.colors.get(i).copied()).collect(),
            normals: pick(&self.normals),
        }
    }

    /// The cloud in frame a, of a cloud in frame b.
    pub fn transformed(&self, a_from_b: &Pose) -> Self {
        let a_from_b = a_from_b.cast::<f32>();
        Self {
            points: self.points.iter().map(|p| (a_from_b * Point3::from(*p)).into()).collect(),
            colors: self.colors.clone(),
            normals: self.normals.iter().map(|n| (a_from_b.rotation * Vector3::from(*n)).into()).collect(),
        }
    }

    /// Adds another cloud of the same frame; an attribute survives where both have it.
    pub fn append(&mut self, other: &Self) {
        let (empty, colors, normals) = (self.is_empty(), other.has_colors(), other.has_normals());
        let keep_colors = colors && (empty || self.has_colors());
        let keep_normals = normals && (empty || self.has_normals());
        self.points.extend_from_slice(&other.points);
        if keep_colors {
            self.colors.extend_from_slice(&other.colors);
        } else {
            self.colors.clear();
        }
        if keep_normals { self.normals.extend_from_slice(&other.normals) } else { self.normals.clear() }
    }

    /// Lowest and highest coordinates; `None` for an empty cloud.
    pub fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        let first = *self.points.first()?;
        Some(self.points.iter().fold((first, first), |(lo, hi), p| {
            (std::array::from_fn(|k| lo[k].min(p[k])), std::array::from_fn(|k| hi[k].max(p[k])))
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn appending_without_colours_drops_them() {
        let mut a = PointCloud { points: vec![[0.0; 3]], colors: vec![[1; 3]], normals: vec![] };
        a.append(&PointCloud { points: vec![[1.0; 3]], ..PointCloud::default() });
        assert_eq!(a.len(), 2);
        assert!(!a.has_colors());
        assert_eq!(a.bounds(), Some(([0.0; 3], [1.0; 3])));
    }
}
