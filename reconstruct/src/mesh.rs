//! Triangle meshes as a struct of arrays, metres.

use crate::cloud::PointCloud;

/// Vertices with their attributes and the triangles between them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Vertex positions, colours and normals.
    pub vertices: PointCloud,
    /// Indices into the vertices, counter-clockwise seen from outside. Empty for a plain point cloud.
    pub triangles: Vec<[u32; 3]>,
}
