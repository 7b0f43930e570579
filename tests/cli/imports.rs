//! Other programs' folders and models become recordings and results; a recording keeps its model whichever way its pictures lie.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use reconstruct::cloud::PointCloud;
use reconstruct::image::DepthImage;
use reconstruct::mesh::Mesh;
use reconstruct::mesh::topology::{Defects, borders, defects};
use reconstruct::model_file::Limits;
use scanner::pictures::{decode_depth, encode_depth};
use tempfile::TempDir;

use super::support::{
    RESULT, Ran, asc_points, build, bytes_of, copy, json, mug, mug_model, names, nothing_half_written, scan,
    simulated,
};

/// Distances in millimetres from every tenth point of `a` to the nearest point of `b`: all of it, and its part across the
/// surface. Points lie about a millimetre apart, so that only the part across tells whether the surfaces differ.
fn distances(a: &PointCloud, b: &PointCloud) -> Vec<[f32; 2]> {
    let off = |p: &[f32; 3], q: &[f32; 3]| -> [f32; 3] { std::array::from_fn(|k| 1000.0 * (p[k] - q[k])) };
    let dot = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f32>();
    let nearest = |p: &[f32; 3]| {
        let squared = b.points.iter().map(|q| dot(&off(p, q), &off(p, q)));
        let (i, squared) = squared.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        [squared.sqrt(), dot(&off(p, &b.points[i]), &b.normals[i]).abs()]
    };
    a.points.iter().step_by(10).map(nearest).collect()
}

/// Both ways 95 of 100 points lie within a millimetre of the other model's surface, the middle one much nearer, and all but
/// one in a hundred have a point of it within three.
#[track_caller]
fn check_same_model(a: &Path, b: &Path) {
    let model = |folder: &Path| {
        let bytes = fs::read(folder.join("model.ply")).unwrap();
        reconstruct::model_file::ply::read(bytes.as_slice(), &Limits::default()).unwrap().vertices
    };
    let (a, b) = (model(a), model(b));
    assert!(a.len() > 5000 && b.len() > 5000, "{} and {} points", a.len(), b.len());
    for (a, b) in [(&a, &b), (&b, &a)] {
        let distances = distances(a, b);
        let share = |k: usize, most: f32| {
            distances.iter().filter(|d| d[k] < most).count() as f64 / distances.len() as f64
        };
        let (near, middle, surface) = (share(0, 3.0), share(1, 0.4), share(1, 1.0));
        assert!(
            near > 0.99 && middle > 0.5 && surface > 0.95,
            "{near} have a point within 3 mm, {middle} the surface within 0.4 mm, {surface} within 1 mm"
        );
    }
}

/// Another program's folder beside what is made of it.
struct Foreign {
    home: TempDir,
}

impl Foreign {
    fn new() -> Self {
        let foreign = Self { home: tempfile::tempdir().unwrap() };
        fs::create_dir(foreign.folder()).unwrap();
        foreign
    }

    fn folder(&self) -> PathBuf {
        self.home.path().join("foreign")
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.folder().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }

    fn import(&self, more: &[&str]) -> Ran {
        let (folder, rec) = (self.folder(), self.home.path().join("rec"));
        let fixed = ["import", folder.to_str().unwrap(), "--out", rec.to_str().unwrap()];
        scan(fixed.iter().chain(more))
    }

    /// Imports, puts the board beside, builds, and compares with the model of the recording itself.
    #[track_caller]
    fn gives_the_mug(&self, more: &[&str]) {
        self.import(more).with_status(0);
        let rec = self.home.path().join("rec");
        fs::copy(mug().join("board.json"), rec.join("board.json")).unwrap();
        let out = self.home.path().join("out");
        let ran = build(&rec, &out, &[]).with_status(0);
        assert!(ran.out.contains("from 4 of 4 views"), "{}", ran.out);
        check_same_model(&out, mug_model());
        nothing_half_written(self.home.path());
    }
}

/// Colour and first depth picture of a view of the mug, with depth in other units and another value for "none".
fn pair(view: usize, factor: u16, none: u16) -> (Vec<u8>, Vec<u8>) {
    let color = fs::read(mug().join(format!("color/{view:06}.png"))).unwrap();
    let depth = fs::read(mug().join(format!("depth/{:06}.png", 2 * view))).unwrap();
    let mut depth = decode_depth(&depth, 640, 480, 1000.0).unwrap();
    depth.data.iter_mut().for_each(|raw| *raw = if *raw == 0 { none } else { raw.saturating_mul(factor) });
    (color, encode_depth(&depth).unwrap())
}

#[test]
fn a_tum_folder() {
    let foreign = Foreign::new();
    let (mut rgb_list, mut depth_list) = ("# color\n".to_owned(), "# depth\n".to_owned());
    for view in 0..4 {
        let (color, depth) = pair(view, 5, 0);
        foreign.write(&format!("rgb/{view}.png"), color);
        foreign.write(&format!("depth/{view}.png"), depth);
        writeln!(rgb_list, "{view}.01 rgb/{view}.png").unwrap();
        writeln!(depth_list, "{view}.02 depth/{view}.png").unwrap();
    }
    foreign.write("rgb.txt", rgb_list);
    foreign.write("depth.txt", depth_list);
    foreign.gives_the_mug(&["--stream", "false"]);
}

#[test]
fn a_seven_scenes_folder() {
    let foreign = Foreign::new();
    for view in 0..4 {
        let (color, depth) = pair(view, 1, u16::MAX);
        foreign.write(&format!("frame-{view:06}.color.png"), color);
        foreign.write(&format!("frame-{view:06}.depth.png"), depth);
    }
    foreign.gives_the_mug(&["--stream", "false", "--color-camera", "525,525,319.5,239.5"]);
}

#[test]
fn a_bop_scene_folder() {
    let foreign = Foreign::new();
    let mut cameras = serde_json::Map::new();
    for view in 0..4 {
        let (color, depth) = pair(view, 10, 0);
        foreign.write(&format!("rgb/{view:06}.png"), color);
        foreign.write(&format!("depth/{view:06}.png"), depth);
        let matrix = [525.0, 0.0, 319.5, 0.0, 525.0, 239.5, 0.0, 0.0, 1.0];
        cameras.insert(view.to_string(), serde_json::json!({"cam_K": matrix, "depth_scale": 0.1}));
    }
    foreign.write("scene_camera.json", serde_json::Value::from(cameras).to_string());
    foreign.gives_the_mug(&[]);
}

#[test]
fn plain_folders_of_pairs() {
    let foreign = Foreign::new();
    for view in 0..4 {
        let (color, depth) = pair(view, 1, 0);
        foreign.write(&format!("rgb/{view}.png"), color);
        foreign.write(&format!("depth/{view}.png"), depth);
    }
    let no_camera = foreign.import(&[]).with_status(2);
    assert!(no_camera.err.contains("--color-camera fx,fy,cx,cy"), "{}", no_camera.err);
    assert_eq!(names(foreign.home.path()), ["foreign"]);
    foreign.gives_the_mug(&["--color-camera", "525,525,319.5,239.5"]);
}

#[test]
fn pairs_that_do_not_pair() {
    let foreign = Foreign::new();
    for view in 0..3 {
        let (color, depth) = pair(view, 1, 0);
        foreign.write(&format!("{view}_rgb.png"), color);
        if view != 1 {
            foreign.write(&format!("{view}_depth.png"), depth);
        }
    }
    let ran = foreign.import(&["--color-camera", "525,525,319.5,239.5"]).with_status(2);
    assert!(ran.err.contains("3 colour and 2 depth pictures"), "{}", ran.err);
    assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
    assert_eq!(names(foreign.home.path()), ["foreign"]);
}

#[test]
fn a_broken_picture_stops_the_import() {
    let foreign = Foreign::new();
    let (color, depth) = pair(0, 1, 0);
    foreign.write("0_rgb.png", color);
    foreign.write("0_depth.png", &depth[..depth.len() / 2]);
    let ran = foreign.import(&["--color-camera", "525,525,319.5,239.5"]).with_status(2);
    assert!(ran.err.contains("0_depth.png") && ran.err.contains("cut off"), "{}", ran.err);
    assert_eq!(names(foreign.home.path()), ["foreign"]);
}

#[test]
fn a_folder_of_nothing_known() {
    let foreign = Foreign::new();
    foreign.write("letter.txt", "Dear Sir or Madam");
    let ran = foreign.import(&[]).with_status(2);
    assert!(ran.err.contains("TUM, BOP or 7-Scenes"), "{}", ran.err);
    assert_eq!(names(foreign.home.path()), ["foreign"]);
}

/// The source's own `color` and `depth` would be replaced by what is made of them.
#[test]
fn nothing_is_imported_onto_itself() {
    let foreign = Foreign::new();
    let (color, depth) = pair(0, 1, 0);
    foreign.write("color/a.png", color);
    foreign.write("depth/a.png", depth);
    let folder = foreign.folder();
    let folder = folder.to_str().unwrap();
    let ran =
        scan(["import", folder, "--out", folder, "--color-camera", "525,525,319.5,239.5"]).with_status(2);
    assert!(ran.err.contains("another folder"), "{}", ran.err);
    assert_eq!(names(&foreign.folder().join("color")), ["a.png"]);
    nothing_half_written(foreign.home.path());
}

#[test]
fn a_model_comes_back_from_each_of_its_files() {
    let points = asc_points(&mug_model().join("model.asc"));
    for name in ["model.asc", "model.ply", "model.glb"] {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        let model = mug_model().join(name);
        let ran = scan(["import", model.to_str().unwrap(), "--out", out.to_str().unwrap()]).with_status(0);
        assert!(ran.out.contains(&format!("{} points", points.len())), "{}", ran.out);
        assert!(names(&out).contains(&"report.json".to_owned()));
        let back = asc_points(&out.join("model.asc"));
        assert_eq!(back.len(), points.len());
        for (p, q) in points.iter().zip(&back) {
            assert!((0..3).all(|k| (p[k] - q[k]).abs() < 0.0021), "{name}: {p:?} became {q:?}");
        }
        assert_eq!(json(&out.join("report.json"))["points"], points.len());
        nothing_half_written(home.path());
    }
}

#[test]
fn an_asc_comes_back_byte_for_byte() {
    let home = tempfile::tempdir().unwrap();
    let model = mug_model().join("model.asc");
    let ran = scan(["import", model.to_str().unwrap(), "--out", home.path().to_str().unwrap()]);
    ran.with_status(0);
    assert!(bytes_of(home.path())["model.asc"] == fs::read(model).unwrap());
}

#[test]
fn models_that_are_none() {
    let files: [(&str, &[u8]); 6] = [
        ("a.asc", b"1 2 3\nhello\n"),
        ("b.asc", b""),
        ("c.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 1000000000\nproperty float x\nend_header\n"),
        ("d.glb", b"glTF\x02\0\0\0\xff\xff\xff\xff"),
        ("e.pcd", b"VERSION .7\nPOINTS -1\n"),
        ("f.stl", b"solid\n"),
    ];
    for (name, bytes) in files {
        let foreign = Foreign::new();
        foreign.write(name, bytes);
        let (model, out) = (foreign.folder().join(name), foreign.home.path().join("out"));
        let ran = scan(["import", model.to_str().unwrap(), "--out", out.to_str().unwrap()]).with_status(2);
        assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
        assert!(ran.err.contains(name), "{}", ran.err);
        assert_eq!(names(foreign.home.path()), ["foreign"], "{name}");
    }
}

#[test]
fn coordinates_without_a_number() {
    for word in ["nan", "inf", "-inf", "1e400"] {
        let foreign = Foreign::new();
        foreign.write("a.asc", format!("0 0 0 1 2 3\n1 {word} 0 1 2 3\n"));
        let (model, out) = (foreign.folder().join("a.asc"), foreign.home.path().join("out"));
        let ran = scan(["import", model.to_str().unwrap(), "--out", out.to_str().unwrap()]).with_status(2);
        assert!(ran.err.contains("line 2"), "{}", ran.err);
        assert_eq!(names(foreign.home.path()), ["foreign"]);
    }
}

/// Points of an upright egg, 60 mm wide and 90 mm high, in millimetres and without normals; `below` keeps them so low.
fn egg(count: usize, keep: impl Fn(f32) -> bool) -> String {
    let mut text = String::new();
    for i in 0..count {
        let z = 1.0 - (2 * i + 1) as f32 / count as f32;
        let (s, c) = (2.399_963_2 * i as f32).sin_cos();
        let flat = 30.0 * (1.0 - z * z).sqrt();
        if keep(45.0 * z) {
            writeln!(text, "{:.3} {:.3} {:.3} 200 100 50", flat * c, flat * s, 45.0 * z).unwrap();
        }
    }
    text
}

/// Runs `import --surface poisson` on points; gives the model and the words.
fn surface_of(points: &str, more: &[&str]) -> (Mesh, Ran) {
    let foreign = Foreign::new();
    foreign.write("cloud.asc", points);
    let (cloud, out) = (foreign.folder().join("cloud.asc"), foreign.home.path().join("out"));
    let fixed = ["import", cloud.to_str().unwrap(), "--out", out.to_str().unwrap(), "--surface", "poisson"];
    let ran = scan(fixed.iter().chain(more)).with_status(0);
    assert_eq!(names(&out), RESULT);
    let bytes = fs::read(out.join("model.ply")).unwrap();
    let mesh = reconstruct::model_file::ply::read(bytes.as_slice(), &Limits::default()).unwrap();
    let told = &json(&out.join("report.json"))["warnings"];
    for warning in ran.complaints() {
        let words = warning.strip_prefix("warning: ").unwrap();
        assert!(told.as_array().unwrap().iter().any(|w| w == words), "{words} is not in {told}");
    }
    nothing_half_written(foreign.home.path());
    (mesh, ran)
}

#[test]
fn a_cloud_becomes_a_closed_surface() {
    let (mesh, ran) = surface_of(&egg(20_000, |_| true), &["--depth", "7"]);
    assert!(borders(&mesh.triangles).is_empty());
    assert_eq!(defects(&mesh), Defects::default());
    assert!(ran.complaints().is_empty(), "{}", ran.err);
    let (low, high) = mesh.vertices.bounds().unwrap();
    for (k, size) in [0.06, 0.06, 0.09].into_iter().enumerate() {
        assert!((high[k] - low[k] - size).abs() < 0.0006, "{} along {k}", high[k] - low[k]);
    }
    let facing = mesh.triangles.iter().map(|t| {
        let [x, y, z] = mesh.vertices.points[t[0] as usize].map(f64::from);
        mesh.twice_area_vector(t).dot(&nalgebra::Vector3::new(x, y, z))
    });
    let volume = facing.sum::<f64>() / 6.0;
    assert!(
        (volume / (4.0 / 3.0 * std::f64::consts::PI * 0.03 * 0.03 * 0.045) - 1.0).abs() < 0.02,
        "{volume}"
    );
    assert!(mesh.vertices.colors.iter().all(|c| *c == [200, 100, 50]));
    assert_eq!(mesh.measured_count(), mesh.vertices.len());
}

#[test]
fn what_no_point_is_near_is_marked_and_told() {
    let (mesh, ran) = surface_of(&egg(20_000, |z| z > -20.0), &["--depth", "7"]);
    assert!(borders(&mesh.triangles).is_empty());
    let said = ran.complaints();
    assert!(said.len() == 1 && said[0].contains("% of the surface is invented"), "{}", ran.err);
    let invented = (0..mesh.vertices.len()).filter(|&v| mesh.is_invented(v));
    let invented: Vec<f32> = invented.map(|v| mesh.vertices.points[v][2]).collect();
    // The egg ends at -20 mm; what closes it may be hollow by a third of the opening's radius.
    assert!(invented.len() > 500 && invented.iter().all(|z| *z < -0.010), "{}", invented.len());
}

#[test]
fn clouds_that_have_no_surface() {
    let lines: Vec<String> = (0..200).map(|i| format!("{i} 0 0 1 2 3")).collect();
    let line = lines.join("\n");
    for (points, words) in [
        ("0 0 0 1 2 3\n1 0 0 1 2 3\n0 1 0 1 2 3\n", "3 points have a place and a normal"),
        (&"5 5 5 1 2 3\n".repeat(100), "0 points have a place and a normal"),
        (&line, "0 points have a place and a normal"),
    ] {
        let foreign = Foreign::new();
        foreign.write("cloud.asc", points);
        let (cloud, out) = (foreign.folder().join("cloud.asc"), foreign.home.path().join("out"));
        let arguments = ["import", cloud.to_str().unwrap(), "--surface", "poisson", "--out"];
        let ran = scan(arguments.into_iter().chain([out.to_str().unwrap()])).with_status(2);
        assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
        assert!(ran.err.contains("cloud.asc") && ran.err.contains(words), "{}", ran.err);
        assert_eq!(names(foreign.home.path()), ["foreign"]);
    }
    let foreign = Foreign::new();
    let ran = foreign.import(&["--surface", "poisson"]).with_status(2);
    assert!(ran.err.contains("--surface is for models"), "{}", ran.err);
}

#[test]
fn mirrored_pictures_give_the_same_model() {
    let options = ["--product", "mug", "--views", "4", "--frames", "2", "--mirrored"];
    check_stored_otherwise("mirrored", &options);
}

#[test]
fn depth_of_its_own_camera_gives_the_same_model() {
    let options = ["--product", "mug", "--views", "4", "--frames", "2", "--unregistered"];
    check_stored_otherwise("unregistered", &options);
}

#[track_caller]
fn check_stored_otherwise(name: &str, options: &[&str]) {
    let rec = simulated(name, options);
    let home = tempfile::tempdir().unwrap();
    let ran = build(&rec, home.path(), &[]).with_status(0);
    assert!(ran.out.contains("from 4 of 4 views"), "{}", ran.out);
    check_same_model(home.path(), mug_model());
}

/// Flipping the stored pictures and saying so changes nothing at all.
#[test]
fn the_mirror_is_exact() {
    let home = tempfile::tempdir().unwrap();
    let rec = home.path().join("rec");
    copy(mug(), &rec);
    for (folder, count) in [("color", 4), ("depth", 8)] {
        for i in 0..count {
            let path = rec.join(format!("{folder}/{i:06}.png"));
            let bytes = fs::read(&path).unwrap();
            let flipped = if folder == "color" {
                let image = scanner::pictures::decode_color(&bytes, 640, 480).unwrap();
                scanner::pictures::encode_color(&image.mirrored()).unwrap()
            } else {
                encode_depth(&decode_depth(&bytes, 640, 480, 1000.0).unwrap().mirrored()).unwrap()
            };
            fs::write(&path, flipped).unwrap();
        }
    }
    let mut description = json(&rec.join("recording.json"));
    description["mirrored"] = true.into();
    fs::write(rec.join("recording.json"), description.to_string()).unwrap();
    let out = home.path().join("out");
    build(&rec, &out, &[]).with_status(0);
    for name in RESULT.iter().filter(|name| **name != "report.json") {
        assert!(bytes_of(&out)[*name] == bytes_of(mug_model())[*name], "{name}");
    }
}

/// Every other pixel of every other row, and the camera that fits: depth and colour of different sizes.
#[test]
fn depth_of_half_the_size_gives_the_same_surface() {
    let home = tempfile::tempdir().unwrap();
    let rec = home.path().join("rec");
    copy(mug(), &rec);
    for i in 0..8 {
        let path = rec.join(format!("depth/{i:06}.png"));
        let image = decode_depth(&fs::read(&path).unwrap(), 640, 480, 1000.0).unwrap();
        let data = (0..320 * 240).map(|i| image.data[2 * (i % 320) + 640 * 2 * (i / 320)]).collect();
        let half = DepthImage { width: 320, height: 240, data, units_per_metre: 1000.0 };
        fs::write(&path, encode_depth(&half).unwrap()).unwrap();
    }
    let mut description = json(&rec.join("recording.json"));
    for (field, value) in [("fx", 262.5), ("fy", 262.5), ("cx", 159.75), ("cy", 119.75)] {
        description["depth"][field] = value.into();
    }
    description["depth"]["width"] = 320.into();
    description["depth"]["height"] = 240.into();
    fs::write(rec.join("recording.json"), description.to_string()).unwrap();
    let out = home.path().join("out");
    let ran = build(&rec, &out, &[]).with_status(0);
    assert!(ran.out.contains("from 4 of 4 views"), "{}", ran.out);
    check_same_model(&out, mug_model());
}
