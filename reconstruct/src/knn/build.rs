//! Building the tree: points along a Z-order curve, split where its integers first differ.

use super::{Node, Tree, is_finite};
use crate::radix::sort_by_bits;

/// Most points of a leaf: a few registers full.
const LEAF: usize = 32;
/// Bits of the curve an axis.
const AXIS_BITS: u32 = 12;
/// Bits left for the index of a point.
const INDEX_BITS: u32 = 28;

/// The tree over all finite points.
pub(super) fn tree(points: &[[f32; 3]]) -> Tree {
    let mut keys = curve_keys(points);
    sort_by_bits(&mut keys, INDEX_BITS, 3 * AXIS_BITS);
    let mut nodes = Vec::with_capacity(keys.len() / 8 + 1);
    if !keys.is_empty() {
        split(points, &mut keys, 0, &mut nodes);
    }
    let indices: Vec<u32> = keys.iter().map(|&key| index_of(key) as u32).collect();
    let axes = std::array::from_fn(|k| indices.iter().map(|&i| points[i as usize][k]).collect());
    Tree { nodes, axes, indices }
}

fn index_of(key: u64) -> usize {
    (key & ((1 << INDEX_BITS) - 1)) as usize
}

/// Place on the curve above the index, of every finite point.
fn curve_keys(points: &[[f32; 3]]) -> Vec<u64> {
    let points = &points[..points.len().min(1 << INDEX_BITS)];
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in points.iter().filter(|p| is_finite(p)) {
        for k in 0..3 {
            low[k] = low[k].min(f64::from(p[k]));
            high[k] = high[k].max(f64::from(p[k]));
        }
    }
    let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let scale = if extent > 0.0 { f64::from((1u32 << AXIS_BITS) - 1) / extent } else { 0.0 };
    let place = |p: &[f32; 3]| {
        let [x, y, z]: [u64; 3] =
            std::array::from_fn(|k| spread(((f64::from(p[k]) - low[k]) * scale) as u64));
        (z << 2) | (y << 1) | x
    };
    let finite = (0u64..).zip(points).filter(|(_, p)| is_finite(p));
    finite.map(|(index, p)| (place(p) << INDEX_BITS) | index).collect()
}

/// Two zero bits between neighbouring bits.
fn spread(v: u64) -> u64 {
    let v = (v | (v << 16)) & 0x0f00_00ff;
    let v = (v | (v << 8)) & 0x0f00_f00f;
    let v = (v | (v << 4)) & 0xc30c_30c3;
    (v | (v << 2)) & 0x2_4924_9249
}

/// Adds the node of sorted keys and all below it; `first` is the place of the first key.
fn split(points: &[[f32; 3]], keys: &mut [u64], first: usize, nodes: &mut Vec<Node>) {
    let at = nodes.len();
    let (low, high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    let (first, end) = (first as u32, (first + keys.len()) as u32);
    nodes.push(Node { low, high, first, end, second: 0, after: 0 });
    if keys.len() <= LEAF {
        for &key in keys.iter() {
            let p = points[index_of(key)];
            nodes[at].include(&p, &p);
        }
    } else {
        let middle = middle_of(points, keys);
        let (a, b) = keys.split_at_mut(middle);
        split(points, a, first as usize, nodes);
        let second = nodes.len();
        nodes[at].second = second as u32;
        split(points, b, first as usize + middle, nodes);
        for child in [at + 1, second] {
            let Node { low, high, .. } = nodes[child];
            nodes[at].include(&low, &high);
        }
    }
    nodes[at].after = nodes.len() as u32;
}

impl Node {
    fn include(&mut self, low: &[f32; 3], high: &[f32; 3]) {
        for k in 0..3 {
            self.low[k] = self.low[k].min(low[k]);
            self.high[k] = self.high[k].max(high[k]);
        }
    }
}

/// Where the curve's first differing bit changes; within one cell of the curve, the median along the longest axis.
fn middle_of(points: &[[f32; 3]], keys: &mut [u64]) -> usize {
    let differing = (keys[0] ^ keys[keys.len() - 1]) >> INDEX_BITS;
    if differing != 0 {
        let bit = 1u64 << (differing.ilog2() + INDEX_BITS);
        return keys.partition_point(|key| key & bit == 0);
    }
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for &key in keys.iter() {
        for k in 0..3 {
            low[k] = low[k].min(points[index_of(key)][k]);
            high[k] = high[k].max(points[index_of(key)][k]);
        }
    }
    let longest = (1..3).fold(0, |a, b| if high[b] - low[b] > high[a] - low[a] { b } else { a });
    let middle = keys.len() / 2;
    keys.select_nth_unstable_by(middle, |a, b| {
        let along = |key: &u64| points[index_of(*key)][longest];
        along(a).total_cmp(&along(b)).then(a.cmp(b))
    });
    middle
}
