//! Invented surface: rings of new vertices that shrink into a hole's middle, smoothed like a skin.
//!
//! Only new vertices get new edges between them, so a manifold surface stays manifold.

use crate::mesh::{INVENTED, Mesh};

/// Fewer vertices than this are joined to one in the middle.
const FAN: usize = 6;
/// Rounds of smoothing.
const SMOOTHING: usize = 30;

/// Closes a border with invented surface.
pub(super) fn fill(mesh: &mut Mesh, border: &[u32]) {
    let first_new = mesh.vertices.len() as u32;
    let first_triangle = mesh.triangles.len();
    let middle = mean(mesh, border);
    let rings = ring_count(border.len());
    let mut outer = border.to_vec();
    for ring in 1..=rings {
        let share = ring as f32 / (rings + 1) as f32;
        let inner: Vec<u32> = (0..outer.len().div_ceil(2))
            .map(|i| {
                let at = border[(i * border.len()) / outer.len().div_ceil(2)] as usize;
                add_between(mesh, at, &middle, share)
            })
            .collect();
        join(mesh, &outer, &inner);
        outer = inner;
    }
    let tip = add_between(mesh, border[0] as usize, &middle, 1.0);
    for i in 0..outer.len() {
        // the border runs as its own triangles see it, so the new ones take it backwards
        mesh.triangles.push([outer[(i + 1) % outer.len()], outer[i], tip]);
    }
    smooth(mesh, first_new, first_triangle);
}

fn ring_count(border: usize) -> usize {
    let mut count = 0;
    let mut left = border;
    while left > FAN {
        left = left.div_ceil(2);
        count += 1;
    }
    count
}

/// A ring of n and one of half as many become triangles.
fn join(mesh: &mut Mesh, outer: &[u32], inner: &[u32]) {
    let (n, m) = (outer.len(), inner.len());
    for (i, &b) in inner.iter().enumerate() {
        let (a0, a1) = (outer[2 * i], outer[(2 * i + 1) % n]);
        let next = inner[(i + 1) % m];
        mesh.triangles.push([a1, a0, b]);
        if 2 * i + 1 < n {
            mesh.triangles.push([outer[(2 * i + 2) % n], a1, next]);
        }
        mesh.triangles.push([a1, b, next]);
    }
}

/// A new vertex on the way from a vertex to a point.
pub(super) fn add_between(mesh: &mut Mesh, from: usize, to: &[f32; 3], share: f32) -> u32 {
    let index = mesh.vertices.len() as u32;
    let v = &mut mesh.vertices;
    let p = v.points[from];
    v.points.push(std::array::from_fn(|k| p[k] + share * (to[k] - p[k])));
    v.colors.push(v.colors[from]);
    v.normals.push(v.normals[from]);
    mesh.deviations_metres.push(INVENTED);
    index
}

/// Mean of vertices.
pub(super) fn mean(mesh: &Mesh, of: &[u32]) -> [f32; 3] {
    let mut sum = [0.0f64; 3];
    for &v in of {
        (0..3).for_each(|k| sum[k] += f64::from(mesh.vertices.points[v as usize][k]));
    }
    sum.map(|v| (v / of.len().max(1) as f64) as f32)
}

/// Moves every new vertex to the middle of its neighbours, again and again; colours blend the same way.
fn smooth(mesh: &mut Mesh, first_new: u32, first_triangle: usize) {
    let new = mesh.vertices.len() - first_new as usize;
    let mut near: Vec<Vec<u32>> = vec![Vec::new(); new];
    for t in &mesh.triangles[first_triangle..] {
        for k in 0..3 {
            for other in [t[(k + 1) % 3], t[(k + 2) % 3]] {
                if t[k] >= first_new && !near[(t[k] - first_new) as usize].contains(&other) {
                    near[(t[k] - first_new) as usize].push(other);
                }
            }
        }
    }
    for _ in 0..SMOOTHING {
        for (i, near) in near.iter().enumerate() {
            let at = first_new as usize + i;
            let n = near.len().max(1) as f32;
            let sum = |value: &dyn Fn(usize) -> [f32; 3]| {
                near.iter().fold([0.0f32; 3], |s, &v| {
                    let p = value(v as usize);
                    std::array::from_fn(|k| s[k] + p[k] / n)
                })
            };
            let point = sum(&|v| mesh.vertices.points[v]);
            let color = sum(&|v| mesh.vertices.colors[v].map(f32::from));
            mesh.vertices.points[at] = point;
            mesh.vertices.colors[at] = color.map(|c| c.round().clamp(0.0, 255.0) as u8);
        }
    }
}
