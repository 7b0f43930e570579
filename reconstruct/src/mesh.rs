//! Triangle meshes as a struct of arrays, metres.

pub mod topology;

use rayon::prelude::*;

use crate::cloud::PointCloud;

/// Deviation of a vertex that nobody measured: it was invented to close a hole.
pub const INVENTED: f32 = f32::INFINITY;

/// Vertices with their attributes and the triangles between them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Vertex positions, colours and normals.
    pub vertices: PointCloud,
    /// Indices into the vertices, counter-clockwise seen from outside. Empty for a plain point cloud.
    pub triangles: Vec<[u32; 3]>,
    /// Standard deviation of each vertex along its normal, metres, [`INVENTED`] where nothing was measured; empty where
    /// nothing is known of it.
    pub deviations_metres: Vec<f32>,
}

impl Mesh {
    /// Points alone.
    pub fn of_points(vertices: PointCloud) -> Self {
        Self { vertices, ..Self::default() }
    }

    /// Whether every vertex has a deviation.
    pub fn has_deviations(&self) -> bool {
        !self.vertices.is_empty() && self.deviations_metres.len() == self.vertices.len()
    }

    /// Whether a vertex was invented.
    pub fn is_invented(&self, vertex: usize) -> bool {
        self.deviations_metres.get(vertex).is_some_and(|d| *d == INVENTED)
    }

    /// How many vertices were measured.
    pub fn measured_count(&self) -> usize {
        (0..self.vertices.len()).filter(|&v| !self.is_invented(v)).count()
    }

    /// The vertices that were measured.
    pub fn measured(&self) -> PointCloud {
        if !self.has_deviations() {
            return self.vertices.clone();
        }
        let measured: Vec<usize> = (0..self.vertices.len()).filter(|&v| !self.is_invented(v)).collect();
        self.vertices.select(&measured)
    }

    /// Area of a triangle, square metres.
    pub fn area(&self, triangle: &[u32; 3]) -> f64 {
        0.5 * self.twice_area_vector(triangle).norm()
    }

    /// Areas of all triangles, square metres.
    pub fn areas(&self) -> Vec<f64> {
        self.triangles.par_iter().map(|triangle| self.area(triangle)).collect()
    }

    /// Normal of a triangle, twice as long as its area, square metres.
    pub fn twice_area_vector(&self, triangle: &[u32; 3]) -> nalgebra::Vector3<f64> {
        let [a, b, c] =
            triangle.map(|i| nalgebra::Vector3::from(self.vertices.points[i as usize]).cast::<f64>());
        (b - a).cross(&(c - a))
    }

    /// The vertices where `keep` says so, with the triangles between them.
    pub fn select(&self, keep: &[bool]) -> Self {
        let kept: Vec<usize> = (0..keep.len()).filter(|&i| keep[i]).collect();
        let mut new_index = vec![u32::MAX; keep.len()];
        kept.iter().enumerate().for_each(|(new, &old)| new_index[old] = new as u32);
        let all_kept = |t: &&[u32; 3]| t.iter().all(|&i| keep[i as usize]);
        Self {
            vertices: self.vertices.select(&kept),
            triangles: self
                .triangles
                .iter()
                .filter(all_kept)
                .map(|t| t.map(|i| new_index[i as usize]))
                .collect(),
            deviations_metres: kept.iter().filter_map(|&i| self.deviations_metres.get(i).copied()).collect(),
        }
    }

    /// Without vertices that no triangle uses; plain points stay as they are.
    pub fn without_loose_vertices(&self) -> Self {
        if self.triangles.is_empty() {
            return self.clone();
        }
        let mut used = vec![false; self.vertices.len()];
        self.triangles.iter().flatten().for_each(|&i| used[i as usize] = true);
        self.select(&used)
    }
}
