//! The viewer's stream, `ARS1`: a model in a form that a browser shows while it arrives.
//!
//! Little-endian: `"ARS1"` · u32 length of the header · header JSON padded with spaces to a multiple of 4 · chunks of 4096
//! points · triangles. A chunk of n points: `u16[3n]` positions (`p = min + q / 65535 * (max - min)`, metres, z up), `u8[3n]`
//! sRGB, with normals `i8[2n]` (octahedral, after Cigolle et al. 2014), with deviations `u8[n]` (steps of 0.02 mm up to 254;
//! 255: invented, nobody measured it), zeros up to a multiple of 4; then `u32[3]` a triangle.
//!
//! The points are in an order in which **any prefix is an even sample of the whole**: along a Morton
//! curve, whose neighbours are neighbours in space, read at the indices of van der Corput's sequence, which fills an
//! interval evenly at every length. So a mesh can be shown by its vertices until its triangles are there.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::mesh::{INVENTED, Mesh};

/// Points of a chunk; the last may have fewer.
pub const CHUNK_POINTS: usize = 4096;
/// Longest header that is read, bytes.
const MAX_HEADER_BYTES: usize = 64 * 1024;
/// Colour of points that have none.
const NO_COLOR: [u8; 3] = [176; 3];
/// Steps of deviations, metres, and the step of invented points.
const DEVIATION_STEP_METRES: f32 = 0.00002;
const INVENTED_STEP: u8 = 255;
const MAGIC: &[u8; 4] = b"ARS1";

/// What cannot be written or read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StreamError {
    /// Nothing to show.
    #[error("the model has no points")]
    Empty,
    /// More than the format can count.
    #[error("the model has more points or triangles than the stream can count")]
    TooMany,
    /// A coordinate is not a number.
    #[error("point {0} has a coordinate that is not a finite number")]
    NotFinite(usize),
    /// A triangle names a vertex that is not there.
    #[error("triangle {0} names a vertex that is not there")]
    BadTriangle(usize),
    /// Not a stream, or one that was cut off.
    #[error("not a complete ARS1 stream: {0}")]
    Malformed(&'static str),
}

/// The JSON at the stream's head.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Always 1.
    pub version: u32,
    /// `"points"` or `"mesh"`.
    pub kind: String,
    /// Points or vertices.
    pub points: u32,
    /// Triangles; 0 for points.
    pub triangles: u32,
    /// Lowest coordinates, metres.
    pub min: [f32; 3],
    /// Highest coordinates, metres.
    pub max: [f32; 3],
    /// Always [`CHUNK_POINTS`].
    pub chunk_points: u32,
    /// Whether chunks carry normals.
    pub has_normals: bool,
    /// Whether chunks carry deviations.
    #[serde(default)]
    pub has_deviations: bool,
    /// Always `"z"`.
    pub up: String,
}

/// Writes a model as a stream.
pub fn encode(model: &Mesh) -> Result<Vec<u8>, StreamError> {
    let cloud = &model.vertices;
    let (header, order) = (header_of(model)?, order_of(model));
    let mut out = Vec::with_capacity(512 + cloud.len() * 12 + model.triangles.len() * 12);
    out.extend_from_slice(MAGIC);
    write_header(&mut out, &header);
    for chunk in order.chunks(CHUNK_POINTS) {
        write_chunk(&mut out, model, &header, chunk);
    }
    let mut place = vec![0u32; cloud.len()];
    order.iter().enumerate().for_each(|(new, &old)| place[old as usize] = new as u32);
    for &index in model.triangles.iter().flatten() {
        out.extend_from_slice(&place[index as usize].to_le_bytes());
    }
    Ok(out)
}

/// Reads a stream back; positions are as exact as 16 bits of the extent.
pub fn decode(bytes: &[u8]) -> Result<(Header, Mesh), StreamError> {
    let (header, mut rest) = read_header(bytes)?;
    let (points, triangles) = (header.points as usize, header.triangles as usize);
    let mut mesh = Mesh::default();
    for start in (0..points).step_by(CHUNK_POINTS) {
        let n = CHUNK_POINTS.min(points - start);
        let chunk = take(&mut rest, chunk_bytes(n, &header))?;
        read_chunk(chunk, n, &header, &mut mesh);
    }
    let indices = take(&mut rest, triangles.checked_mul(12).ok_or(StreamError::TooMany)?)?;
    mesh.triangles = indices.chunks_exact(12).map(|t| std::array::from_fn(|k| u32_at(t, 4 * k))).collect();
    if !rest.is_empty() {
        return Err(StreamError::Malformed("bytes after the end"));
    }
    Ok((header, mesh))
}

fn header_of(model: &Mesh) -> Result<Header, StreamError> {
    let cloud = &model.vertices;
    if let Some(bad) = cloud.points.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
        return Err(StreamError::NotFinite(bad));
    }
    let (min, max) = cloud.bounds().ok_or(StreamError::Empty)?;
    if let Some(bad) = model.triangles.iter().position(|t| t.iter().any(|&i| i as usize >= cloud.len())) {
        return Err(StreamError::BadTriangle(bad));
    }
    let count = |n: usize| u32::try_from(n).map_err(|_too_many| StreamError::TooMany);
    Ok(Header {
        version: 1,
        kind: if model.triangles.is_empty() { "points" } else { "mesh" }.to_string(),
        points: count(cloud.len())?,
        triangles: count(model.triangles.len())?,
        min,
        max,
        chunk_points: CHUNK_POINTS as u32,
        has_normals: cloud.has_normals(),
        has_deviations: model.has_deviations(),
        up: "z".to_string(),
    })
}

/// Indices of the points in the order they are written.
pub fn order_of(model: &Mesh) -> Vec<u32> {
    even_order(&model.vertices.points)
}

/// Indices of all points, such that the first n of them are spread evenly over the whole, for every n.
pub fn even_order(points: &[[f32; 3]]) -> Vec<u32> {
    let along_curve = morton_order(points);
    let bits = usize::BITS - points.len().saturating_sub(1).leading_zeros();
    let reversed = |i: usize| if bits == 0 { 0 } else { i.reverse_bits() >> (usize::BITS - bits) };
    (0..1usize << bits).filter_map(|i| along_curve.get(reversed(i)).copied()).collect()
}

/// Indices along a Morton curve through the bounding cube; equal codes keep their order.
fn morton_order(points: &[[f32; 3]]) -> Vec<u32> {
    let lowest = points.iter().fold([f32::MAX; 3], |lo, p| std::array::from_fn(|k| lo[k].min(p[k])));
    let side =
        points.iter().flat_map(|p| (0..3).map(move |k| p[k] - lowest[k])).fold(f32::MIN_POSITIVE, f32::max);
    let cell = |v: f32, k: usize| (f64::from(v - lowest[k]) / f64::from(side) * 2_097_151.0) as u64;
    let code = |p: &[f32; 3]| (0..3).fold(0, |code, k| code | spread(cell(p[k], k)) << k);
    let mut keyed: Vec<(u64, u32)> =
        points.par_iter().enumerate().map(|(i, p)| (code(p), i as u32)).collect();
    keyed.par_sort_unstable();
    keyed.into_iter().map(|(_, index)| index).collect()
}

/// 21 bits with two empty bits after each.
fn spread(value: u64) -> u64 {
    let mut v = value & 0x1f_ffff;
    v = (v | v << 32) & 0x1f_0000_0000_ffff;
    v = (v | v << 16) & 0x1f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

fn write_header(out: &mut Vec<u8>, header: &Header) {
    let mut json = serde_json::to_vec(header).expect("numbers and words always have a JSON form");
    json.resize(json.len().next_multiple_of(4), b' ');
    out.extend_from_slice(&(json.len() as u32).to_le_bytes());
    out.extend_from_slice(&json);
}

fn write_chunk(out: &mut Vec<u8>, model: &Mesh, header: &Header, chunk: &[u32]) {
    let cloud = &model.vertices;
    let start = out.len();
    for &i in chunk {
        let point = cloud.points[i as usize];
        for k in 0..3 {
            out.extend_from_slice(&quantised(point[k], header.min[k], header.max[k]).to_le_bytes());
        }
    }
    for &i in chunk {
        out.extend_from_slice(&if cloud.has_colors() { cloud.colors[i as usize] } else { NO_COLOR });
    }
    if header.has_normals {
        for &i in chunk {
            out.extend(octahedral(cloud.normals[i as usize]).map(i8::cast_unsigned));
        }
    }
    if header.has_deviations {
        out.extend(chunk.iter().map(|&i| deviation_step(model.deviations_metres[i as usize])));
    }
    out.resize(start + (out.len() - start).next_multiple_of(4), 0);
}

/// A deviation as a byte.
fn deviation_step(deviation_metres: f32) -> u8 {
    if deviation_metres == INVENTED {
        INVENTED_STEP
    } else {
        (deviation_metres / DEVIATION_STEP_METRES).round().clamp(0.0, f32::from(INVENTED_STEP - 1)) as u8
    }
}

fn quantised(value: f32, min: f32, max: f32) -> u16 {
    let extent = f64::from(max) - f64::from(min);
    if extent <= 0.0 { 0 } else { ((f64::from(value) - f64::from(min)) / extent * 65535.0).round() as u16 }
}

/// A direction as a point of the unfolded octahedron, in steps of 1/127.
pub fn octahedral(normal: [f32; 3]) -> [i8; 2] {
    let [x, y, z] = normal;
    let sum = x.abs() + y.abs() + z.abs();
    if sum.is_nan() || sum <= 0.0 {
        return [0, 0];
    }
    let (u, v) = (x / sum, y / sum);
    let sign = |value: f32| if value < 0.0 { -1.0 } else { 1.0 };
    let (u, v) = if z < 0.0 { ((1.0 - v.abs()) * sign(u), (1.0 - u.abs()) * sign(v)) } else { (u, v) };
    [(u * 127.0).round() as i8, (v * 127.0).round() as i8]
}

/// The unit direction of an [`octahedral`] pair.
pub fn from_octahedral([u, v]: [i8; 2]) -> [f32; 3] {
    let (u, v) = (f32::from(u) / 127.0, f32::from(v) / 127.0);
    let z = 1.0 - u.abs() - v.abs();
    let fold = (-z).max(0.0);
    let (x, y) = (u - fold.copysign(u), v - fold.copysign(v));
    let length = (x * x + y * y + z * z).sqrt().max(f32::MIN_POSITIVE);
    [x / length, y / length, z / length]
}

fn chunk_bytes(n: usize, header: &Header) -> usize {
    let per_point = 9 + 2 * usize::from(header.has_normals) + usize::from(header.has_deviations);
    (n * per_point).next_multiple_of(4)
}

fn take<'a>(rest: &mut &'a [u8], n: usize) -> Result<&'a [u8], StreamError> {
    let (taken, after) = rest.split_at_checked(n).ok_or(StreamError::Malformed("cut off"))?;
    *rest = after;
    Ok(taken)
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|k| bytes[at + k]))
}

fn read_header(mut bytes: &[u8]) -> Result<(Header, &[u8]), StreamError> {
    if take(&mut bytes, 4)? != MAGIC {
        return Err(StreamError::Malformed("it does not begin with ARS1"));
    }
    let length = u32_at(take(&mut bytes, 4)?, 0) as usize;
    if length > MAX_HEADER_BYTES {
        return Err(StreamError::Malformed("the header is too long"));
    }
    let json = take(&mut bytes, length)?;
    let header: Header = serde_json::from_slice(json)
        .map_err(|_error| StreamError::Malformed("the header is not the JSON it should be"))?;
    if header.version != 1 || header.chunk_points as usize != CHUNK_POINTS {
        return Err(StreamError::Malformed("another version"));
    }
    Ok((header, bytes))
}

fn read_chunk(chunk: &[u8], n: usize, header: &Header, mesh: &mut Mesh) {
    let cloud = &mut mesh.vertices;
    let (positions, after) = chunk.split_at(6 * n);
    let (colors, after) = after.split_at(3 * n);
    for p in positions.chunks_exact(6) {
        cloud.points.push(std::array::from_fn(|k| {
            let q = f64::from(u16::from_le_bytes([p[2 * k], p[2 * k + 1]])) / 65535.0;
            let (min, max) = (f64::from(header.min[k]), f64::from(header.max[k]));
            (min + q * (max - min)) as f32
        }));
    }
    cloud.colors.extend(colors.chunks_exact(3).map(|c| [c[0], c[1], c[2]]));
    let (pairs, after) = after.split_at(if header.has_normals { 2 * n } else { 0 });
    let directions = pairs.chunks_exact(2).map(|c| from_octahedral([c[0].cast_signed(), c[1].cast_signed()]));
    cloud.normals.extend(directions);
    if header.has_deviations {
        let metres = |&step: &u8| match step {
            INVENTED_STEP => INVENTED,
            step => f32::from(step) * DEVIATION_STEP_METRES,
        };
        mesh.deviations_metres.extend(after[..n].iter().map(metres));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::PointCloud;
    use proptest::prelude::*;

    fn random_cloud(n: usize, seed: u64, with_normals: bool) -> PointCloud {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut unit = || rng.f32() * 2.0 - 1.0;
        let points: Vec<[f32; 3]> = (0..n).map(|_| [unit() * 0.1, unit() * 0.2, unit() * 0.05]).collect();
        let colors = (0..n).map(|i| [(i % 251) as u8, (i / 251 % 251) as u8, (i / 63001) as u8]).collect();
        let normal = |p: &[f32; 3]| {
            let length = p.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-9);
            p.map(|v| v / length)
        };
        let normals = if with_normals { points.iter().map(normal).collect() } else { vec![] };
        PointCloud { points, colors, normals }
    }

    /// Largest over the octants of |share in the prefix - share in the whole|.
    fn unevenness(points: &[[f32; 3]], prefix: &[u32]) -> f64 {
        let octant = |p: &[f32; 3]| (0..3).filter(|&k| p[k] > 0.0).map(|k| 1usize << k).sum::<usize>();
        let share = |count: usize, of: usize| count as f64 / of as f64;
        (0..8)
            .map(|o| {
                let all = points.iter().filter(|p| octant(p) == o).count();
                let some = prefix.iter().filter(|&&i| octant(&points[i as usize]) == o).count();
                (share(some, prefix.len()) - share(all, points.len())).abs()
            })
            .fold(0.0, f64::max)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn any_prefix_is_an_even_sample(n in 300usize..6000, seed: u64, share in 0.02f64..1.0) {
            let points = random_cloud(n, seed, false).points;
            let order = even_order(&points);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            prop_assert!(sorted.into_iter().eq(0..n as u32), "each point once");
            let prefix = &order[..((n as f64 * share) as usize).max(1)];
            // Van der Corput's discrepancy is about log2(n) / n; a random prefix would be off by 1 / sqrt(n).
            let bound = 2.0 * (prefix.len() as f64).log2().max(1.0) / prefix.len() as f64;
            let off = unevenness(&points, prefix);
            prop_assert!(off <= bound, "{off} > {bound} at {} of {n}", prefix.len());
        }

        #[test]
        fn points_come_back(n in 1usize..10_000, seed: u64, with_normals: bool) {
            let cloud = random_cloud(n, seed, with_normals);
            let order = even_order(&cloud.points);
            let (header, back) = decode(&encode(&Mesh::of_points(cloud.clone())).unwrap()).unwrap();
            prop_assert_eq!(header.kind, "points");
            prop_assert_eq!(back.vertices.has_normals(), with_normals);
            for (k, &i) in order.iter().enumerate() {
                let (a, b) = (cloud.points[i as usize], back.vertices.points[k]);
                prop_assert!((0..3).all(|c| (a[c] - b[c]).abs() <= 0.4 / 65535.0), "{a:?} {b:?}");
                prop_assert_eq!(cloud.colors[i as usize], back.vertices.colors[k]);
            }
        }

        #[test]
        fn directions_come_back(x in -1.0f32..1.0, y in -1.0f32..1.0, z in -1.0f32..1.0) {
            let length = (x * x + y * y + z * z).sqrt();
            prop_assume!(length > 0.01);
            let normal = [x / length, y / length, z / length];
            let back = from_octahedral(octahedral(normal));
            let cosine: f32 = (0..3).map(|k| normal[k] * back[k]).sum();
            prop_assert!(cosine > 0.9998, "{normal:?} {back:?}");
        }

        #[test]
        fn no_bytes_break_the_reader(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let mut stream = b"ARS1".to_vec();
            stream.extend(bytes);
            prop_assert!(decode(&stream).is_err());
        }
    }

    #[test]
    fn a_mesh_comes_back_in_an_even_order() {
        let vertices = random_cloud(5000, 7, true);
        let triangles = vec![[0, 1, 2], [4999, 3, 1]];
        let mut deviations_metres = vec![0.0003; 5000];
        deviations_metres[4999] = INVENTED;
        let mesh = Mesh { vertices, triangles, deviations_metres };
        let bytes = encode(&mesh).unwrap();
        let (header, back) = decode(&bytes).unwrap();
        assert_eq!((header.kind.as_str(), header.triangles), ("mesh", 2));
        let order = order_of(&mesh);
        let named = |m: &Mesh, t: usize| m.triangles[t].map(|i| m.vertices.colors[i as usize]);
        assert!((0..2).all(|t| named(&back, t) == named(&mesh, t)));
        assert!(back.is_invented(order.iter().position(|&i| i == 4999).unwrap()));
        assert_eq!(back.deviations_metres.iter().filter(|d| **d == INVENTED).count(), 1);
        assert!(back.deviations_metres.iter().all(|d| *d == INVENTED || (d - 0.0003).abs() < 1e-6));
        assert_eq!(decode(&bytes[..bytes.len() - 1]), Err(StreamError::Malformed("cut off")));
    }

    #[test]
    fn what_cannot_be_shown_is_refused() {
        assert_eq!(encode(&Mesh::default()), Err(StreamError::Empty));
        let vertices = PointCloud { points: vec![[0.0, f32::NAN, 0.0]], ..PointCloud::default() };
        assert_eq!(encode(&Mesh::of_points(vertices)), Err(StreamError::NotFinite(0)));
        let vertices = PointCloud { points: vec![[0.0; 3]], ..PointCloud::default() };
        assert_eq!(
            encode(&Mesh { vertices, triangles: vec![[0, 0, 1]], ..Mesh::default() }),
            Err(StreamError::BadTriangle(0))
        );
    }
}
