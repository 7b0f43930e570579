//! Markers on shared recordings and photographs: corners against truth, right ids, no wrong ids, loose sheets.

use std::path::{Path, PathBuf};

use nalgebra::{Point2, Point3, Vector2};
use reconstruct::board::{BoardFile, Family};
use reconstruct::image::{DepthImage, GrayImage};
use reconstruct::marker::{
    DetectConfig, Detection, Dictionary, LayoutConfig, PoseConfig, SheetLayout, board_pose, detect,
    place_sheets,
};
use scanner::pictures::decode_color_of_any_size;
use scanner::recording::Recording;
use tests::corners::{KnownTruth, median, median_length, rms};
use tests::shared;

fn picture(path: &Path) -> GrayImage {
    let bytes = std::fs::read(path).unwrap();
    decode_color_of_any_size(&bytes).unwrap().to_gray()
}

fn find(image: &GrayImage, family: Family) -> Vec<Detection> {
    detect(image, Dictionary::of(family), None, &DetectConfig::default())
}

fn ids(detections: &[Detection]) -> Vec<u32> {
    detections.iter().map(|d| d.id).collect()
}

/// Corners and poses of a simulated recording against its truth. OpenCV's sub-pixel corners are at 0.33 to 0.41 px here.
#[track_caller]
fn check_recording(name: &str) {
    let Some(folder) = shared(name) else { return };
    let truth = KnownTruth::open(&folder).unwrap();
    let (mut errors, mut metres, mut degrees) = (Vec::new(), Vec::new(), Vec::new());
    for view in 0..truth.world_from_camera.len() {
        let seen = truth.measure(view);
        assert!(seen.wrong_ids.is_empty(), "view {view}: {:?}", seen.wrong_ids);
        assert!(2 * seen.errors.len() >= 4 * seen.in_picture, "view {view}: half of the tags are in sight");
        errors.extend(seen.errors);
        let pose =
            board_pose(&seen.detections, &truth.board, &truth.camera(), &PoseConfig::default()).unwrap();
        let world_from_camera = pose.camera_from_board.inverse();
        let off = world_from_camera.inverse() * truth.world_from_camera[view];
        // At the product, not at the camera: that is what moves points.
        let product = Point3::new(0.0, 0.0, 0.06);
        let true_place = truth.world_from_camera[view].inverse() * product;
        metres.push((world_from_camera * true_place - product).norm());
        degrees.push(off.rotation.angle().to_degrees());
        assert!(pose.alternative.is_none() && pose.reprojection_px < 0.3, "view {view}: {pose:?}");
    }
    println!(
        "{name}: corners median {:.3} px, rms {:.3} px; poses median {:.3} mm, {:.4} degrees",
        median_length(&errors),
        rms(&errors),
        1e3 * median(metres.clone()),
        median(degrees.clone())
    );
    assert!(median_length(&errors) < 0.1 && rms(&errors) < 0.2);
    assert!(median(metres) < 2e-4 && median(degrees) < 0.03);
}

#[test]
fn corners_of_simulated_recordings() {
    check_recording("simulated/mustard-8views");
    check_recording("simulated/mug-12views");
    check_recording("simulated/can-8views-tag36h11");
    check_recording("simulated/crackerbox-view3-knocked");
}

#[test]
fn photographs_of_aruco_boards() {
    let Some(folder) = shared("markers/aruco") else { return };
    let check = |name: &str, expected: &[u32]| {
        let found = ids(&find(&picture(&folder.join(name)), Family::Aruco6x6_250));
        assert_eq!(found, expected, "{name}");
    };
    let board: Vec<u32> = (0..17).collect();
    for name in ["img_00.jpg", "img_01.jpg", "img_02.jpg", "img_03.jpg", "charucoboard.png"] {
        check(name, &board);
    }
    // An object lies on the others.
    check("chocclusion_original.jpg", &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 15]);
    for name in ["singlemarkersoriginal.jpg", "singlemarkerssource.png"] {
        check(name, &[23, 40, 62, 98, 124, 203]);
    }
    check("board.png", &(0..35).collect::<Vec<_>>());
}

/// Centres of the tags that the reference detector found: `id, (x y), (x y), (x y), (x y)` a line.
fn reference_centres(path: &Path) -> Vec<(u32, Point2<f64>)> {
    let line = |text: &str| {
        let numbers: Vec<f64> = text.split([' ', ',', '(', ')']).filter_map(|n| n.parse().ok()).collect();
        let sum =
            (0..4).fold(Vector2::zeros(), |s, k| s + Vector2::new(numbers[1 + 2 * k], numbers[2 + 2 * k]));
        (numbers[0] as u32, Point2::from(sum / 4.0))
    };
    std::fs::read_to_string(path).unwrap().lines().filter(|l| !l.is_empty()).map(line).collect()
}

#[test]
fn photographs_of_small_april_tags() {
    let Some(folder) = shared("markers/apriltag") else { return };
    for name in ["33369213973_9d9bb4cc96_c", "34085369442_304b6bafd9_c", "34139872896_defdb2f8d9_c"] {
        let found = find(&picture(&folder.join(name).with_extension("jpg")), Family::Tag36h11);
        assert!(
            found.iter().all(|d| d.id == 0),
            "{name}: every tag in the picture has id 0: {:?}",
            ids(&found)
        );
        for (id, centre) in reference_centres(&folder.join(name).with_extension("txt")) {
            let near = found.iter().any(|d| d.id == id && (d.centre() - centre).norm() < 4.0);
            assert!(near, "{name}: the tag at {centre} is missing");
        }
    }
}

/// Colour pictures of a folder, by name.
fn pictures_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let mut paths: Vec<PathBuf> = entries
        .filter(|p| p.extension().is_some_and(|e| e == "png" || e == "jpg"))
        .filter(|p| !p.to_string_lossy().contains("depth"))
        .collect();
    paths.sort();
    paths
}

#[test]
fn no_ids_where_there_are_no_markers() {
    let folders = [
        "kinect1-products",
        "redwood/RGBD/color",
        "livingroom/image",
        "simulated/drill-markerless-stream/color",
    ];
    for folder in folders.into_iter().filter_map(shared) {
        let paths = pictures_in(&folder);
        assert!(!paths.is_empty(), "{} has pictures", folder.display());
        for path in paths {
            let image = picture(&path);
            for family in Family::ALL {
                let found = find(&image, family);
                assert!(found.is_empty(), "{}: {family:?} {:?}", path.display(), ids(&found));
            }
        }
    }
}

/// Detections of all views of the real recording on loose sheets, and their layout.
fn juice_cartons() -> Option<(Recording, Vec<Vec<Detection>>, SheetLayout)> {
    let recording = Recording::open(&shared("juice-cartons")?).unwrap();
    let Some(BoardFile::Loose(sheets)) = recording.board() else { panic!("its sheets are loose") };
    let camera = recording.rig().color;
    let views: Vec<Vec<Detection>> = (0..recording.view_count())
        .map(|v| find(&recording.load_view(v).unwrap().color.to_gray(), Family::ArucoOriginal))
        .collect();
    let layout = place_sheets(&views, sheets, &camera, &LayoutConfig::default()).unwrap();
    Some((recording, views, layout))
}

#[test]
fn loose_sheets_of_a_real_recording_are_placed() {
    let Some((_, views, layout)) = juice_cartons() else { return };
    assert_eq!(
        views.iter().map(|v| ids(v)).collect::<Vec<_>>(),
        [vec![4, 30, 40, 50], vec![30, 40, 50], vec![30, 40, 50]]
    );
    println!("loose sheets: {:.3} px rms", layout.reprojection_px);
    assert!(layout.rejected.is_empty() && layout.reprojection_px < 0.6, "{}", layout.reprojection_px);
    assert_eq!(layout.board.tags.iter().map(|t| t.id).collect::<Vec<_>>(), [4, 30, 40, 50]);
    assert!(layout.camera_from_board.iter().all(Option::is_some));
    assert!(
        layout.board.tags.iter().flat_map(|t| t.corners_m).all(|c| c[2] == 0.0),
        "sheets lie on one table"
    );
}

/// Depth pixels inside a tag's square, as (pixel, metres).
fn depth_inside(corners: &[Point2<f64>; 4], depth: &DepthImage) -> Vec<(Point2<f64>, f64)> {
    let inside =
        |p: &Point2<f64>| (0..4).all(|k| (corners[(k + 1) % 4] - corners[k]).perp(&(p - corners[k])) > 0.0);
    let range = |pick: fn(&Point2<f64>) -> f64, limit: usize| {
        let low = corners.iter().map(pick).fold(f64::INFINITY, f64::min).max(0.0) as usize;
        let high = corners.iter().map(pick).fold(0.0, f64::max).min(limit as f64 - 1.0) as usize;
        low..=high
    };
    let mut found = Vec::new();
    for v in range(|p| p.y, depth.height) {
        for u in range(|p| p.x, depth.width) {
            let pixel = Point2::new(u as f64, v as f64);
            if let Some(z) = depth.metres(u, v).filter(|_| inside(&pixel)) {
                found.push((pixel, f64::from(z)));
            }
        }
    }
    found
}

/// What depth says about the layout: it is not used for it, so this is an independent check.
#[test]
fn loose_sheets_agree_with_depth() {
    let Some((recording, views, layout)) = juice_cartons() else { return };
    let camera = recording.rig().color;
    for (v, detections) in views.iter().enumerate() {
        let depth = &recording.load_view(v).unwrap().depths[0];
        let camera_from_board = layout.camera_from_board[v].unwrap();
        let mut scales = Vec::new();
        for d in detections {
            let normal = camera_from_board.rotation * nalgebra::Vector3::z();
            let offset = normal.dot(&camera_from_board.translation.vector);
            let points = depth_inside(&d.corners, depth);
            assert!(points.len() > 200, "view {v} tag {}: {} pixels with depth", d.id, points.len());
            let on_table = |p: &Point2<f64>| offset / normal.dot(&camera.unproject(p, 1.0).coords);
            scales.push(median(points.iter().map(|(p, z)| z / on_table(p)).collect()));
        }
        let scale = median(scales.clone());
        println!("view {v}: depth / size {scale:.4}, a tag each {scales:.4?}");
        assert!((scale - 1.0).abs() < 0.02, "view {v}: depth is {scale} of what the tag size says");
    }
}

/// The point nearest to the rays (camera centre, direction), all in one frame.
fn nearest_to_rays(rays: &[(nalgebra::Vector3<f64>, nalgebra::Vector3<f64>)]) -> nalgebra::Vector3<f64> {
    let (mut lhs, mut rhs) = (nalgebra::Matrix3::zeros(), nalgebra::Vector3::zeros());
    for (centre, direction) in rays {
        let direction = direction.normalize();
        let across = nalgebra::Matrix3::identity() - direction * direction.transpose();
        lhs += across;
        rhs += across * centre;
    }
    lhs.try_inverse().expect("the rays are not parallel") * rhs
}

/// The layout holds the sheets to one table. Whether they lie on one is asked of the views alone: each corner that
/// several views see is intersected from its rays, free to lie at any height. Single corners curl; a sheet is their mean.
#[test]
fn loose_sheets_are_flat_without_being_held_flat() {
    let Some((recording, views, layout)) = juice_cartons() else { return };
    let camera = recording.rig().color;
    let mut checked = 0;
    for tag in &layout.board.tags {
        let heights: Vec<f64> = (0..4)
            .filter_map(|corner| {
                let rays: Vec<_> = views
                    .iter()
                    .zip(&layout.camera_from_board)
                    .filter_map(|(detections, pose)| {
                        let seen = detections.iter().find(|d| d.id == tag.id)?;
                        let board_from_camera = (*pose)?.inverse();
                        let ray = camera.unproject(&seen.corners[corner], 1.0).coords;
                        Some((board_from_camera.translation.vector, board_from_camera.rotation * ray))
                    })
                    .collect();
                (rays.len() >= 2).then(|| nearest_to_rays(&rays).z)
            })
            .collect();
        if heights.is_empty() {
            continue; // Seen once: nothing says how high it lies.
        }
        let millimetres: Vec<f64> = heights.iter().map(|z| z * 1000.0).collect();
        println!("tag {}: corners {millimetres:.2?} mm above the table", tag.id);
        let mean = millimetres.iter().sum::<f64>() / millimetres.len() as f64;
        println!("   the sheet: {mean:.2} mm");
        assert!(mean.abs() < 3.0, "tag {}: {mean} mm above the table, corners {millimetres:.2?}", tag.id);
        checked += 1;
    }
    assert_eq!(checked, 3, "three sheets are seen by several views");
}
