//! Triangles by edge functions and a depth buffer.

use nalgebra::Vector3;

use super::camera::Camera;
use super::canvas::{Band, Canvas};
use super::{Dot, tone};

/// Draws all triangles; vertices without normals take the face's.
pub(super) fn draw(dots: &[Dot], triangles: &[[u32; 3]], camera: &Camera, canvas: &mut Canvas) {
    let corners = |i: usize| -> Option<([&Dot; 3], [[f32; 2]; 3])> {
        let [a, b, c] = triangles[i].map(|v| dots.get(v as usize));
        let corners = [a?, b?, c?];
        let [a, b, c] = corners.map(|dot| camera.project(dot.place));
        Some((corners, [a?, b?, c?]))
    };
    let rows = |i: usize| {
        let (_, at) = corners(i)?;
        Some((at[0][1].min(at[1][1]).min(at[2][1]), at[0][1].max(at[1][1]).max(at[2][1])))
    };
    let lists = canvas.sort_into_bands(triangles.len(), rows);
    canvas.draw_bands(&lists, |band, list| {
        for (dots, at) in list.iter().filter_map(|&i| corners(i as usize)) {
            fill(band, dots, at);
        }
    });
}

fn edge(a: [f32; 2], b: [f32; 2], p: [f32; 2]) -> f32 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

fn fill(band: &mut Band<'_>, dots: [&Dot; 3], at: [[f32; 2]; 3]) {
    let area = edge(at[0], at[1], at[2]);
    if area.abs() < 1e-9 {
        return;
    }
    let light = dots.map(|dot| dot.light);
    let face = if dots[0].normal == [0.0; 3] { tone::shade(face_normal(dots), true) } else { 1.0 };
    let low = std::array::from_fn(|k| at[0][k].min(at[1][k]).min(at[2][k]));
    let high = std::array::from_fn(|k| at[0][k].max(at[1][k]).max(at[2][k]));
    let (columns, rows) = band.clip(low, high);
    for y in rows {
        for x in columns.clone() {
            let p = [x as f32, y as f32];
            let w = [edge(at[1], at[2], p), edge(at[2], at[0], p), edge(at[0], at[1], p)].map(|w| w / area);
            if w.iter().any(|&w| w < 0.0) {
                continue;
            }
            let inverse: f32 = (0..3).map(|k| w[k] / dots[k].place[2]).sum();
            let (depth, i) = (1.0 / inverse, band.at(x, y));
            if depth < band.depth[i] {
                band.depth[i] = depth;
                let mixed = |c: usize| (0..3).map(|k| w[k] * light[k][c]).sum::<f32>() * face;
                band.light[i] = [mixed(0), mixed(1), mixed(2), 1.0];
            }
        }
    }
}

fn face_normal(dots: [&Dot; 3]) -> [f32; 3] {
    let [a, b, c] = dots.map(|dot| Vector3::from(dot.place));
    (b - a).cross(&(c - a)).try_normalize(0.0).map_or([0.0; 3], Into::into)
}
