//! Hypotheses from matches that agree with one another.

use nalgebra::Vector3;

use super::super::ransac::Match;
use super::super::svd::rigid_transform;
use super::{PairwiseConfig, Seen};
use crate::pose::Pose;

/// Matches looked at, evenly drawn from more: all pairs of them are compared.
const MOST: usize = 1200;
/// Largest difference of the length between two matches, and their least distance, in cells.
const LENGTH: f32 = 1.2;
const APART: f32 = 4.0;
/// Largest difference of a cosine between normals, or of a normal and the line.
const COSINE: f32 = 0.25;
/// Cells along the normal where each match lends a second point.
const LEVER: f32 = 4.0;
/// Edges tried for each hypothesis wanted.
const TRIES: usize = 8;
/// Turned or moved by less (radians, cells), a hypothesis is not new.
const SAME: (f64, f64) = (0.14, 3.0);

struct Oriented {
    p: Vector3<f32>,
    q: Vector3<f32>,
    n: Vector3<f32>,
    m: Vector3<f32>,
}

/// Poses that several matches agree on, strongest first.
pub(super) fn hypotheses(
    source: &Seen<'_>,
    target: &Seen<'_>,
    matches: &[Match],
    config: &PairwiseConfig,
) -> Vec<Pose> {
    let step = matches.len().div_ceil(MOST).max(1);
    let places: Vec<Oriented> = matches
        .iter()
        .step_by(step)
        .filter_map(|[s, t]| {
            Some(Oriented {
                p: Vector3::from(*source.points.get(*s)?),
                q: Vector3::from(*target.points.get(*t)?),
                n: Vector3::from(*source.normals.get(*s)?),
                m: Vector3::from(*target.normals.get(*t)?),
            })
        })
        .filter(|o| o.p.norm_squared().is_finite() && o.q.norm_squared().is_finite())
        .collect();
    let graph = Graph::new(&places, config.cell);
    let edges = graph.ranked_edges();
    let middle = places.iter().map(|o| o.p).sum::<Vector3<f32>>() / places.len().max(1) as f32;
    let middle = nalgebra::Point3::from(middle.map(f64::from));
    let mut found: Vec<Pose> = Vec::new();
    for (_, i, j) in edges.into_iter().take(config.hypotheses * TRIES) {
        let Some(pose) = solve(&places, &graph.common(i, j), i, j, config.cell) else { continue };
        let new = found.iter().all(|other| {
            pose.rotation.angle_to(&other.rotation) > SAME.0
                || (pose * middle - other * middle).norm() > SAME.1 * f64::from(config.cell)
        });
        if new {
            found.push(pose);
            if found.len() == config.hypotheses {
                break;
            }
        }
    }
    found
}

/// Least squares over two matches and those that agree with both, with their normals.
fn solve(places: &[Oriented], common: &[usize], i: usize, j: usize, cell: f32) -> Option<Pose> {
    let lever = LEVER * cell;
    let members: Vec<([f32; 3], [f32; 3], f64)> = [i, j]
        .iter()
        .chain(common.iter().take(40))
        .flat_map(|k| {
            let o = &places[*k];
            [(o.p.into(), o.q.into(), 1.0), ((o.p + o.n * lever).into(), (o.q + o.m * lever).into(), 0.5)]
        })
        .collect();
    rigid_transform(members.iter().copied())
}

/// Which matches agree, a row of bits for each.
struct Graph {
    words: usize,
    rows: Vec<u64>,
    count: usize,
}

impl Graph {
    fn new(places: &[Oriented], cell: f32) -> Self {
        let (count, words) = (places.len(), places.len().div_ceil(64));
        let mut graph = Self { words, rows: vec![0; count * words], count };
        for i in 0..count {
            for j in i + 1..count {
                if agree(&places[i], &places[j], cell) {
                    graph.rows[i * words + j / 64] |= 1 << (j % 64);
                    graph.rows[j * words + i / 64] |= 1 << (i % 64);
                }
            }
        }
        graph
    }

    fn row(&self, i: usize) -> &[u64] {
        &self.rows[i * self.words..(i + 1) * self.words]
    }

    /// Edges by how many matches agree with both ends, most first.
    fn ranked_edges(&self) -> Vec<(u32, usize, usize)> {
        let mut edges = Vec::new();
        for i in 0..self.count {
            let row = self.row(i);
            for j in ones(row).filter(|j| *j > i) {
                let both = row.iter().zip(self.row(j)).map(|(a, b)| (a & b).count_ones()).sum::<u32>();
                edges.push((both, i, j));
            }
        }
        edges.sort_unstable_by(|a, b| b.0.cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        edges
    }

    fn common(&self, i: usize, j: usize) -> Vec<usize> {
        let both: Vec<u64> = self.row(i).iter().zip(self.row(j)).map(|(a, b)| a & b).collect();
        ones(&both).collect()
    }
}

fn ones(row: &[u64]) -> impl Iterator<Item = usize> + '_ {
    row.iter().enumerate().flat_map(|(k, word)| {
        let mut rest = *word;
        std::iter::from_fn(move || {
            (rest != 0).then(|| {
                let bit = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                k * 64 + bit
            })
        })
    })
}

/// Whether two matches can come from one motion: same distance, same angles.
#[inline]
fn agree(a: &Oriented, b: &Oriented, cell: f32) -> bool {
    let (u, v) = (b.p - a.p, b.q - a.q);
    let (s, t) = (u.norm(), v.norm());
    if (s - t).abs() > LENGTH * cell || s.min(t) < APART * cell {
        return false;
    }
    let (u, v) = (u / s, v / t);
    (a.n.dot(&u) - a.m.dot(&v)).abs() < COSINE
        && (b.n.dot(&u) - b.m.dot(&v)).abs() < COSINE
        && (a.n.dot(&b.n) - a.m.dot(&b.m)).abs() < COSINE
        // A mirrored image keeps all of these but not the hand.
        && (a.n.cross(&b.n).dot(&u) - a.m.cross(&b.m).dot(&v)).abs() < 1.4 * COSINE
}
