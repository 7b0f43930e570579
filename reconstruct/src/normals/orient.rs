//! Turning normals to one side of the surface (Hoppe et al. 1992, §3.3): along a minimum spanning tree of the graph of
//! neighbours, whose edges cost `1 - |n_i · n_j|`, so that signs go where the surface is flat before they go round an edge.
//!
//! Any frame. Every connected part is turned so that its highest point (largest z) faces up, or where that one looks
//! sideways, so that most of it faces away from its middle.

use nalgebra::Vector3;

use crate::knn::Tree;
use crate::radix::sort_by_bits;

/// Costs are told apart to this many bits.
const COST_BITS: u32 = 24;
/// A highest point whose normal rises by less says nothing.
const LEAST_RISE: f32 = 0.2;

/// Turns the normals of points one by one so that those of a part agree; `neighbours` of each are looked at. `tree` is that of the
/// same points. Normals of length 0 stay so.
pub fn orient(points: &[[f32; 3]], tree: &Tree, normals: &mut [[f32; 3]], neighbours: usize) {
    let edges = edges(points, tree, normals, neighbours);
    let kept = spanning(points.len().min(normals.len()), &edges);
    let forest = Forest::new(normals.len(), &kept);
    let mut seen = vec![false; normals.len()];
    for root in 0..normals.len() {
        if !seen[root] && length2(&normals[root]) > 0.0 && points[root].iter().all(|v| v.is_finite()) {
            let part = turn_along(&forest, root, normals, &mut seen);
            if faces_in(points, normals, &part) {
                for i in part {
                    flip(&mut normals[i as usize]);
                }
            }
        }
    }
}

fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length2(a: &[f32; 3]) -> f32 {
    dot(a, a)
}

fn flip(normal: &mut [f32; 3]) {
    *normal = normal.map(|v| -v);
}

/// Pairs of neighbours, the cheapest first; of equal cost in the order of the points.
fn edges(points: &[[f32; 3]], tree: &Tree, normals: &[[f32; 3]], neighbours: usize) -> Vec<[u32; 2]> {
    let count = (neighbours + 1).min(tree.len());
    if count == 0 {
        return Vec::new();
    }
    let rows = tree.nearest_n_each(points, count);
    let row = |i: usize| rows[i * count..(i + 1) * count].iter().map(|n| n.index);
    let mut pairs = Vec::with_capacity(points.len() * neighbours);
    let mut keys = Vec::with_capacity(points.len() * neighbours);
    for i in 0..points.len().min(normals.len()) {
        for j in row(i).filter(|&j| j < normals.len()) {
            // a pair that both name is taken once
            if j == i || (j < i && row(j).any(|k| k == i)) {
                continue;
            }
            let (a, b) = (&normals[i], &normals[j]);
            if length2(a) > 0.0 && length2(b) > 0.0 {
                let cost = (1.0 - dot(a, b).abs()).clamp(0.0, 1.0);
                let cost = (cost * ((1 << COST_BITS) - 1) as f32) as u64;
                keys.push((cost << 32) | pairs.len() as u64);
                pairs.push([i as u32, j as u32]);
            }
        }
    }
    sort_by_bits(&mut keys, 32, COST_BITS);
    keys.iter().map(|&key| pairs[key as u32 as usize]).collect()
}

/// The edges that join two trees (Kruskal 1956).
fn spanning(points: usize, edges: &[[u32; 2]]) -> Vec<[u32; 2]> {
    let mut parent: Vec<u32> = (0..points as u32).collect();
    let mut kept = Vec::with_capacity(points);
    for &[a, b] in edges {
        let (x, y) = (root(&mut parent, a), root(&mut parent, b));
        if x != y {
            parent[x.max(y) as usize] = x.min(y);
            kept.push([a, b]);
        }
    }
    kept
}

fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        parent[v as usize] = parent[parent[v as usize] as usize];
        v = parent[v as usize];
    }
    v
}

/// Neighbours in the trees.
struct Forest {
    ends: Vec<u32>,
    beside: Vec<u32>,
}

impl Forest {
    fn new(points: usize, edges: &[[u32; 2]]) -> Self {
        let mut ends = vec![0u32; points];
        edges.iter().flatten().for_each(|&v| ends[v as usize] += 1);
        let mut before = 0;
        for end in &mut ends {
            before += std::mem::replace(end, before);
        }
        let mut beside = vec![0; 2 * edges.len()];
        for &[a, b] in edges {
            for (from, to) in [(a, b), (b, a)] {
                beside[ends[from as usize] as usize] = to;
                ends[from as usize] += 1;
            }
        }
        Self { ends, beside }
    }

    fn of(&self, point: usize) -> &[u32] {
        let first = if point == 0 { 0 } else { self.ends[point - 1] };
        &self.beside[first as usize..self.ends[point] as usize]
    }
}

/// Gives the signs from point to point; returns the part.
fn turn_along(forest: &Forest, root: usize, normals: &mut [[f32; 3]], seen: &mut [bool]) -> Vec<u32> {
    seen[root] = true;
    let mut part = vec![root as u32];
    let mut at = 0;
    while at < part.len() {
        let here = part[at] as usize;
        for &next in forest.of(here) {
            if !std::mem::replace(&mut seen[next as usize], true) {
                if dot(&normals[here], &normals[next as usize]) < 0.0 {
                    flip(&mut normals[next as usize]);
                }
                part.push(next);
            }
        }
        at += 1;
    }
    part
}

fn faces_in(points: &[[f32; 3]], normals: &[[f32; 3]], part: &[u32]) -> bool {
    let height = |i: u32| points[i as usize][2];
    let highest = part.iter().copied().max_by(|&a, &b| height(a).total_cmp(&height(b)).then(b.cmp(&a)));
    let Some(highest) = highest else { return false };
    let rise = normals[highest as usize][2];
    if rise.abs() >= LEAST_RISE {
        return rise < 0.0;
    }
    let place = |i: &u32| Vector3::from(points[*i as usize]).cast::<f64>();
    let middle = part.iter().map(place).sum::<Vector3<f64>>() / part.len() as f64;
    let away = |i: &u32| (place(i) - middle).dot(&Vector3::from(normals[*i as usize]).cast::<f64>());
    part.iter().map(away).sum::<f64>() < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns normals at random, orients them, and wants the true ones back.
    #[track_caller]
    fn check_recovered(points: &[[f32; 3]], truth: &[[f32; 3]]) {
        let mut rng = fastrand::Rng::with_seed(2);
        let mut normals = truth.to_vec();
        normals.iter_mut().filter(|_| rng.bool()).for_each(flip);
        orient(points, &Tree::new(points), &mut normals, 12);
        let wrong = normals.iter().zip(truth).filter(|(a, b)| a != b).count();
        assert_eq!(wrong, 0, "of {}", truth.len());
    }

    fn sampled(
        count: usize,
        of: impl Fn(f32, f32) -> ([f32; 3], [f32; 3]),
    ) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let mut rng = fastrand::Rng::with_seed(1);
        (0..count).map(|_| of(rng.f32(), rng.f32())).unzip()
    }

    #[test]
    fn a_sphere_and_a_torus() {
        let (points, normals) = sampled(4000, |u, v| {
            let (s, c) = (u * std::f32::consts::TAU).sin_cos();
            let z = 2.0 * v - 1.0;
            let flat = (1.0 - z * z).sqrt();
            let n = [flat * c, flat * s, z];
            (n.map(|v| 0.05 * v), n)
        });
        check_recovered(&points, &normals);
        let (points, normals) = sampled(6000, |u, v| {
            let (s, c) = (u * std::f32::consts::TAU).sin_cos();
            let (t, d) = (v * std::f32::consts::TAU).sin_cos();
            ([c * (0.05 + 0.02 * d), s * (0.05 + 0.02 * d), 0.02 * t], [c * d, s * d, t])
        });
        check_recovered(&points, &normals);
    }

    #[test]
    fn a_box_and_a_second_part() {
        let mut points = Vec::new();
        let mut normals = Vec::new();
        for (side, shift) in [(0.06, 0.0), (0.03, 0.5)] {
            for face in 0..6 {
                let (sign, axis) = (if face % 2 == 0 { 1.0 } else { -1.0 }, face / 2);
                for i in 0..900 {
                    let (u, v) = ((i % 30) as f32 / 29.0 - 0.5, (i / 30) as f32 / 29.0 - 0.5);
                    let mut p = [side * u * 0.98; 3];
                    p[axis] = 0.5 * side * sign;
                    p[(axis + 1) % 3] = side * v * 0.98;
                    let mut n = [0.0; 3];
                    n[axis] = sign;
                    p[0] += shift;
                    points.push(p);
                    normals.push(n);
                }
            }
        }
        // estimated normals are round at the edges; these turn by a right angle at once
        let near_edge = |p: &[f32; 3], n: &[f32; 3], side: f32, shift: f32| -> [f32; 3] {
            let mut sum = *n;
            for k in 0..3 {
                let off = (p[k] - if k == 0 { shift } else { 0.0 }) / (0.5 * side);
                if off.abs() > 0.9 && n[k] == 0.0 {
                    sum[k] += 0.7 * off.signum();
                }
            }
            let length = length2(&sum).sqrt();
            sum.map(|v| v / length)
        };
        for i in 0..points.len() {
            let (side, shift) = if i < 5400 { (0.06, 0.0) } else { (0.03, 0.5) };
            normals[i] = near_edge(&points[i], &normals[i], side, shift);
        }
        check_recovered(&points, &normals);
    }

    #[test]
    fn a_standing_plate_and_nothing() {
        let (points, normals) = sampled(1500, |u, v| ([0.0, 0.1 * u, 0.1 * v], [1.0, 0.0, 0.0]));
        let mut turned = normals.clone();
        turned.iter_mut().step_by(2).for_each(flip);
        orient(&points, &Tree::new(&points), &mut turned, 12);
        assert!(turned.iter().all(|n| n == &turned[0]));
        orient(&[], &Tree::new(&[]), &mut [], 12);
        let points = [[f32::NAN; 3], [0.0; 3], [1.0, 0.0, 0.0]];
        let mut normals = [[0.0, 0.0, 1.0], [0.0; 3], [0.0, 0.0, -1.0]];
        orient(&points, &Tree::new(&points), &mut normals, 12);
        assert_eq!(normals, [[0.0, 0.0, 1.0], [0.0; 3], [0.0, 0.0, 1.0]]);
    }
}
