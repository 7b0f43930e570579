//! How well a placement fits: what lies on the other's surface, with which paint, and what stands in its free space.

use nalgebra::{Point3, Vector3};

use super::super::near_field::NearField;
use super::Evidence;
use super::color::Comparison;
use super::settle::Row;
use super::side::{Dense, Prepared};
use crate::fuse::PlacedView;
use crate::pose::Pose;
use crate::view::DepthView;

/// Within this of the other's tangent plane a point lies on its surface, metres.
const ON_SURFACE: f32 = 0.003;
/// Points looked at by the first judgements.
const GLANCE: usize = 250;
const NEARNESS: usize = 1200;
/// Points whose paint is compared in the end.
const PAINTED: usize = 5000;
/// Surfaces farther apart along the line of sight contradict each other, metres.
const SEEN_THROUGH: f64 = 0.005;
/// Points lower than this lie under the board, metres.
const UNDER: f32 = -0.004;
/// Least cosine between a point's normal and the line of sight for a view to have a say.
const FACING: f64 = 0.4;

/// One recording as it is compared with the other.
struct Half<'a> {
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    dense: Dense,
    field: NearField,
    views: Vec<(Pose, &'a DepthView)>,
    cell: f32,
}

/// Both recordings.
pub(super) struct Judge<'a> {
    halves: [Half<'a>; 2],
}

/// What the points of one recording met in the other.
#[derive(Clone, Copy, Default)]
struct Met {
    all: usize,
    on_surface: usize,
    fit: f64,
    squares: f64,
    conflicts: usize,
    paint: Comparison,
}

impl Met {
    fn plus(&self, other: &Self) -> Self {
        Self {
            all: self.all + other.all,
            on_surface: self.on_surface + other.on_surface,
            fit: self.fit + other.fit,
            squares: self.squares + other.squares,
            conflicts: self.conflicts + other.conflicts,
            paint: self.paint.plus(&other.paint),
        }
    }

    fn evidence(&self) -> Evidence {
        let share = |part: f64| part / self.all.max(1) as f64;
        let (color, texture) = self.paint.result();
        let (overlap, conflict) = (share(self.on_surface as f64), share(self.conflicts as f64));
        let fit = share(self.fit);
        let shape_score = fit - 2.0 * conflict;
        // Without paint the shape alone counts; with it, what does not agree in paint does not count.
        let score = fit * (1.0 - texture * (1.0 - color.max(0.0))) - 2.0 * conflict;
        let rmse_metres = (self.squares / self.on_surface.max(1) as f64).sqrt();
        Evidence { overlap, conflict, rmse_metres, color, texture, score, shape_score, margin: 0.0 }
    }
}

/// How near is near, and who is asked.
#[derive(Clone, Copy)]
struct Look {
    points: usize,
    width: f32,
    /// Points whose paint is compared.
    painted: usize,
    with_views: bool,
}

impl<'a> Judge<'a> {
    pub(super) fn new(
        a: &Prepared,
        b: &Prepared,
        views_a: &'a [PlacedView<'a>],
        views_b: &'a [PlacedView<'a>],
        cell: f32,
    ) -> Self {
        Self { halves: [Half::new(a, views_a, cell), Half::new(b, views_b, cell)] }
    }

    /// Quick and coarse: what lies about a centimetre off counts.
    pub(super) fn glance(&self, a_from_b: &Pose) -> f64 {
        let look = Look { points: GLANCE, width: 0.012, painted: 0, with_views: false };
        self.look(a_from_b, &look).evidence().shape_score
    }

    /// Without the views.
    pub(super) fn nearness(&self, a_from_b: &Pose) -> f64 {
        let look = Look { points: NEARNESS, width: 0.006, painted: NEARNESS, with_views: false };
        self.look(a_from_b, &look).evidence().score
    }

    /// All points and the paint, without the views: what changes when a placement slides along its surfaces.
    pub(super) fn closeness(&self, a_from_b: &Pose) -> f64 {
        let look = Look { points: usize::MAX, width: ON_SURFACE, painted: PAINTED, with_views: false };
        self.look(a_from_b, &look).evidence().score
    }

    /// All that is known.
    pub(super) fn evidence(&self, a_from_b: &Pose) -> Evidence {
        let look = Look { points: usize::MAX, width: ON_SURFACE, painted: PAINTED, with_views: true };
        self.look(a_from_b, &look).evidence()
    }

    fn look(&self, a_from_b: &Pose, look: &Look) -> Met {
        let [a, b] = &self.halves;
        a.meet(b, a_from_b, look).plus(&b.meet(a, &a_from_b.inverse(), look))
    }

    /// The second recording's points that lie on the first one's surface.
    pub(super) fn pairs(&self, a_from_b: &Pose) -> Vec<Row> {
        let [a, b] = &self.halves;
        let moved = a_from_b.cast::<f32>();
        (0..b.points.len())
            .filter_map(|i| {
                let (p, n) = b.moved(i, &moved);
                let (j, _) = a.on_surface(&p, &n, ON_SURFACE)?;
                let n = (n + Vector3::from(a.normals[j])).normalize();
                let distance = f64::from(n.dot(&(p.coords - Vector3::from(a.points[j]))));
                Some(Row { place: p.coords.cast(), along: n.cast(), distance })
            })
            .collect()
    }

    /// What the product stands on in either recording, as the other one measured it: its height above the board.
    pub(super) fn feet(&self, a_from_b: &Pose) -> Vec<Row> {
        let [a, b] = &self.halves;
        let of_b =
            b.dense.foot(a_from_b).map(|(place, distance)| Row { place, along: Vector3::z(), distance });
        // Its own board moves with the second recording: the first one's points move against it.
        let of_a = a.dense.foot(&a_from_b.inverse()).map(|(place, distance)| Row {
            place: (a_from_b * Point3::from(place)).coords,
            along: -(a_from_b.rotation * Vector3::z()),
            distance,
        });
        of_b.into_iter().chain(of_a).collect()
    }
}

impl<'a> Half<'a> {
    fn new(side: &Prepared, views: &'a [PlacedView<'a>], cell: f32) -> Self {
        Self {
            points: side.cloud.points.clone(),
            normals: side.cloud.normals.clone(),
            dense: side.dense.clone(),
            field: NearField::new(&side.cloud.points, 1, 0.5 * cell, 3.0 * cell),
            views: views.iter().map(|v| (v.world_from_camera.inverse(), v.geometry)).collect(),
            cell,
        }
    }

    fn moved(&self, i: usize, pose: &nalgebra::Isometry3<f32>) -> (Point3<f32>, Vector3<f32>) {
        (pose * Point3::from(self.points[i]), pose.rotation * Vector3::from(self.normals[i]))
    }

    /// How the other recording's points lie in this one; `pose` carries them into this frame.
    fn meet(&self, other: &Half<'_>, pose: &Pose, look: &Look) -> Met {
        let moved = pose.cast::<f32>();
        let step = (other.points.len() / look.points).max(1);
        let mut met = Met::default();
        for i in (0..other.points.len()).step_by(step) {
            met.all += 1;
            let (p, n) = other.moved(i, &moved);
            if let Some((_, off)) = self.on_surface(&p, &n, look.width) {
                met.on_surface += 1;
                met.fit += f64::from(1.0 - (off / look.width).powi(2));
                met.squares += f64::from(off * off);
            } else if p.z < UNDER - (look.width - ON_SURFACE)
                || (look.with_views && self.is_seen_through(&p.cast(), &n.cast()))
            {
                met.conflicts += 1;
            }
        }
        met.paint = self.dense.compare(&other.dense, &moved, look.painted);
        met
    }

    /// The point on whose tangent plane a place lies, facing the same way, and how far off the plane it is, metres.
    fn on_surface(&self, p: &Point3<f32>, n: &Vector3<f32>, width: f32) -> Option<(usize, f32)> {
        let j = self.field.nearest(&(*p).into())?;
        let (q, m) = (Vector3::from(self.points[j]), Vector3::from(self.normals[j]));
        if m.dot(n) < 0.7 {
            return None;
        }
        let between = p.coords - q;
        let off = m.dot(&between).abs();
        let across = (between.norm_squared() - off * off).max(0.0).sqrt();
        (off < width && across < 1.5 * self.cell).then_some((j, off))
    }

    /// Whether a camera that would see the place from its front looks through it onto something farther.
    fn is_seen_through(&self, p: &Point3<f64>, n: &Vector3<f64>) -> bool {
        self.views.iter().any(|(camera_from_world, view)| {
            let in_camera = camera_from_world * p;
            let facing = -(camera_from_world.rotation * n).dot(&in_camera.coords);
            facing > FACING * in_camera.coords.norm()
                && view.nearest_gap(&in_camera).is_some_and(|gap| gap > SEEN_THROUGH)
        })
    }
}
