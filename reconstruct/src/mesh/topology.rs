//! How triangles hang together: borders, pieces, and vertices in which only a point is shared.
//!
//! An edge belongs to one triangle (border) or two; a surface is manifold where moreover the triangles round every
//! vertex form one fan.

use rayon::prelude::*;

use super::Mesh;

/// A border of the surface: vertices in the order in which its triangles run along it, first not repeated.
pub type Loop = Vec<u32>;

/// What is wrong with a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Defects {
    /// Directed edges that more than one triangle has.
    pub crowded_edges: usize,
    /// Vertices with more than one fan.
    pub split_vertices: usize,
    /// Triangles that name a vertex twice or have no area.
    pub degenerate: usize,
}

/// With more vertex numbers a triangle than this, most are not used.
const SPARSE_VERTICES: usize = 16;

/// Directed edges of all triangles with the triangle's index, sorted.
fn directed_edges(triangles: &[[u32; 3]]) -> Vec<(u32, u32, u32)> {
    let mut edges: Vec<(u32, u32, u32)> = triangles
        .iter()
        .enumerate()
        .flat_map(|(t, &[a, b, c])| [(a, b), (b, c), (c, a)].map(|(from, to)| (from, to, t as u32)))
        .collect();
    edges.par_sort_unstable();
    edges
}

fn has_edge(edges: &[(u32, u32, u32)], from: u32, to: u32) -> bool {
    let at = edges.partition_point(|e| (e.0, e.1) < (from, to));
    edges.get(at).is_some_and(|e| (e.0, e.1) == (from, to))
}

/// Directed edges without a counterpart, sorted by their start.
fn border_edges(triangles: &[[u32; 3]]) -> Vec<(u32, u32)> {
    let vertices = triangles.iter().flatten().max().map_or(0, |&v| v as usize + 1);
    // Counting is for numbers that follow one another.
    if vertices > SPARSE_VERTICES * triangles.len() {
        return border_edges_by_sorting(triangles);
    }
    let edges = || triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
    let mut first = vec![0u32; vertices + 1];
    edges().for_each(|(from, _)| first[from as usize + 1] += 1);
    for v in 0..vertices {
        first[v + 1] += first[v];
    }
    let (mut next, mut ends) = (first.clone(), vec![0u32; 3 * triangles.len()]);
    for (from, to) in edges() {
        ends[next[from as usize] as usize] = to;
        next[from as usize] += 1;
    }
    let ends_of = |v: u32| &ends[first[v as usize] as usize..first[v as usize + 1] as usize];
    let starts_of_borders = |from: u32| {
        let mut out: Vec<(u32, u32)> =
            ends_of(from).iter().filter(|&&to| !ends_of(to).contains(&from)).map(|&to| (from, to)).collect();
        out.sort_unstable();
        out
    };
    (0..vertices as u32).into_par_iter().flat_map_iter(starts_of_borders).collect()
}

/// The same, whatever the vertices' numbers are.
fn border_edges_by_sorting(triangles: &[[u32; 3]]) -> Vec<(u32, u32)> {
    let edges = directed_edges(triangles);
    edges.par_iter().filter(|e| !has_edge(&edges, e.1, e.0)).map(|e| (e.0, e.1)).collect()
}

/// The borders of a manifold surface, each as a loop; in the order of their lowest vertices.
pub fn borders(triangles: &[[u32; 3]]) -> Vec<Loop> {
    let border = border_edges(triangles);
    let next = |v: u32| border.binary_search_by_key(&v, |e| e.0).ok();
    let mut done = vec![false; border.len()];
    let mut loops = Vec::new();
    for start in 0..border.len() {
        let mut walked = Vec::new();
        let mut at = Some(start);
        while let Some(i) = at
            && !done[i]
        {
            done[i] = true;
            walked.push(border[i].0);
            at = next(border[i].1);
        }
        if at == Some(start) && walked.len() >= 3 {
            loops.push(walked);
        }
    }
    loops
}

/// Share of the way into its fan by which a parted vertex moves: vertices in one place would make triangles without area.
const PARTED: f32 = 0.02;

/// Gives every fan round a vertex a vertex of its own, so that borders touch nowhere.
pub fn split_touching_vertices(mesh: &mut Mesh) {
    let border = border_edges(&mesh.triangles);
    let touching: Vec<u32> =
        border.chunk_by(|a, b| a.0 == b.0).filter(|run| run.len() > 1).map(|run| run[0].0).collect();
    if touching.is_empty() {
        return;
    }
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); touching.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for v in triangle {
            if let Ok(i) = touching.binary_search(v) {
                around[i].push(t as u32);
            }
        }
    }
    let mut moved = Vec::new();
    for (&vertex, triangles) in touching.iter().zip(&around) {
        for (i, fan) in fans(&mesh.triangles, vertex, triangles).iter().enumerate() {
            let own = if i == 0 { vertex } else { duplicate(mesh, vertex as usize) };
            for &t in fan {
                mesh.triangles[t as usize].iter_mut().filter(|v| **v == vertex).for_each(|v| *v = own);
            }
            moved.push((own, place_in(mesh, own, fan)));
        }
    }
    for (vertex, place) in moved {
        mesh.vertices.points[vertex as usize] = place;
    }
}

/// Place a little from a vertex towards the middle of its fan.
fn place_in(mesh: &Mesh, vertex: u32, fan: &[u32]) -> [f32; 3] {
    let corners = || fan.iter().flat_map(|&t| mesh.triangles[t as usize]).filter(|&v| v != vertex);
    let count = corners().count().max(1) as f32;
    let at = mesh.vertices.points[vertex as usize];
    std::array::from_fn(|k| {
        let middle = corners().map(|v| mesh.vertices.points[v as usize][k]).sum::<f32>() / count;
        at[k] + PARTED * (middle - at[k])
    })
}

/// Triangles round a vertex, grouped so that those of a group share edges at it.
fn fans(all: &[[u32; 3]], vertex: u32, around: &[u32]) -> Vec<Vec<u32>> {
    let others = |t: u32| all[t as usize].into_iter().filter(move |&v| v != vertex);
    let mut open: Vec<u32> = around.to_vec();
    let mut fans = Vec::new();
    while let Some(first) = open.first().copied() {
        let mut fan = vec![first];
        open.remove(0);
        let mut looked = 0;
        while looked < fan.len() {
            let here: Vec<u32> = others(fan[looked]).collect();
            let (joined, rest): (Vec<u32>, Vec<u32>) =
                open.iter().partition(|&&t| others(t).any(|v| here.contains(&v)));
            fan.extend(joined);
            open = rest;
            looked += 1;
        }
        fans.push(fan);
    }
    fans
}

fn duplicate(mesh: &mut Mesh, vertex: usize) -> u32 {
    let copy = mesh.vertices.len() as u32;
    let v = &mut mesh.vertices;
    v.points.push(v.points[vertex]);
    if let Some(&color) = v.colors.get(vertex) {
        v.colors.push(color);
    }
    if let Some(&normal) = v.normals.get(vertex) {
        v.normals.push(normal);
    }
    if let Some(&deviation) = mesh.deviations_metres.get(vertex) {
        mesh.deviations_metres.push(deviation);
    }
    copy
}

/// Without the pieces whose area is less than `least` says, of the areas of all pieces (square metres).
pub(crate) fn without_small_pieces(mesh: &Mesh, least: impl Fn(&[f64]) -> f64) -> Mesh {
    let (piece, count) = pieces(mesh.vertices.len(), &mesh.triangles);
    let mut areas = vec![0.0f64; count];
    mesh.areas().iter().zip(&piece).for_each(|(area, &p)| areas[p as usize] += area);
    let least = least(&areas);
    let mut keep = vec![false; mesh.vertices.len()];
    for (t, &p) in mesh.triangles.iter().zip(&piece) {
        if areas[p as usize] >= least {
            for &v in t {
                keep[v as usize] = true;
            }
        }
    }
    mesh.select(&keep)
}

/// Number of the connected piece each triangle belongs to, and how many pieces there are.
pub fn pieces(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    for &[a, b, c] in triangles {
        for v in [b, c] {
            let (x, y) = (root(&mut parent, a), root(&mut parent, v));
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    let mut number = vec![u32::MAX; vertices];
    let mut count = 0u32;
    let of_triangle = triangles
        .iter()
        .map(|t| {
            let r = root(&mut parent, t[0]) as usize;
            if number[r] == u32::MAX {
                number[r] = count;
                count += 1;
            }
            number[r]
        })
        .collect();
    (of_triangle, count as usize)
}

fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        parent[v as usize] = parent[parent[v as usize] as usize];
        v = parent[v as usize];
    }
    v
}

/// Counts what is wrong with a surface.
pub fn defects(mesh: &Mesh) -> Defects {
    let edges = directed_edges(&mesh.triangles);
    let crowded_edges = edges.windows(2).filter(|w| (w[0].0, w[0].1) == (w[1].0, w[1].1)).count();
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); mesh.vertices.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for &v in triangle {
            around[v as usize].push(t as u32);
        }
    }
    let split_vertices = around
        .par_iter()
        .enumerate()
        .filter(|(v, triangles)| fans(&mesh.triangles, *v as u32, triangles).len() > 1)
        .count();
    let degenerate = mesh
        .triangles
        .iter()
        .filter(|&&[a, b, c]| a == b || b == c || c == a || mesh.area(&[a, b, c]) <= 0.0)
        .count();
    Defects { crowded_edges, split_vertices, degenerate }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::PointCloud;

    fn mesh(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
        Mesh {
            vertices: PointCloud { points: points.to_vec(), ..PointCloud::default() },
            triangles: triangles.to_vec(),
            ..Mesh::default()
        }
    }

    #[test]
    fn a_square_has_one_border() {
        let m = mesh(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
        assert_eq!(borders(&m.triangles), [vec![0, 1, 2, 3]]);
        assert_eq!(defects(&m), Defects::default());
        assert_eq!(pieces(4, &m.triangles), (vec![0, 0], 1));
    }

    #[test]
    fn triangles_that_share_a_point_are_parted() {
        let mut m = mesh(
            &[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, -1.0, 0.0]],
            &[[0, 1, 2], [0, 3, 4]],
        );
        assert_eq!(defects(&m).split_vertices, 1);
        split_touching_vertices(&mut m);
        assert_eq!(m.vertices.len(), 6);
        assert_eq!(defects(&m), Defects::default());
        assert_eq!(borders(&m.triangles).len(), 2);
    }

    #[test]
    fn faults_are_counted() {
        let m = mesh(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], &[[0, 1, 2], [0, 1, 2], [0, 0, 1]]);
        let found = defects(&m);
        assert_eq!((found.crowded_edges, found.degenerate), (4, 1));
    }

    #[test]
    fn what_is_selected_keeps_its_triangles() {
        let m = mesh(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
        let left = m.select(&[true, false, true, true]);
        assert_eq!((left.vertices.len(), left.triangles), (3, vec![[0, 1, 2]]));
    }

    #[test]
    fn counting_and_sorting_find_the_same_borders() {
        let mut rng = fastrand::Rng::with_seed(4);
        for (vertices, triangles) in [(0, 0), (3, 1), (20, 30), (400, 90), (4_000_000, 50)] {
            let all: Vec<[u32; 3]> =
                (0..triangles).map(|_| std::array::from_fn(|_| rng.u32(0..vertices))).collect();
            assert_eq!(border_edges(&all), border_edges_by_sorting(&all), "{vertices} {triangles}");
        }
    }
}
