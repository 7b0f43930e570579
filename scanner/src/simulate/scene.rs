//! What stands in front of the camera: the product on its sheet, the table, the room and things that do not belong to the scan.

use nalgebra::{Point3, Vector3};
use reconstruct::mesh::Mesh;
use reconstruct::pose::Pose;

use super::board::Sheet;
use super::product::Product;
use super::sdf::Vec3;
use super::texture::{Rgb, bars, clouds, hue, mix, noise, scale, stripe};

mod solids;
pub use solids::cover_boxes;

/// How deep the table lies under the sheet, metres.
const SHEET_THICKNESS: f32 = 0.003;

/// What a surface is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Material {
    /// The product.
    Product,
    /// The printed sheet.
    Sheet,
    /// The table, wood.
    Table,
    /// Walls with pictures and the floor.
    Room,
    /// A thing that stands about.
    Thing(Rgb, u32),
    /// A cloth or book that hides part of the sheet.
    Cover(Rgb),
}

/// A part of the scene: triangles in the world, counter-clockwise seen from outside.
#[derive(Debug, Clone)]
pub struct Object {
    /// Corners, metres, world.
    pub vertices: Vec<[f32; 3]>,
    /// Indices into the corners.
    pub triangles: Vec<[u32; 3]>,
    /// A shading normal for every triangle.
    pub normals: Vec<[f32; 3]>,
    /// What it is made of.
    pub material: Material,
}

/// Everything the cameras see in one view.
pub struct Scene<'a> {
    /// Parts, in the order they are drawn.
    pub objects: Vec<Object>,
    product: Option<&'a Product>,
    product_from_world: Pose,
    sheet: Option<&'a Sheet>,
    seed: u32,
}

impl<'a> Scene<'a> {
    /// A product on a sheet (or on the bare table) in a room; `covers` lie on the sheet.
    pub fn new(
        product: &'a Product,
        mesh: &Mesh,
        world_from_product: &Pose,
        sheet: Option<&'a Sheet>,
        covers: &[Object],
        seed: u32,
    ) -> Self {
        let mut objects = vec![product_object(mesh, world_from_product)];
        objects.extend(sheet.map(sheet_object));
        objects.extend_from_slice(covers);
        let top = if sheet.is_some() { -SHEET_THICKNESS } else { 0.0 };
        objects.extend(solids::room(top, seed));
        Self {
            objects,
            product: Some(product),
            product_from_world: world_from_product.inverse(),
            sheet,
            seed,
        }
    }

    /// A scene of the given parts alone, for tests of the cameras.
    pub fn of_objects(objects: Vec<Object>) -> Self {
        Self { objects, product: None, product_from_world: Pose::identity(), sheet: None, seed: 0 }
    }

    /// What an object is made of.
    pub fn material(&self, object: u16) -> Material {
        self.objects[usize::from(object)].material
    }

    /// Colour of an object's surface at a point in the world.
    pub fn color(&self, object: u16, p: &Point3<f64>) -> Rgb {
        let at = p.coords.cast::<f32>();
        match self.material(object) {
            Material::Product => self.product.map_or([0.5; 3], |product| product.color(self.in_product(p))),
            Material::Sheet => self.sheet.map_or([0.9; 3], |sheet| sheet.color(p.x, p.y)),
            Material::Table => wood(at, self.seed),
            Material::Room => room_color(at, self.seed),
            Material::Thing(color, seed) => thing_color(at, color, seed),
            Material::Cover(color) => scale(color, 0.8 + 0.4 * clouds(at * 45.0, self.seed ^ 0xc1)),
        }
    }

    /// How shiny an object is at a point in the world, 0..1.
    pub fn gloss(&self, object: u16, p: &Point3<f64>) -> f32 {
        match self.material(object) {
            Material::Product => self.product.map_or(0.0, |product| product.gloss(self.in_product(p))),
            Material::Thing(..) => 0.2,
            Material::Table => 0.05,
            _ => 0.0,
        }
    }

    fn in_product(&self, p: &Point3<f64>) -> Vec3 {
        (self.product_from_world * p).coords.cast()
    }
}

fn product_object(mesh: &Mesh, world_from_product: &Pose) -> Object {
    let placed = mesh.vertices.transformed(world_from_product);
    let mean = |t: &[u32; 3]| {
        let sum: Vector3<f32> = t.iter().map(|&i| Vector3::from(placed.normals[i as usize])).sum();
        sum.try_normalize(1e-9).unwrap_or_else(Vector3::z).into()
    };
    Object {
        normals: mesh.triangles.iter().map(mean).collect(),
        triangles: mesh.triangles.clone(),
        vertices: placed.points,
        material: Material::Product,
    }
}

fn sheet_object(sheet: &Sheet) -> Object {
    let [x0, y0] = sheet.low.map(|v| v as f32);
    let [x1, y1] = sheet.high.map(|v| v as f32);
    Object {
        vertices: vec![[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        normals: vec![[0.0, 0.0, 1.0]; 2],
        material: Material::Sheet,
    }
}

/// Planks with grain.
fn wood(p: Vec3, seed: u32) -> Rgb {
    let plank = (p.y / 0.14).floor();
    let tone = noise(Vec3::new(plank * 7.3, 0.5, 0.5), seed);
    let grain = clouds(Vec3::new(p.x * 5.0 + plank * 3.7, p.y * 90.0, 0.0), seed ^ 0x11);
    let knot = clouds(p * 9.0, seed ^ 0x12);
    let base = hue(0.065 + 0.03 * noise(Vec3::repeat(0.3), seed), 0.5, 0.62);
    let seam = (p.y / 0.14 - plank) < 0.012;
    scale(
        base,
        (0.62 + 0.3 * tone + 0.35 * (grain - 0.5) + 0.2 * (knot - 0.5)) * if seam { 0.55 } else { 1.0 },
    )
}

/// Painted walls with pictures and a shelf of books; a carpet below.
fn room_color(p: Vec3, seed: u32) -> Rgb {
    if p.z < -0.7 {
        let knots = stripe(p.x, 0.16, 0.5) != stripe(p.y, 0.16, 0.5);
        return scale([0.42, 0.40, 0.44], if knots { 0.85 } else { 1.05 });
    }
    let along = if p.x.abs() > p.y.abs() { p.y * p.x.signum() } else { p.x * -p.y.signum() };
    let wall = mix(hue(noise(Vec3::repeat(0.7), seed), 0.14, 0.72), [0.8, 0.79, 0.76], 0.4);
    let shade = 0.85 + 0.12 * (p.z / 2.0).clamp(-1.0, 1.0) + 0.1 * (clouds(p * 0.9, seed) - 0.5);
    let (u, v) = ((along / 0.9).rem_euclid(1.0) * 0.9, p.z);
    if (0.12..0.62).contains(&u) && (0.22..0.68).contains(&v) {
        let frame = !(0.15..0.59).contains(&u) || !(0.25..0.65).contains(&v);
        let panel = (along / 0.9).floor() as i32;
        let paint = clouds(Vec3::new(u * 9.0, v * 9.0, panel as f32 * 3.1), seed ^ 0x21);
        return if frame { [0.25, 0.2, 0.16] } else { hue(paint * 1.6, 0.55, 0.4 + 0.5 * paint) };
    }
    if (-0.45..-0.15).contains(&v) {
        let spine = bars((along / 0.035).floor() + 0.5, seed);
        let tone = noise(Vec3::new((along / 0.035).floor() * 1.7, 0.2, 0.9), seed ^ 0x31);
        let gap = stripe(along, 0.035, 0.08) || v > -0.2 - 0.06 * tone;
        return if gap {
            [0.22, 0.2, 0.19]
        } else {
            hue(tone * 2.0, if spine { 0.6 } else { 0.25 }, 0.35 + 0.4 * tone)
        };
    }
    scale(wall, shade)
}

/// A thing with a band and a mark, so that the background has corners too.
fn thing_color(p: Vec3, color: Rgb, seed: u32) -> Rgb {
    let other = [color[2], color[0], color[1]];
    if stripe(p.z - 0.02, 0.09, 0.22) {
        return scale(other, 0.9);
    }
    let check = stripe(p.x + p.y, 0.05, 0.3) && stripe(p.z, 0.03, 0.5);
    scale(if check { mix(color, [0.95; 3], 0.5) } else { color }, 0.8 + 0.4 * clouds(p * 40.0, seed))
}
