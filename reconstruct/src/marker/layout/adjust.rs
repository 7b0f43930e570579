//! The adjustment itself: Gauss-Newton over (x, y, yaw) of every tag and six degrees of freedom of every view.
//!
//! Views are eliminated first (Schur complement, Triggs et al. 2000), so the system has three unknowns a tag.

use nalgebra::{
    DMatrix, DVector, Isometry2, Matrix2x3, Matrix3, Matrix3x6, Matrix6, Point2, Point3, Vector2, Vector3,
    Vector6,
};

use super::local_corners;
use crate::camera::Intrinsics;
use crate::marker::projection::{by_left_step, with_derivative};
use crate::pose::{Pose, exp};

/// What every corner is off by beside its own uncertainty, pixels.
const COMMON_SIGMA_PX: f64 = 0.2;
const MAX_ITERATIONS: usize = 40;
/// Information that holds the first tag in its place, against all others' of about 1e8.
const GAUGE: f64 = 1e14;

/// A tag seen in a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Observation {
    pub(super) view: usize,
    pub(super) id: u32,
    pub(super) corners: [Point2<f64>; 4],
    pub(super) sigma_px: [f64; 4],
}

/// Tags on the table, views around it.
#[derive(Debug, Clone)]
pub(super) struct Problem {
    /// Placed ids, ascending.
    pub(super) ids: Vec<u32>,
    /// Table from tag.
    pub(super) places: Vec<Isometry2<f64>>,
    /// Camera from table; `None` where the view could not be joined.
    pub(super) views: Vec<Option<Pose>>,
    pub(super) observations: Vec<Observation>,
    pub(super) size: f64,
}

/// One corner's residual and derivatives.
struct Row {
    residual: Vector2<f64>,
    weight: f64,
    cost: f64,
    by_tag: Matrix2x3<f64>,
    by_view: nalgebra::Matrix2x6<f64>,
}

/// Normal equations with the views still in.
struct Normal {
    tags: DMatrix<f64>,
    tags_right: DVector<f64>,
    views: Vec<Matrix6<f64>>,
    views_right: Vec<Vector6<f64>>,
    /// (tag, view, coupling), a view's entries one after another.
    couplings: Vec<(usize, usize, Matrix3x6<f64>)>,
    cost: f64,
}

impl Problem {
    /// The places and poses of least cost; `None` where they are not determined.
    pub(super) fn adjust(mut self, camera: &Intrinsics, huber_px: f64) -> Option<Self> {
        let mut normal = self.linearize(camera, huber_px)?;
        let mut damping = 1e-4;
        for _ in 0..MAX_ITERATIONS {
            let Some((next, moved)) = self.stepped(&normal, damping) else {
                damping *= 10.0;
                if damping > 1e8 {
                    return None;
                }
                continue;
            };
            match next.linearize(camera, huber_px) {
                Some(n) if n.cost <= normal.cost => {
                    (self, normal) = (next, n);
                    damping *= 0.1;
                    if moved < 1e-8 {
                        break;
                    }
                }
                _ if damping > 1e8 => break,
                _ => damping = (damping * 10.0).max(1e-6),
            }
        }
        Some(self)
    }

    /// Root mean square distance of all corners, pixels.
    pub(super) fn rms_px(&self, camera: &Intrinsics) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0.0);
        for o in &self.observations {
            let (s, n) = self.squared_error(o, camera)?;
            sum += s;
            count += n;
        }
        (count > 0.0).then(|| f64::sqrt(sum / count))
    }

    /// The worst observation whose corners lie farther off than the limit.
    pub(super) fn disagreeing(&self, camera: &Intrinsics, limit_px: f64) -> Option<(usize, u32)> {
        let rms = |o: &Observation| {
            self.squared_error(o, camera).map_or(f64::INFINITY, |(sum, count)| (sum / count).sqrt())
        };
        let worst = self.observations.iter().map(|o| (rms(o), o)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        (worst.0 > limit_px).then_some((worst.1.view, worst.1.id))
    }

    /// Sum of the squared distances of an observation's corners, and how many they are.
    fn squared_error(&self, o: &Observation, camera: &Intrinsics) -> Option<(f64, f64)> {
        let (tag, pose) = (self.ids.binary_search(&o.id).ok()?, self.views[o.view]?);
        let (mut sum, mut count) = (0.0, 0.0);
        for (k, local) in
            local_corners(self.size).iter().enumerate().filter(|(k, _)| o.sigma_px[*k].is_finite())
        {
            let on_table = self.places[tag] * local;
            let pixel = camera.project(&(pose * Point3::new(on_table.x, on_table.y, 0.0)))?;
            sum += (pixel - o.corners[k]).norm_squared();
            count += 1.0;
        }
        (count > 0.0).then_some((sum, count))
    }

    fn linearize(&self, camera: &Intrinsics, huber_px: f64) -> Option<Normal> {
        let (tags, views) = (self.ids.len(), self.views.len());
        let mut normal = Normal {
            tags: DMatrix::zeros(3 * tags, 3 * tags),
            tags_right: DVector::zeros(3 * tags),
            views: vec![Matrix6::zeros(); views],
            views_right: vec![Vector6::zeros(); views],
            couplings: Vec::with_capacity(self.observations.len()),
            cost: 0.0,
        };
        for o in &self.observations {
            let (Ok(tag), Some(pose)) = (self.ids.binary_search(&o.id), self.views[o.view]) else { continue };
            let (mut own, mut right, mut coupling) = (Matrix3::zeros(), Vector3::zeros(), Matrix3x6::zeros());
            for k in (0..4).filter(|&k| o.sigma_px[k].is_finite()) {
                let row = self.row(o, k, tag, &pose, camera, huber_px)?;
                let tag_side = row.by_tag.transpose() * row.weight;
                own += tag_side * row.by_tag;
                right += tag_side * row.residual;
                coupling += tag_side * row.by_view;
                normal.views[o.view] += row.by_view.transpose() * row.by_view * row.weight;
                normal.views_right[o.view] += row.by_view.transpose() * row.residual * row.weight;
                normal.cost += row.cost;
            }
            let mut block = normal.tags.fixed_view_mut::<3, 3>(3 * tag, 3 * tag);
            block += own;
            let mut part = normal.tags_right.fixed_rows_mut::<3>(3 * tag);
            part += right;
            normal.couplings.push((tag, o.view, coupling));
        }
        normal.cost.is_finite().then_some(normal)
    }

    fn row(
        &self,
        o: &Observation,
        k: usize,
        tag: usize,
        pose: &Pose,
        camera: &Intrinsics,
        huber_px: f64,
    ) -> Option<Row> {
        let place = &self.places[tag];
        let arm = place.rotation * local_corners(self.size)[k];
        let on_table = place * local_corners(self.size)[k];
        let in_camera = pose * Point3::new(on_table.x, on_table.y, 0.0);
        let (pixel, by_point) = with_derivative(camera, &in_camera)?;
        let rotation = pose.rotation.to_rotation_matrix();
        let by_yaw = Vector3::new(-arm.y, arm.x, 0.0);
        let moves = rotation.matrix() * Matrix3::from_columns(&[Vector3::x(), Vector3::y(), by_yaw]);
        let residual = pixel - o.corners[k];
        let size = residual.norm();
        let certainty = 1.0 / (1.0 + (o.sigma_px[k] / COMMON_SIGMA_PX).powi(2));
        let (bend, squared) = if size <= huber_px {
            (1.0, size * size)
        } else {
            (huber_px / size, huber_px * (2.0 * size - huber_px))
        };
        Some(Row {
            residual,
            weight: certainty * bend,
            cost: certainty * squared,
            by_tag: by_point * moves,
            by_view: by_left_step(&by_point, &in_camera),
        })
    }

    /// The problem after one damped step, and how far it moved.
    fn stepped(&self, normal: &Normal, damping: f64) -> Option<(Self, f64)> {
        let damp = |m: &Matrix6<f64>| {
            let mut damped = *m;
            for k in 0..6 {
                damped[(k, k)] *= 1.0 + damping;
            }
            damped
        };
        let mut inverses = vec![None; self.views.len()];
        for (v, block) in normal.views.iter().enumerate().filter(|(v, _)| self.views[*v].is_some()) {
            inverses[v] = Some(damp(block).cholesky()?.inverse());
        }
        let mut reduced = normal.tags.clone();
        let mut right = -&normal.tags_right;
        for k in 0..reduced.nrows() {
            reduced[(k, k)] *= 1.0 + damping;
        }
        for &(a, view, ref coupling) in &normal.couplings {
            let through = coupling * inverses[view]?;
            let mut part = right.fixed_rows_mut::<3>(3 * a);
            part += through * normal.views_right[view];
            for (b, _, other) in normal.couplings.iter().filter(|c| c.1 == view) {
                let mut block = reduced.fixed_view_mut::<3, 3>(3 * a, 3 * b);
                block -= through * other.transpose();
            }
        }
        for k in 0..3 {
            reduced[(k, k)] += GAUGE;
        }
        let tag_steps = reduced.cholesky()?.solve(&right);
        let mut view_rights: Vec<Vector6<f64>> = normal.views_right.iter().map(|r| -r).collect();
        for &(tag, view, ref coupling) in &normal.couplings {
            view_rights[view] -= coupling.transpose() * tag_steps.fixed_rows::<3>(3 * tag);
        }
        let mut next = self.clone();
        let mut moved = tag_steps.norm();
        for (t, place) in next.places.iter_mut().enumerate() {
            let s = tag_steps.fixed_rows::<3>(3 * t);
            *place = Isometry2::new(
                place.translation.vector + Vector2::new(s[0], s[1]),
                place.rotation.angle() + s[2],
            );
        }
        for (v, inverse) in inverses.iter().enumerate() {
            if let (Some(pose), Some(inverse)) = (&mut next.views[v], inverse) {
                let step = inverse * view_rights[v];
                *pose = exp(&step) * *pose;
                moved += step.norm();
            }
        }
        Some((next, moved))
    }
}
