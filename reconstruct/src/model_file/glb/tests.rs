//! GLB files as other programs write them, and broken ones.

use serde_json::{Value, json};

use super::*;
use crate::cloud::PointCloud;

fn glb(json: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = Vec::new();
    let word = |v: u32, out: &mut Vec<u8>| out.extend(v.to_le_bytes());
    for v in [MAGIC, 2, (28 + text.len() + binary.len()) as u32, text.len() as u32, JSON_CHUNK] {
        word(v, &mut out);
    }
    out.extend(&text);
    word(binary.len() as u32, &mut out);
    word(BINARY_CHUNK, &mut out);
    out.extend(binary);
    out
}

/// A quad as a strip with bytes as indices and colours, turned and moved by its node.
fn strip() -> (Value, Vec<u8>) {
    let mut binary: Vec<u8> = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]
        .as_flattened()
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    binary.extend([0u8, 1, 2, 3]);
    binary.extend([255u8, 0, 0, 255].repeat(4));
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [1]}],
        "nodes": [{"mesh": 0, "translation": [0, 5, 0]}, {"children": [0], "scale": [2, 2, 2]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 2}, "indices": 1, "mode": 5}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4},
            {"bufferView": 1, "componentType": 5121, "type": "SCALAR", "count": 4},
            {"bufferView": 2, "componentType": 5121, "type": "VEC4", "count": 4, "normalized": true}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 4},
            {"buffer": 0, "byteOffset": 52, "byteLength": 16}],
        "buffers": [{"byteLength": binary.len()}],
    });
    (json, binary)
}

#[test]
fn nodes_strips_and_colours() {
    let (json, binary) = strip();
    let mesh = read(glb(&json, &binary).as_slice(), &Limits::default()).unwrap();
    assert_eq!(mesh.vertices.points[3], [2.0, 0.0, 12.0]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(mesh.vertices.colors[0], [255, 0, 0]);
}

#[test]
fn textures_colour_the_vertices() {
    let (mut json, mut binary) = strip();
    let coordinates = [[0.1f32, 0.1], [0.9, 0.1], [0.1, 0.9], [1.9, -0.1]];
    let start = binary.len();
    binary.extend(coordinates.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    binary.extend(b"pixels");
    json["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0, "TEXCOORD_0": 2});
    json["meshes"][0]["primitives"][0]["material"] = json!(0);
    json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    json["textures"] = json!([{"source": 0}]);
    json["images"] = json!([{"bufferView": 3}]);
    json["accessors"][2] = json!({"bufferView": 2, "componentType": 5126, "type": "VEC2", "count": 4});
    json["bufferViews"][2] = json!({"buffer": 0, "byteOffset": start, "byteLength": 32});
    let views = json["bufferViews"].as_array_mut().unwrap();
    views.push(json!({"buffer": 0, "byteOffset": start + 32, "byteLength": 6}));
    let picture = ColorImage { width: 2, height: 2, data: vec![[1; 3], [2; 3], [3; 3], [4; 3]] };
    let mut decode = |bytes: &[u8]| (bytes == b"pixels").then(|| picture.clone());
    let mesh = read_with_textures(glb(&json, &binary).as_slice(), &Limits::default(), &mut decode).unwrap();
    assert_eq!(mesh.vertices.colors, [[1; 3], [2; 3], [3; 3], [4; 3]]);
    let plain = read(glb(&json, &binary).as_slice(), &Limits::default()).unwrap();
    assert!(plain.vertices.colors.is_empty());
}

#[track_caller]
fn check_refused(change: impl FnOnce(&mut Value), expected: &str) {
    let (mut json, binary) = strip();
    change(&mut json);
    let message = read(glb(&json, &binary).as_slice(), &Limits::default()).unwrap_err().to_string();
    assert!(message.contains(expected), "{message}");
}

#[test]
fn broken_files_are_refused_with_a_reason() {
    check_refused(|v| v["accessors"][0]["count"] = json!(5), "accessor 0 reaches beyond");
    check_refused(|v| v["accessors"][0]["count"] = json!(u64::MAX), "accessor 0 reaches beyond");
    check_refused(|v| v["accessors"][0]["count"] = json!(0), "accessor 0 is empty");
    check_refused(|v| v["accessors"][0]["byteOffset"] = json!(1u64 << 60), "accessor 0 reaches beyond");
    check_refused(|v| v["accessors"][0]["componentType"] = json!(1), "component type 1");
    check_refused(|v| v["accessors"][0]["type"] = json!("VEC2"), "2 components where 3");
    check_refused(|v| v["accessors"][0]["sparse"] = json!({"count": 1}), "sparse");
    check_refused(|v| v["accessors"][2]["count"] = json!(3), "3 values for 4 vertices");
    check_refused(|v| v["accessors"][1]["componentType"] = json!(5126), "accessor 1 reaches beyond");
    check_refused(|v| v["bufferViews"][0]["byteStride"] = json!(0), "a stride of 0");
    check_refused(|v| v["bufferViews"][0]["byteLength"] = json!(u64::MAX), "buffer view 0 reaches beyond");
    check_refused(|v| v["buffers"][0]["uri"] = json!("other.bin"), "outside of the GLB file");
    check_refused(|v| v["nodes"][0]["children"] = json!([1]), "node 1 has two parents");
    check_refused(|v| v["nodes"][0]["mesh"] = json!(9), "mesh 9 does not exist");
    check_refused(|v| v["nodes"][0]["translation"] = json!([1e30, 0, 0]), "point 1 lies at");
    check_refused(|v| v["meshes"][0]["primitives"][0]["mode"] = json!(1), "lines");
    check_refused(|v| v["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]), "KHR_draco");
    check_refused(|v| v["nodes"] = json!(7), "header cannot be understood");
    check_refused(|v| v["scenes"][0]["nodes"] = json!([]), "no point");
}

#[test]
fn broken_containers_are_refused() {
    let (json, binary) = strip();
    let whole = glb(&json, &binary);
    for length in 0..whole.len() {
        assert!(read(&whole[..length], &Limits::default()).is_err(), "{length} bytes");
    }
    let mut old = whole.clone();
    old[4] = 1;
    assert!(matches!(read(old.as_slice(), &Limits::default()), Err(ModelError::Unsupported { .. })));
    let small = Limits { max_bytes: whole.len() - 1, ..Limits::default() };
    assert!(matches!(read(whole.as_slice(), &small), Err(ModelError::TooMany { .. })));
}

#[test]
fn indices_beyond_the_vertices_are_refused() {
    let (json, mut binary) = strip();
    binary[51] = 4;
    let refused = read(glb(&json, &binary).as_slice(), &Limits::default());
    assert!(matches!(refused, Err(ModelError::BadIndex { index: 4, vertices: 4 })));
}

#[test]
fn what_is_up_is_y_in_the_file() {
    let vertices = PointCloud { points: vec![[0.1, 0.2, 0.3]], ..PointCloud::default() };
    let mut bytes = Vec::new();
    write(&Mesh::of_points(vertices), &mut bytes).unwrap();
    let (json, binary) = chunks(&bytes, &Limits::default()).unwrap();
    assert!(binary.starts_with(&[0.1f32, 0.3, -0.2].map(f32::to_le_bytes).concat()));
    let json: Value = serde_json::from_slice(json).unwrap();
    assert_eq!(json["accessors"][0]["min"][1], json!(f64::from(0.3f32)));
    assert!(write(&Mesh::default(), &mut bytes).is_err());
}
