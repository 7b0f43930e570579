//! The plane that a product stands on, found without a board, and the world frame it gives.
//!
//! RANSAC with one oriented point a sample, then least squares over the inliers. Camera frame in, metres; deterministic by seed.

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use crate::cloud::PointCloud;
use crate::pose::Pose;

/// A plane `normal · p = offset`, the normal towards the side the camera is on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal.
    pub normal: [f64; 3],
    /// Distance from the origin along the normal, metres.
    pub offset: f64,
    /// Share of the given points that lie on it.
    pub support: f64,
}

impl Plane {
    /// Signed distance of a point, positive on the camera's side.
    pub fn height(&self, p: &Point3<f64>) -> f64 {
        Vector3::from(self.normal).dot(&p.coords) - self.offset
    }

    /// The same plane in frame a, of a plane in frame b.
    pub fn transformed(&self, a_from_b: &Pose) -> Self {
        let normal = a_from_b.rotation * Vector3::from(self.normal);
        Self {
            normal: normal.into(),
            offset: self.offset + normal.dot(&a_from_b.translation.vector),
            ..*self
        }
    }
}

/// How to look for the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneConfig {
    /// Points this close to the plane lie on it, metres.
    pub tolerance_metres: f64,
    /// Largest angle between a point's normal and the plane's, as a cosine.
    pub min_normal_cosine: f64,
    /// Samples.
    pub iterations: usize,
    /// Share of all points that a support plane has at least.
    pub min_support: f64,
    /// Seed of the random choices.
    pub seed: u64,
}

impl Default for PlaneConfig {
    fn default() -> Self {
        Self { tolerance_metres: 0.008, min_normal_cosine: 0.9, iterations: 300, min_support: 0.1, seed: 0 }
    }
}

/// The largest plane below the camera of a cloud with normals; `None` where no plane is large enough.
///
/// "Below": of the planes found, walls (which a camera faces without looking down on them) can't be told apart from tables
/// without gravity, so simply the largest is taken.
pub fn support_plane(cloud_in_camera: &PointCloud, config: &PlaneConfig) -> Option<Plane> {
    if !cloud_in_camera.has_normals() {
        return None;
    }
    let oriented: Vec<(Vector3<f64>, Vector3<f64>)> = cloud_in_camera
        .points
        .iter()
        .zip(&cloud_in_camera.normals)
        .map(|(p, n)| (Vector3::from(p.map(f64::from)), Vector3::from(n.map(f64::from))))
        .filter(|(p, n)| p.iter().all(|v| v.is_finite()) && n.norm_squared() > 0.5)
        .collect();
    if oriented.is_empty() {
        return None;
    }
    let mut rng = fastrand::Rng::with_seed(config.seed);
    let sparse: Vec<_> = oriented.iter().copied().step_by(oriented.len().div_ceil(4000)).collect();
    let mut best: Option<(usize, Vector3<f64>, f64)> = None;
    for _ in 0..config.iterations {
        let (p, normal) = oriented[rng.usize(0..oriented.len())];
        let offset = normal.dot(&p);
        let score = on_plane(&sparse, &normal, offset, config).count();
        if best.as_ref().is_none_or(|b| score > b.0) {
            best = Some((score, normal, offset));
        }
    }
    let (_, mut normal, mut offset) = best?;
    let mut inliers = 0;
    for _ in 0..4 {
        let members: Vec<Vector3<f64>> = on_plane(&oriented, &normal, offset, config).collect();
        inliers = members.len();
        let Some((fitted, mean)) = fit(&members) else { break };
        normal = if fitted.dot(&normal) < 0.0 { -fitted } else { fitted };
        offset = normal.dot(&mean);
    }
    if offset > 0.0 {
        // The camera, at the origin, is on the positive side.
        (normal, offset) = (-normal, -offset);
    }
    let support = inliers as f64 / cloud_in_camera.len() as f64;
    (support >= config.min_support).then(|| Plane { normal: normal.into(), offset, support })
}

fn on_plane<'a>(
    oriented: &'a [(Vector3<f64>, Vector3<f64>)],
    normal: &Vector3<f64>,
    offset: f64,
    config: &PlaneConfig,
) -> impl Iterator<Item = Vector3<f64>> + 'a {
    let (normal, config) = (*normal, *config);
    oriented
        .iter()
        .filter(move |(p, n)| {
            (normal.dot(p) - offset).abs() < config.tolerance_metres
                && n.dot(&normal) > config.min_normal_cosine
        })
        .map(|(p, _)| *p)
}

fn fit(members: &[Vector3<f64>]) -> Option<(Vector3<f64>, Vector3<f64>)> {
    if members.len() < 3 {
        return None;
    }
    let mean = members.iter().sum::<Vector3<f64>>() / members.len() as f64;
    let mut covariance = Matrix3::zeros();
    for p in members {
        let d = p - mean;
        covariance += d * d.transpose();
    }
    let eigen = covariance.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    Some((eigen.eigenvectors.column(least).into_owned(), mean))
}

/// The world of a scan without a board: z up along the plane's normal, origin on the plane under `product_in_camera`,
/// x as near to the first view's x axis as possible.
pub fn world_from_first_view(plane: &Plane, product_in_camera: &Point3<f64>) -> Pose {
    let z = Vector3::from(plane.normal).normalize();
    let sideways = |axis: Vector3<f64>| (axis - z * z.dot(&axis)).try_normalize(0.1);
    let x =
        sideways(Vector3::x()).or_else(|| sideways(Vector3::y())).unwrap_or_else(|| z.cross(&Vector3::z()));
    let rows = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rows));
    let foot = product_in_camera.coords - z * plane.height(product_in_camera);
    Pose::from_parts((-(rotation * foot)).into(), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tilted table with a box's side on it, and scattered points.
    fn scene() -> (PointCloud, Vector3<f64>) {
        let mut rng = fastrand::Rng::with_seed(3);
        let up = Vector3::new(0.1, -0.7, -0.6).normalize();
        let (a, b) = (up.cross(&Vector3::x()).normalize(), up.cross(&up.cross(&Vector3::x())).normalize());
        let mut cloud = PointCloud::default();
        for i in 0..5000 {
            let (s, t, e) = (rng.f64() - 0.5, rng.f64() - 0.5, (rng.f64() - 0.5) * 0.004);
            let centre = Vector3::new(0.0, 0.0, 0.8);
            let (p, n) = match i % 5 {
                0..3 => (centre + a * s + b * t + up * e, up),
                3 => (centre + a * s * 0.2 + up * (0.1 + 0.2 * t), b),
                _ => (centre + a * s + b * t + up * rng.f64() * 0.3, Vector3::new(s, t, e).normalize()),
            };
            cloud.points.push(p.map(|v| v as f32).into());
            cloud.normals.push(n.map(|v| v as f32).into());
        }
        (cloud, up)
    }

    #[test]
    fn the_table_is_found_and_gives_an_upright_world() {
        let (cloud, up) = scene();
        let plane = support_plane(&cloud, &PlaneConfig::default()).unwrap();
        assert!(Vector3::from(plane.normal).dot(&up) > 0.9999 && plane.support > 0.55, "{plane:?}");
        let product = Point3::from(Vector3::new(0.0, 0.0, 0.8) + up * 0.07);
        let world = world_from_first_view(&plane, &product);
        let p = world * product;
        assert!(p.x.abs() < 1e-9 && p.y.abs() < 1e-9 && (p.z - 0.07).abs() < 1e-3, "{p}");
        let moved = plane.transformed(&world);
        assert!((Vector3::from(moved.normal) - Vector3::z()).norm() < 1e-9 && moved.offset.abs() < 1e-9);
        assert_eq!(support_plane(&cloud, &PlaneConfig::default()), Some(plane));
    }

    #[test]
    fn without_a_plane_there_is_none() {
        let (mut cloud, _) = scene();
        let mut rng = fastrand::Rng::with_seed(9);
        for n in &mut cloud.normals {
            *n = Vector3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5).normalize().into();
        }
        assert!(support_plane(&cloud, &PlaneConfig { min_support: 0.3, ..PlaneConfig::default() }).is_none());
        assert!(support_plane(&PointCloud::default(), &PlaneConfig::default()).is_none());
    }
}
