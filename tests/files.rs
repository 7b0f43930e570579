//! Recordings and model files that nobody in this project made, and ours under other programs' eyes.

use std::fs::{self, File};
use std::io::{BufReader, Read};
use std::path::Path;
use std::process::Command;

use reconstruct::cloud::PointCloud;
use reconstruct::depth_to_color::Registration;
use reconstruct::image::{ColorImage, DepthImage};
use reconstruct::mesh::Mesh;
use reconstruct::model_file::{self, Kind, Limits, glb, ply};
use reconstruct::pose::Pose;
use scanner::import::{self, Options};
use scanner::pictures;
use scanner::recording::Recording;
use tests::shared;

/// Loads every view and checks what the images hold against what the data's description says.
#[track_caller]
fn check_recording(name: &str, views: usize, frames: usize, has_board: bool) {
    let Some(folder) = shared(name) else { return };
    let recording = Recording::open(&folder).unwrap();
    assert_eq!(recording.view_count(), views);
    assert_eq!(recording.board().is_some(), has_board);
    for i in 0..views {
        let view = recording.load_view(i).unwrap();
        assert_eq!(view.depths.len(), frames, "view {}", view.name);
        assert_eq!((view.color.width, view.color.height), (640, 480));
        let measured = view.depths[0].data.iter().filter(|&&raw| raw != 0).count();
        assert!(measured > 640 * 480 / 4, "view {}: {measured} pixels measured", view.name);
    }
}

#[test]
fn mustard() {
    check_recording("simulated/mustard-8views", 8, 5, true);
}

#[test]
fn stream_without_markers() {
    check_recording("simulated/drill-markerless-stream", 36, 1, false);
}

#[test]
fn juice_cartons() {
    check_recording("juice-cartons", 3, 1, true);
}

#[test]
fn living_room() {
    check_recording("livingroom", 211, 1, false);
}

#[test]
fn redwood() {
    check_recording("redwood", 5, 1, false);
}

/// The number of points a PCD file announces.
fn announced_points(path: &Path) -> usize {
    let mut start = vec![0; 1024];
    let count = File::open(path).unwrap().read(&mut start).unwrap();
    let text = String::from_utf8_lossy(&start[..count]);
    text.lines().find_map(|line| line.strip_prefix("POINTS ")).unwrap().trim().parse().unwrap()
}

fn read_model(path: &Path) -> Mesh {
    let kind = Kind::from_name(&path.to_string_lossy()).unwrap();
    model_file::read(kind, BufReader::new(File::open(path).unwrap()), &Limits::default()).unwrap()
}

#[test]
fn clouds_of_the_point_cloud_library() {
    let Some(folder) = shared("pcl") else { return };
    let mut read = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "pcd") {
            continue;
        }
        let cloud = read_model(&path).vertices;
        let announced = announced_points(&path);
        // Organised clouds announce their holes too.
        assert!(cloud.len() <= announced && cloud.len() > announced / 4, "{}: {announced}", path.display());
        assert!(cloud.colors.is_empty() || cloud.has_colors());
        read += 1;
    }
    assert!(read >= 9, "{read} clouds");
}

#[test]
fn the_milk_carton_is_read_in_full() {
    let Some(path) = shared("pcl/milk.pcd") else { return };
    assert_eq!(read_model(&path).vertices.len(), announced_points(&path));
}

#[test]
fn redwood_fragment_with_faces() {
    let Some(path) = shared("redwood/frag_115.ply") else { return };
    let mesh = read_model(&path);
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (64_365, 127_229));
    assert!(mesh.vertices.has_colors());
}

/// The shared real Kinect's cameras as Burrus published them for his unit, the turn of about a degree included.
fn kinect() -> Options {
    Options {
        color_camera: Some([529.215, 525.564, 328.943, 267.481]),
        depth_camera: Some([594.214, 591.041, 339.308, 242.739]),
        color_distortion: Some([0.2645, -0.8399, -0.0020, 0.0014, 0.9119]),
        depth_distortion: Some([-0.2639, 0.9997, -0.0008, 0.0050, -1.3054]),
        color_from_depth: Some(Pose::new(
            [0.0200, -0.0007, -0.0109].into(),
            [0.0123, -0.0175, -0.0014].into(),
        )),
        mirrored: true,
        every: 1,
        ..Options::default()
    }
}

/// Mean colour gradient at the near side of depth edges, the depth map shifted by `shift` columns.
fn edge_agreement(color: &ColorImage, depth: &DepthImage, shift: isize) -> f64 {
    let gray = color.to_gray();
    let (mut sum, mut count) = (0.0, 0.0);
    for y in 1..depth.height - 1 {
        for x in 12..depth.width - 12 {
            let i = y * depth.width + x;
            let (left, right) = (depth.data[i - 2], depth.data[i + 2]);
            if depth.data[i] == 0 || left == 0 || right == 0 || left.abs_diff(right) < 100 {
                continue;
            }
            let at = |dx: isize| i32::from(gray.data[(i as isize + shift + dx) as usize]);
            sum += f64::from((at(2) - at(-2)).abs());
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

fn best_shift(color: &ColorImage, depth: &DepthImage) -> isize {
    (-10..=10)
        .max_by(|&a, &b| edge_agreement(color, depth, a).total_cmp(&edge_agreement(color, depth, b)))
        .unwrap()
}

/// A picture of depth edges over colours, where `SCAN_PICTURES_DIR` asks for it.
fn save_overlay(name: &str, color: &ColorImage, depth: &DepthImage) {
    let Some(folder) = std::env::var_os("SCAN_PICTURES_DIR") else { return };
    let mut picture = color.clone();
    for i in 2..depth.data.len() - 2 {
        let (left, right) = (depth.data[i - 1], depth.data[i + 1]);
        if left.abs_diff(right) > 60 {
            picture.data[i] = [255, 0, 0];
        }
    }
    fs::write(Path::new(&folder).join(name), pictures::encode_color(&picture).unwrap()).unwrap();
}

#[test]
fn depth_of_a_real_kinect_is_registered_to_colour() {
    let Some(folder) = shared("kinect1-products") else { return };
    let out = tempfile::tempdir().unwrap();
    let source = import::read(import::Kind::Pairs, &folder).unwrap();
    import::write(&source, &kinect(), out.path(), || ()).unwrap();
    let recording = Recording::open(out.path()).unwrap();
    assert_eq!(recording.view_count(), 22);
    let registration = Registration::new(&recording.rig());
    let mut shifts = Vec::new();
    for (i, name) in recording.view_names().iter().enumerate().filter(|(_, name)| name.starts_with("boxes")) {
        let view = recording.load_view(i).unwrap();
        let registered = registration.register_image(&view.depths[0]);
        save_overlay(&format!("{name}-registered.png"), &view.color, &registered);
        save_overlay(&format!("{name}-raw.png"), &view.color, &view.depths[0]);
        shifts.push((best_shift(&view.color, &registered), best_shift(&view.color, &view.depths[0])));
    }
    println!("columns to the best agreement of edges, registered and raw: {shifts:?}");
    assert!(shifts.len() == 5 && shifts.iter().all(|(registered, _)| registered.abs() <= 4), "{shifts:?}");
}

/// Points and a mesh with every attribute.
fn models() -> Vec<Mesh> {
    let on_sphere = |i: usize| {
        let z = 1.0 - (i as f32 + 0.5) / 100.0;
        let (r, angle) = ((1.0 - z * z).sqrt(), 2.399_963 * i as f32);
        [r * angle.cos(), r * angle.sin(), z]
    };
    let normals: Vec<[f32; 3]> = (0..200).map(on_sphere).collect();
    let points: Vec<[f32; 3]> = normals.iter().map(|n| n.map(|v| v * 0.07)).collect();
    let colors = (0..200).map(|i| [i as u8, 255 - i as u8, 77]).collect();
    let bare = PointCloud { points, ..PointCloud::default() };
    let full = PointCloud { colors, normals, ..bare.clone() };
    let triangles = (0..198).map(|i| [i, i + 1, i + 2]).collect();
    vec![
        Mesh::of_points(bare),
        Mesh::of_points(full.clone()),
        Mesh { vertices: full, triangles, ..Mesh::default() },
    ]
}

#[test]
fn glb_files_satisfy_the_khronos_validator() {
    let checker = Path::new(env!("CARGO_MANIFEST_DIR")).join("gltf");
    if !checker.join("node_modules").is_dir() {
        let required = std::env::var("SCAN_REQUIRE_SHARED").is_ok_and(|v| v == "1");
        assert!(!required, "run `npm ci` in {}", checker.display());
        println!("skipped: run `npm ci` in {}", checker.display());
        return;
    }
    let out = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    for (i, mesh) in models().iter().enumerate() {
        let path = out.path().join(format!("{i}.glb"));
        glb::write(mesh, File::create(&path).unwrap()).unwrap();
        files.push(path);
    }
    let said = Command::new("node").arg(checker.join("check.mjs")).args(&files).output().unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stdout));
}

#[test]
fn a_model_is_imported_with_all_its_files() {
    let out = tempfile::tempdir().unwrap();
    let path = out.path().join("in.ply");
    ply::write(&models()[2], File::create(&path).unwrap()).unwrap();
    let mesh = import::model::read(&path).unwrap();
    let report = import::model::report(&mesh, "in.ply", &[]);
    scanner::result::write(&out.path().join("out"), &mesh, &report).unwrap();
    for name in ["model.asc", "model.ply", "model.glb"] {
        let back = read_model(&out.path().join("out").join(name));
        assert_eq!(back.vertices.len(), 200, "{name}");
        assert_eq!(back.vertices.colors, models()[2].vertices.colors, "{name}");
    }
    let poster = fs::read(out.path().join("out/poster.png")).unwrap();
    assert!(poster.len() <= scanner::result::POSTER_BYTES);
    assert_eq!(pictures::decode_color_of_any_size(&poster).unwrap().width, 640);
}
