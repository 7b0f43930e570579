//! PLY files as other programs write them, and broken ones.

use super::*;

const ASCII: &str = "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement camera 1\nproperty list uchar float k\n\
    element vertex 4\nproperty uchar blue\nproperty uchar green\nproperty uchar red\nproperty double z\nproperty float y\n\
    property float x\nelement face 1\nproperty int flags\nproperty list uchar uint vertex_index\nend_header\n\
    3 1 2 3\n30 20 10 0.5 0.25 0\n0 0 0 0 0 1\n0 0 0 0 1 1\n0 0 0 0 1 0\n7 4 0 1 2 3\n";

#[test]
fn any_order_and_further_elements() {
    let mesh = read(ASCII.as_bytes(), &Limits::default()).unwrap();
    assert_eq!(mesh.vertices.points[0], [0.0, 0.25, 0.5]);
    assert_eq!(mesh.vertices.colors[0], [10, 20, 30]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn big_endian() {
    let mut bytes =
        b"ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty short x\nproperty double y\n\
        property float z\nproperty float red\nproperty float green\nproperty float blue\nend_header\n"
            .to_vec();
    bytes.extend((-2i16).to_be_bytes());
    bytes.extend(0.125f64.to_be_bytes());
    bytes.extend([3.0f32, 1.0, 0.5, 0.0].iter().flat_map(|v| v.to_be_bytes()));
    let mesh = read(bytes.as_slice(), &Limits::default()).unwrap();
    assert_eq!(mesh.vertices.points, [[-2.0, 0.125, 3.0]]);
    assert_eq!(mesh.vertices.colors, [[255, 128, 0]]);
}

#[test]
fn values_across_the_end_of_the_buffer_are_whole() {
    let mesh = read(ASCII.as_bytes(), &Limits::default()).unwrap();
    let mut bytes = Vec::new();
    write(&mesh, &mut bytes).unwrap();
    for size in [1, 5, 7] {
        let buffered = std::io::BufReader::with_capacity(size, bytes.as_slice());
        assert_eq!(read(buffered, &Limits::default()).unwrap(), mesh, "{size}");
    }
    bytes.pop();
    let cut = std::io::BufReader::with_capacity(5, bytes.as_slice());
    assert!(matches!(read(cut, &Limits::default()), Err(ModelError::Truncated { .. })));
}

#[track_caller]
fn check_refused(text: &str, expected: &str) {
    let message = read(text.as_bytes(), &Limits::default()).unwrap_err().to_string();
    assert!(message.contains(expected), "{message}");
}

#[test]
fn broken_files_are_refused_with_a_reason() {
    let body = |vertex: &str, face: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n{vertex}\n{face}\n"
        )
    };
    check_refused(&body("nan 0 0", "3 0 0 0"), "point 1 lies at");
    check_refused(&body("0 inf 0", "3 0 0 0"), "point 1 lies at");
    check_refused(&body("0 0 0", "3 0 0 1"), "names vertex 1");
    check_refused(&body("0 0 0", "3 0 0 -1"), "names vertex -1");
    check_refused(&body("0 0 0", "-3 0 0 0"), "a list of -3");
    check_refused(&body("0 0 0", "3 0"), "ends too early");
    check_refused(&body("0 zero 0", "3 0 0 0"), "\"zero\" on data line 1");
    check_refused("ply\nformat ascii 2.0\n", "is no header line");
    check_refused("ply\nformat morse 1.0\n", "\"morse\"");
    check_refused("ply\nformat ascii 1.0\nproperty float x\n", "before its element");
    check_refused("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n", "no x, y and z");
    check_refused("ply\nformat ascii 1.0\nelement face 0\nend_header\n", "no point");
    check_refused("ply\nformat ascii 1.0\nelement vertex 3\n", "ends too early");
    check_refused("PLY?", "does not begin");
}

#[test]
fn announced_masses_are_refused_early() {
    check_refused("ply\nformat ascii 1.0\nelement vertex 1000000000\n", "1000000000 points");
    check_refused("ply\nformat ascii 1.0\nelement face 99999999999\n", "99999999999 triangles");
    let endless = "ply\nformat binary_little_endian 1.0\nelement other 18446744073709551615\nelement face 1\n\
        element vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    check_refused(endless, "ends too early");
}
