//! Surfels: the points of one view laid onto the plane of their surroundings, with that plane's normal.
//!
//! A depth sensor's noise is larger than the distance between its points, so nearest points and raw normals say little; planes
//! over many points say a lot. Both clouds of a pair lose the same to the smoothing, so nothing is lost between them.
//! Weights fall smoothly to the rim of the surroundings, so that no point counts all or nothing. Any frame, metres.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::normals::least_direction;

/// Points a plane needs at least.
const NEEDED: f32 = 6.0;
/// Points a parallel task looks at; fixed.
const CHUNK: usize = 512;
/// Coarser cells than asked for rather than more than this many.
const MOST_CELLS: usize = 4_000_000;

/// Points farther out can't be told apart from rounding, metres.
const FARTHEST: f32 = 1e6;
/// Surfaces seen more from the side than this are left out.
const LEAST_COSINE: f32 = 0.25;
/// Share of the radius that the middle of the surroundings may lie aside.
const MOST_ASIDE: f32 = 0.3;

/// Surfels of a view; coordinates are relative to `centre`.
#[derive(Debug, Clone, Default)]
pub struct Surfels {
    /// Middle of the view's points.
    pub centre: Point3<f64>,
    /// Places on the surface, metres from the centre.
    pub points: Vec<[f32; 3]>,
    /// Unit normals to the sensor's side.
    pub normals: Vec<[f32; 3]>,
    /// Weight of each, 0 to 1: the cosine between the normal and the line of sight.
    pub weights: Vec<f32>,
}

impl Surfels {
    /// Surfels over surroundings of `radius` metres of points that a sensor at `sensor` saw; places with too few points
    /// around, at an edge, or seen too much from the side have none.
    pub fn new(points: &[[f32; 3]], sensor: &[f32; 3], radius: f32) -> Self {
        let finite: Vec<[f32; 3]> =
            points.iter().copied().filter(|p| p.iter().all(|v| v.abs() < FARTHEST)).collect();
        if finite.is_empty() || !(radius.is_finite() && radius > 0.0) || u32::try_from(finite.len()).is_err()
        {
            return Self::default();
        }
        let sum = finite.iter().fold(Vector3::zeros(), |sum, p| sum + Vector3::from(p.map(f64::from)));
        let centre = (sum / finite.len() as f64).map(|v| f64::from(v as f32));
        let middle: [f32; 3] = centre.map(|v| v as f32).into();
        let relative: Vec<[f32; 3]> =
            finite.iter().map(|p| std::array::from_fn(|k| p[k] - middle[k])).collect();
        let sensor = std::array::from_fn(|k| sensor[k] - middle[k]);
        let cells = Cells::new(&relative, radius);
        let parts: Vec<Vec<Surfel>> = cells
            .points
            .par_chunks(CHUNK)
            .map(|chunk| chunk.iter().filter_map(|p| cells.surfel(p, &sensor)).collect())
            .collect();
        let mut surfels = Self { centre: centre.into(), ..Self::default() };
        for (point, normal, weight) in parts.into_iter().flatten() {
            surfels.points.push(point);
            surfels.normals.push(normal);
            surfels.weights.push(weight);
        }
        surfels
    }

    /// Number of surfels.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

type Surfel = ([f32; 3], [f32; 3], f32);

/// Points sorted into cells as wide as the radius.
struct Cells {
    origin: [f32; 3],
    per_metre: f32,
    sizes: [usize; 3],
    starts: Vec<u32>,
    points: Vec<[f32; 3]>,
    radius: f32,
}

impl Cells {
    fn new(points: &[[f32; 3]], radius: f32) -> Self {
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in points {
            for k in 0..3 {
                lo[k] = lo[k].min(p[k]);
                hi[k] = hi[k].max(p[k]);
            }
        }
        let mut edge = radius * 0.5;
        let sizes_of = |edge: f32| -> [usize; 3] {
            std::array::from_fn(|k| ((hi[k] - lo[k]) / edge).min(1e9) as usize + 1)
        };
        while sizes_of(edge).iter().fold(1usize, |all, n| all.saturating_mul(*n)) > MOST_CELLS {
            edge *= 1.5;
        }
        let mut cells = Self {
            origin: lo,
            per_metre: 1.0 / edge,
            sizes: sizes_of(edge),
            starts: Vec::new(),
            points: vec![[0.0; 3]; points.len()],
            radius,
        };
        let mut starts = vec![0u32; cells.sizes.iter().product::<usize>() + 1];
        let keys: Vec<usize> = points.iter().map(|p| cells.key(cells.cell_of(p))).collect();
        for key in &keys {
            starts[key + 1] += 1;
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        let mut next = starts.clone();
        for (p, key) in points.iter().zip(&keys) {
            cells.points[next[*key] as usize] = *p;
            next[*key] += 1;
        }
        cells.starts = starts;
        cells
    }

    fn cell_of(&self, p: &[f32; 3]) -> [usize; 3] {
        std::array::from_fn(|k| (((p[k] - self.origin[k]) * self.per_metre) as usize).min(self.sizes[k] - 1))
    }

    fn key(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.sizes[1] + y) * self.sizes[0] + x
    }

    fn surfel(&self, p: &[f32; 3], sensor: &[f32; 3]) -> Option<Surfel> {
        let moments = self.moments(p);
        let [weight, mx, my, mz, xx, xy, xz, yy, yz, zz, count] = moments;
        if count < NEEDED {
            return None;
        }
        let mean = Vector3::new(mx, my, mz) / weight;
        let over = f64::from(1.0 / weight);
        let m = mean.map(f64::from);
        let covariance = [
            f64::from(xx) * over - m.x * m.x,
            f64::from(xy) * over - m.x * m.y,
            f64::from(xz) * over - m.x * m.z,
            f64::from(yy) * over - m.y * m.y,
            f64::from(yz) * over - m.y * m.z,
            f64::from(zz) * over - m.z * m.z,
        ];
        let (normal, _) = least_direction(&covariance)?;
        let normal: Vector3<f32> = normal.map(|v| v as f32);
        let sight = (Vector3::from(*sensor) - Vector3::from(*p)).normalize();
        let cosine = normal.dot(&sight);
        let normal = if cosine < 0.0 { -normal } else { normal };
        let off = normal.dot(&mean);
        // At an edge of the view all surroundings lie on one side.
        if cosine.abs() < LEAST_COSINE || (mean - normal * off).norm() > MOST_ASIDE * self.radius {
            return None;
        }
        Some(((Vector3::from(*p) + normal * off).into(), normal.into(), cosine.abs()))
    }

    /// Weighted moments of the surroundings, relative to `p`.
    fn moments(&self, p: &[f32; 3]) -> [f32; 11] {
        let per_square = 1.0 / (self.radius * self.radius);
        let cell = self.cell_of(p);
        let wide = (self.radius * self.per_metre).ceil() as usize;
        let first = cell.map(|c| c.saturating_sub(wide));
        let last: [usize; 3] = std::array::from_fn(|k| (cell[k] + wide).min(self.sizes[k] - 1));
        let mut sums = [0.0f32; 11];
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                let from = self.starts[self.key([first[0], y, z])] as usize;
                let to = self.starts[self.key([last[0], y, z]) + 1] as usize;
                for q in &self.points[from..to] {
                    let [x, y, z]: [f32; 3] = std::array::from_fn(|k| q[k] - p[k]);
                    let near = 1.0 - (x * x + y * y + z * z) * per_square;
                    if near > 0.0 {
                        let w = near;
                        let terms = [
                            w,
                            w * x,
                            w * y,
                            w * z,
                            w * x * x,
                            w * x * y,
                            w * x * z,
                            w * y * y,
                            w * y * z,
                            w * z * z,
                            1.0,
                        ];
                        for (sum, term) in sums.iter_mut().zip(terms) {
                            *sum += term;
                        }
                    }
                }
            }
        }
        sums
    }
}
