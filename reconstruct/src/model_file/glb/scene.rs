//! The scene: nodes with their transforms, each primitive's points and triangles brought into one mesh, z up.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Matrix4, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::accessor::{Values, item, view_bytes};
use super::color;
use super::document::{Document, Node, Primitive, TextureUse};
use super::{ModelError, bad_data};
use crate::image::ColorImage;
use crate::mesh::{INVENTED, Mesh};
use crate::model_file::{Limits, checked_point, unit_normals};

const POINTS: u32 = 0;
const TRIANGLES: u32 = 4;
const TRIANGLE_STRIP: u32 = 5;
const TRIANGLE_FAN: u32 = 6;
/// Colour of what has none.
const GRAY: [f64; 3] = [0.6; 3];

type Decode<'a> = &'a mut dyn FnMut(&[u8]) -> Option<ColorImage>;

struct Gatherer<'a> {
    document: &'a Document,
    binary: &'a [u8],
    limits: &'a Limits,
    decode: Decode<'a>,
    /// Pictures by image number; `None` where one cannot be decoded.
    pictures: BTreeMap<usize, Option<ColorImage>>,
    mesh: Mesh,
    colored: bool,
    all_normals: bool,
    all_deviations: bool,
}

/// Gathers everything the default scene shows.
pub(super) fn gather(
    document: &Document,
    binary: &[u8],
    limits: &Limits,
    decode: Decode<'_>,
) -> Result<Mesh, ModelError> {
    let pictures = BTreeMap::new();
    let mesh = Mesh::default();
    let (colored, all_normals, all_deviations) = (false, true, true);
    let mut gatherer =
        Gatherer { document, binary, limits, decode, pictures, mesh, colored, all_normals, all_deviations };
    for (node, placed) in placed_nodes(document)? {
        if let Some(index) = document.nodes[node].mesh {
            for primitive in &item(&document.meshes, index, "mesh")?.primitives {
                gatherer.add(primitive, &placed)?;
            }
        }
    }
    let Gatherer { mut mesh, colored, all_normals, all_deviations, .. } = gatherer;
    if !colored {
        mesh.vertices.colors = Vec::new();
    }
    if !all_deviations {
        mesh.deviations_metres = Vec::new();
    }
    mesh.vertices.normals = if all_normals { unit_normals(mesh.vertices.normals) } else { Vec::new() };
    Ok(mesh)
}

/// Nodes of the default scene with `scene_from_node`; every node has one parent at most, so none is met twice.
fn placed_nodes(document: &Document) -> Result<Vec<(usize, Matrix4<f64>)>, ModelError> {
    let roots = match document.scenes.get(document.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.clone(),
        None => (0..document.nodes.len()).collect(),
    };
    let mut met = vec![false; document.nodes.len()];
    let mut open: Vec<(usize, Matrix4<f64>)> = roots.into_iter().map(|n| (n, Matrix4::identity())).collect();
    let mut placed = Vec::new();
    while let Some((index, scene_from_parent)) = open.pop() {
        let node = item(&document.nodes, index, "node")?;
        if std::mem::replace(&mut met[index], true) {
            return Err(bad_data(format!("node {index} has two parents")));
        }
        let scene_from_node = scene_from_parent * parent_from_node(node);
        open.extend(node.children.iter().map(|&child| (child, scene_from_node)));
        placed.push((index, scene_from_node));
    }
    placed.sort_by_key(|(index, _)| *index);
    Ok(placed)
}

fn parent_from_node(node: &Node) -> Matrix4<f64> {
    if let Some(columns) = &node.matrix {
        return Matrix4::from_column_slice(columns);
    }
    let [x, y, z] = node.translation.unwrap_or_default();
    let [i, j, k, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 1e-9).unwrap_or_default();
    let scale = node.scale.unwrap_or([1.0; 3]);
    Translation3::new(x, y, z).to_homogeneous()
        * rotation.to_homogeneous()
        * Matrix4::new_nonuniform_scaling(&Vector3::from(scale))
}

/// Our z up from glTF's y up.
fn z_up(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, -v.z, v.y)
}

impl<'a> Gatherer<'a> {
    fn add(&mut self, primitive: &Primitive, scene_from_node: &Matrix4<f64>) -> Result<(), ModelError> {
        if !matches!(primitive.mode, POINTS | TRIANGLES | TRIANGLE_STRIP | TRIANGLE_FAN) {
            return Err(ModelError::Unsupported {
                what: "a mesh of lines".to_owned(),
                advice: "export triangles or points",
            });
        }
        let Some(&position) = primitive.attributes.get("POSITION") else { return Ok(()) };
        let positions = Values::open(self.document, self.binary, position)?.of_width(3)?;
        let (first, count) = (self.mesh.vertices.len(), positions.count);
        ModelError::refuse_more("points", first as u64 + count as u64, self.limits.max_points)?;
        for i in 0..count {
            let point = scene_from_node.transform_point(&Point3::from(positions.triple(i)));
            let point = z_up(&point.coords).map(|v| v as f32);
            self.mesh.vertices.points.push(checked_point(point.into(), first + i + 1)?);
        }
        self.add_normals(primitive, scene_from_node, count)?;
        self.add_colors(primitive, count)?;
        self.add_deviations(primitive, count)?;
        if primitive.mode != POINTS {
            let flipped = scene_from_node.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
            self.add_triangles(primitive, first, count, flipped)?;
        }
        Ok(())
    }

    /// An accessor with a value for each of `count` vertices.
    fn attribute(&self, index: usize, width: usize, count: usize) -> Result<Values<'a>, ModelError> {
        let values = Values::open(self.document, self.binary, index)?.of_width(width)?;
        if values.count == count {
            return Ok(values);
        }
        Err(bad_data(format!("accessor {index} has {} values for {count} vertices", values.count)))
    }

    fn add_normals(
        &mut self,
        primitive: &Primitive,
        scene_from_node: &Matrix4<f64>,
        count: usize,
    ) -> Result<(), ModelError> {
        let Some(&index) = primitive.attributes.get("NORMAL") else {
            self.all_normals = false;
            return Ok(());
        };
        let normals = self.attribute(index, 3, count)?;
        let linear: Matrix3<f64> = scene_from_node.fixed_view::<3, 3>(0, 0).into();
        let turn = linear.try_inverse().map_or_else(Matrix3::zeros, |inverse| inverse.transpose());
        for i in 0..count {
            let normal = z_up(&(turn * Vector3::from(normals.triple(i)))).map(|v| v as f32);
            self.mesh.vertices.normals.push(normal.into());
        }
        Ok(())
    }

    /// What the writer says of each vertex's standard deviation; negative where it was invented.
    fn add_deviations(&mut self, primitive: &Primitive, count: usize) -> Result<(), ModelError> {
        let Some(&index) = primitive.attributes.get("_DEVIATION") else {
            self.all_deviations = false;
            return Ok(());
        };
        let deviations = self.attribute(index, 1, count)?;
        for i in 0..count {
            let deviation = deviations.get(i, 0) as f32;
            self.all_deviations &= !deviation.is_nan();
            self.mesh.deviations_metres.push(if deviation < 0.0 { INVENTED } else { deviation });
        }
        Ok(())
    }

    /// Vertex colour or texture, times the material's own colour, all in linear light.
    fn add_colors(&mut self, primitive: &Primitive, count: usize) -> Result<(), ModelError> {
        let vertex = match primitive.attributes.get("COLOR_0") {
            Some(&index) => Some(self.attribute(index, 3, count)?),
            None => None,
        };
        let surface = match primitive.material {
            Some(index) => Some(&item(&self.document.materials, index, "material")?.pbr_metallic_roughness),
            None => None,
        };
        let texture = match surface.and_then(|surface| surface.base_color_texture.as_ref()) {
            Some(used) => self.texture(primitive, used, count)?,
            None => None,
        };
        let factor = surface.and_then(|surface| surface.base_color_factor);
        self.colored |= vertex.is_some() || texture.is_some() || factor.is_some();
        let plain = if vertex.is_none() && texture.is_none() && factor.is_none() { GRAY } else { [1.0; 3] };
        for i in 0..count {
            let mut light = plain;
            if let Some(vertex) = &vertex {
                light = std::array::from_fn(|k| light[k] * vertex.get(i, k));
            }
            if let Some((coordinates, image)) = &texture {
                let texel = self.texel(*image, coordinates.get(i, 0), coordinates.get(i, 1));
                light = std::array::from_fn(|k| light[k] * texel[k]);
            }
            if let Some(factor) = &factor {
                light = std::array::from_fn(|k| light[k] * factor[k]);
            }
            self.mesh.vertices.colors.push(light.map(color::srgb));
        }
        Ok(())
    }

    /// Texture coordinates and the image number of a base colour texture that can be decoded.
    fn texture(
        &mut self,
        primitive: &Primitive,
        used: &TextureUse,
        count: usize,
    ) -> Result<Option<(Values<'a>, usize)>, ModelError> {
        let Some(&coordinates) = primitive.attributes.get(&format!("TEXCOORD_{}", used.tex_coord)) else {
            return Ok(None);
        };
        let coordinates = self.attribute(coordinates, 2, count)?;
        let Some(image) = item(&self.document.textures, used.index, "texture")?.source else {
            return Ok(None);
        };
        let entry = item(&self.document.images, image, "image")?;
        if !self.pictures.contains_key(&image) {
            let picture = match entry.buffer_view {
                Some(view) => (self.decode)(view_bytes(self.document, self.binary, view)?.1),
                None => None,
            };
            let picture = picture.filter(|p| p.width * p.height == p.data.len() && !p.data.is_empty());
            self.pictures.insert(image, picture);
        }
        let usable = matches!(self.pictures.get(&image), Some(Some(_)));
        Ok(usable.then_some((coordinates, image)))
    }

    /// The nearest pixel in linear light; coordinates repeat, (0, 0) is the top left corner.
    fn texel(&self, image: usize, u: f64, v: f64) -> [f64; 3] {
        let Some(Some(picture)) = self.pictures.get(&image) else { return [1.0; 3] };
        let place = |t: f64, side: usize| ((t.rem_euclid(1.0) * side as f64) as usize).min(side - 1);
        let (x, y) = (place(u, picture.width), place(v, picture.height));
        picture.data[y * picture.width + x].map(color::linear)
    }

    fn add_triangles(
        &mut self,
        primitive: &Primitive,
        first: usize,
        count: usize,
        flipped: bool,
    ) -> Result<(), ModelError> {
        let indices = match primitive.indices {
            Some(index) => Some(Values::open(self.document, self.binary, index)?.of_indices()?),
            None => None,
        };
        let length = indices.map_or(count, |indices| indices.count);
        let corner = |i: usize| -> Result<u32, ModelError> {
            let index = indices.map_or(i as u32, |indices| indices.index(i));
            if index as usize >= count {
                return Err(ModelError::BadIndex { index: u64::from(index), vertices: count });
            }
            Ok(first as u32 + index)
        };
        let triangles = if primitive.mode == TRIANGLES { length / 3 } else { length.saturating_sub(2) };
        let total = self.mesh.triangles.len() as u64 + triangles as u64;
        ModelError::refuse_more("triangles", total, self.limits.max_triangles)?;
        for t in 0..triangles {
            let [a, mut b, mut c] = match primitive.mode {
                TRIANGLES => [3 * t, 3 * t + 1, 3 * t + 2],
                TRIANGLE_STRIP => [t, t + 1 + t % 2, t + 2 - t % 2],
                _ => [0, t + 1, t + 2],
            };
            if flipped {
                std::mem::swap(&mut b, &mut c);
            }
            self.mesh.triangles.push([corner(a)?, corner(b)?, corner(c)?]);
        }
        Ok(())
    }
}
