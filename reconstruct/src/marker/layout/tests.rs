use super::*;
use crate::board::Family;
use crate::pose::log;

const SIZE: f64 = 0.096;

fn sheets() -> LooseSheets {
    let (family, layout) = (Family::ArucoOriginal, "unknown".to_owned());
    LooseSheets { version: 1, family, tag_size_m: SIZE, layout, ids: vec![3, 4, 30, 40, 50] }
}

fn camera() -> Intrinsics {
    Intrinsics::pinhole(640, 480, 550.0, 540.0, 316.0, 244.0)
}

/// Table from tag of five sheets.
fn true_places() -> Vec<(u32, Isometry2<f64>)> {
    let place = |x, y, yaw| Isometry2::new(Vector2::new(x, y), yaw);
    vec![
        (3, place(-0.2, 0.15, 0.3)),
        (4, place(0.02, -0.22, 1.6)),
        (30, place(0.2, -0.1, -0.4)),
        (40, place(-0.2, -0.1, 2.9)),
        (50, place(0.22, 0.13, -2.0)),
    ]
}

fn true_view(azimuth: f64) -> Pose {
    let eye = Point3::new(0.7 * f64::cos(azimuth), 0.7 * f64::sin(azimuth), 0.75);
    Pose::face_towards(&eye, &Point3::origin(), &-Vector3::z()).inverse()
}

/// What a view sees of the sheets with some ids.
fn see(ids: &[u32], azimuth: f64, noise_px: f64, seed: u64) -> Vec<Detection> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut noise = || noise_px * (rng.f64() + rng.f64() + rng.f64() + rng.f64() - 2.0) * 1.73;
    let pose = true_view(azimuth);
    let places = true_places();
    let seen = places.iter().filter(|p| ids.contains(&p.0));
    seen.map(|&(id, place)| Detection {
        id,
        corners: local_corners(SIZE).map(|c| {
            let p = place * c;
            let pixel = camera().project(&(pose * Point3::new(p.x, p.y, 0.0))).unwrap();
            Point2::new(pixel.x + noise(), pixel.y + noise())
        }),
        corner_sigma_px: [0.1; 4],
        bit_errors: 0,
        clarity: 1.0,
    })
    .collect()
}

fn place_all(views: &[Vec<Detection>]) -> Result<SheetLayout, LayoutError> {
    place_sheets(views, &sheets(), &camera(), &LayoutConfig::default())
}

/// Largest error of a distance between two corners of the layout, metres.
fn worst_distance_error(layout: &SheetLayout) -> f64 {
    let truth = true_places();
    let found: Vec<_> = layout.board.tags.iter().flat_map(|t| t.corners_m.map(Point3::from)).collect();
    let ids: Vec<u32> = layout.board.tags.iter().map(|t| t.id).collect();
    let truth: Vec<_> = truth
        .iter()
        .filter(|t| ids.contains(&t.0))
        .flat_map(|(_, place)| local_corners(SIZE).map(|c| place * c))
        .collect();
    let mut worst: f64 = 0.0;
    for i in 0..found.len() {
        for j in 0..i {
            worst = worst.max(((found[i] - found[j]).norm() - (truth[i] - truth[j]).norm()).abs());
        }
    }
    worst
}

#[test]
fn exact_corners_give_the_exact_layout_in_the_agreed_frame() {
    let views = [see(&[30, 40, 50], 0.0, 0.0, 0), see(&[4, 30], 0.9, 0.0, 0), see(&[3, 50], 2.0, 0.0, 0)];
    let layout = place_all(&views).unwrap();
    assert!(worst_distance_error(&layout) < 1e-7, "{}", worst_distance_error(&layout));
    assert!(layout.reprojection_px < 1e-4 && layout.rejected.is_empty());
    let centres: Vector3<f64> = layout
        .board
        .tags
        .iter()
        .map(|t| t.corners_m.iter().fold(Vector3::zeros(), |s, c| s + Vector3::from(*c)) / 4.0)
        .sum();
    assert!(centres.norm() < 1e-9, "the origin is the centres' centroid");
    let lowest = layout.board.tags[0];
    let x = Vector3::from(lowest.corners_m[1]) - Vector3::from(lowest.corners_m[0]);
    assert!(lowest.id == 3 && x.y.abs() < 1e-9 && x.x > 0.0, "x runs along the tag with the lowest id");
    for (k, azimuth) in [0.0, 0.9, 2.0].into_iter().enumerate() {
        let pose = layout.camera_from_board[k].unwrap();
        assert!(pose.inverse().translation.z > 0.7, "cameras are above the table");
        let turn = pose.inverse() * true_view(azimuth);
        assert!(log(&turn)[3].abs() + log(&turn)[4].abs() < 1e-6, "the table is level");
    }
    assert_eq!(layout.board.inner_region_m.len(), 5);
}

#[test]
fn noise_of_a_third_of_a_pixel_moves_sheets_by_millimetres_at_most() {
    let views: Vec<_> = (0..4).map(|k| see(&[3, 4, 30, 40, 50], 0.4 * f64::from(k), 0.3, k as u64)).collect();
    let layout = place_all(&views).unwrap();
    assert!(worst_distance_error(&layout) < 2e-3, "{}", worst_distance_error(&layout));
    assert!((0.2..0.6).contains(&layout.reprojection_px), "{}", layout.reprojection_px);
}

#[test]
fn a_wrong_tag_is_dropped_and_cut_corners_do_not_count() {
    let mut views: Vec<_> =
        (0..4).map(|k| see(&[3, 4, 30, 40, 50], 0.4 * f64::from(k), 0.1, k as u64)).collect();
    for c in &mut views[1][2].corners {
        c.x += 30.0;
    }
    views[2][0].corners[1].x += 40.0;
    views[2][0].corner_sigma_px[1] = f64::INFINITY;
    let unknown = Detection { id: 7, ..views[3][0] };
    views[3].push(unknown);
    let layout = place_all(&views).unwrap();
    assert_eq!(layout.rejected, [(3, 7, Rejection::NotOnBoard), (1, 30, Rejection::Disagrees)]);
    assert!(worst_distance_error(&layout) < 2e-3, "{}", worst_distance_error(&layout));
}

#[test]
fn every_bad_input_has_its_own_error() {
    assert_eq!(place_all(&[]), Err(LayoutError::NoTags));
    assert_eq!(place_all(&[vec![], see(&[30], 0.0, 0.0, 0)]), Err(LayoutError::OneTag(30)));
    let apart = [see(&[30], 0.0, 0.0, 0), see(&[40], 0.0, 0.0, 0)];
    assert_eq!(place_all(&apart), Err(LayoutError::NoLayout));
    let huge = LooseSheets { tag_size_m: f64::NAN, ..sheets() };
    let result = place_sheets(&apart, &huge, &camera(), &LayoutConfig::default());
    assert_eq!(result, Err(LayoutError::Unusable));
}
