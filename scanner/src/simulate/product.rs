//! The products the simulated Kinect scans: solids with painted surfaces, standing on z = 0, made by this code alone.

use std::fmt;

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use reconstruct::cloud::PointCloud;
use reconstruct::mesh::Mesh;
use serde::{Deserialize, Serialize};

use super::nets::surface_net;
use super::sdf::Vec3;
use super::texture::Rgb;

mod basket;
mod bottle;
mod bowl;
mod camera;
mod crackerbox;
mod figurine;
mod mug;
mod shoe;

/// Size of the cells the products are polygonised with, metres.
const CELL: f32 = 0.0013;

/// A solid with a painted surface: its own frame has z up, the foot at z = 0, the axis of the board's middle at x = y = 0.
pub trait Shape: Send + Sync {
    /// Signed distance in metres, negative inside.
    fn distance(&self, p: Vec3) -> f32;
    /// Paint at a place of the surface.
    fn color(&self, p: Vec3) -> Rgb;
    /// How shiny it is there, 0 (paper) to 1 (glazed).
    fn gloss(&self, p: Vec3) -> f32;
    /// Box that holds the solid, metres.
    fn bounds(&self) -> (Vec3, Vec3);
}

/// Which product.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, clap::ValueEnum,
)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A sauce bottle, rotationally symmetric but for its label.
    Bottle,
    /// A mug with a handle, a thin wall and a floor near the board.
    Mug,
    /// A compact camera with a lens barrel.
    Camera,
    /// A running shoe.
    Shoe,
    /// A penguin figurine.
    Figurine,
    /// A glazed bowl.
    Bowl,
    /// A small basket with a thin arched handle.
    Basket,
    /// A box of crackers.
    Crackerbox,
}

impl Kind {
    /// All products.
    pub const ALL: [Kind; 8] = [
        Self::Bottle,
        Self::Mug,
        Self::Camera,
        Self::Shoe,
        Self::Figurine,
        Self::Bowl,
        Self::Basket,
        Self::Crackerbox,
    ];

    /// The name used on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bottle => "bottle",
            Self::Mug => "mug",
            Self::Camera => "camera",
            Self::Shoe => "shoe",
            Self::Figurine => "figurine",
            Self::Bowl => "bowl",
            Self::Basket => "basket",
            Self::Crackerbox => "crackerbox",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A product of a kind; the seed changes its size by a few percent and its paint.
pub struct Product {
    shape: Box<dyn Shape>,
    size: f32,
}

impl Product {
    /// The product of a kind and a seed.
    pub fn new(kind: Kind, seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(seed ^ (0x5eed << 8) ^ kind as u64);
        let size = 0.92 + 0.16 * rng.f32();
        let shape: Box<dyn Shape> = match kind {
            Kind::Bottle => Box::new(bottle::Bottle::new(&mut rng)),
            Kind::Mug => Box::new(mug::Mug::new(&mut rng)),
            Kind::Camera => Box::new(camera::Camera::new(&mut rng)),
            Kind::Shoe => Box::new(shoe::Shoe::new(&mut rng)),
            Kind::Figurine => Box::new(figurine::Figurine::new(&mut rng)),
            Kind::Bowl => Box::new(bowl::Bowl::new(&mut rng)),
            Kind::Basket => Box::new(basket::Basket::new(&mut rng)),
            Kind::Crackerbox => Box::new(crackerbox::Crackerbox::new(&mut rng)),
        };
        Self { shape, size }
    }

    /// The same product, smaller: used where a board is too small for it.
    pub fn shrunk(mut self, by: f32) -> Self {
        self.size *= by;
        self
    }

    /// Box that holds it, metres.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let (low, high) = self.shape.bounds();
        (low * self.size, high * self.size)
    }

    /// Paint at a place of its surface, metres.
    pub fn color(&self, p: Vec3) -> Rgb {
        self.shape.color(p / self.size)
    }

    /// How shiny it is at a place of its surface.
    pub fn gloss(&self, p: Vec3) -> f32 {
        self.shape.gloss(p / self.size)
    }

    fn distance(&self, p: Vec3) -> f32 {
        let p = p / self.size;
        self.shape.distance(p).max(-p.z) * self.size
    }

    /// Its surface as a closed mesh with colours and normals, in the product's own frame.
    pub fn mesh(&self) -> Mesh {
        let (low, high) = self.bounds();
        let margin = Vec3::repeat(4.0 * CELL);
        let net = surface_net(&|p| self.distance(p), low - margin, high + margin, CELL);
        let normals = vertex_normals(&net.vertices, &net.triangles);
        let colors =
            net.vertices.par_iter().map(|&p| self.color(p).map(|c| (c * 255.0 + 0.5) as u8)).collect();
        let points = net.vertices.iter().map(|p| (*p).into()).collect();
        Mesh { vertices: PointCloud { points, colors, normals }, triangles: net.triangles, ..Mesh::default() }
    }
}

/// Area-weighted mean of the normals of the triangles around each vertex.
fn vertex_normals(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[f32; 3]> {
    let mut sums = vec![Vector3::<f32>::zeros(); vertices.len()];
    for t in triangles {
        let [a, b, c] = t.map(|i| Point3::from(vertices[i as usize]));
        let normal = (b - a).cross(&(c - a));
        for &i in t {
            sums[i as usize] += normal;
        }
    }
    sums.iter().map(|n| n.try_normalize(1e-20).unwrap_or_else(Vector3::z).into()).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    /// Every edge once in each direction: closed, manifold along edges, one orientation.
    fn check_closed(kind: Kind, mesh: &Mesh) {
        let mut edges = HashMap::new();
        for t in &mesh.triangles {
            for k in 0..3 {
                *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        let place = |i: u32| mesh.vertices.points[i as usize];
        let twice: Vec<_> = edges.iter().filter(|(_, n)| **n != 1).map(|(e, _)| place(e.0)).collect();
        assert!(twice.is_empty(), "{kind}: edges used twice in one direction at {twice:?}");
        let open: Vec<_> =
            edges.keys().filter(|(a, b)| !edges.contains_key(&(*b, *a))).map(|e| place(e.0)).collect();
        assert!(open.is_empty(), "{kind}: open edges at {open:?}");
    }

    fn volume(mesh: &Mesh) -> f64 {
        let corner = |i: u32| Vector3::from(mesh.vertices.points[i as usize]).cast::<f64>();
        mesh.triangles.iter().map(|&[a, b, c]| corner(a).dot(&corner(b).cross(&corner(c))) / 6.0).sum()
    }

    #[test]
    fn every_product_is_a_closed_solid_on_the_board() {
        for kind in Kind::ALL {
            for seed in 1..=4 {
                let mesh = Product::new(kind, seed).mesh();
                check_closed(kind, &mesh);
                assert!(volume(&mesh) > 1e-5, "{kind}: the inside is outside");
                let (low, high) = mesh.vertices.bounds().unwrap();
                assert!(low[2].abs() < 2e-4, "{kind} stands at {}", low[2]);
                let largest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
                assert!((0.08..0.29).contains(&largest), "{kind} is {largest} m large");
            }
        }
    }

    #[test]
    fn products_differ_and_seeds_repeat() {
        let meshes: Vec<Mesh> = Kind::ALL.iter().map(|&kind| Product::new(kind, 3).mesh()).collect();
        for (i, a) in meshes.iter().enumerate() {
            assert!(meshes[i + 1..].iter().all(|b| (volume(a) / volume(b) - 1.0).abs() > 1e-3));
        }
        assert_eq!(Product::new(Kind::Mug, 3).mesh(), meshes[1]);
        assert_ne!(Product::new(Kind::Mug, 4).mesh(), meshes[1]);
    }
}
