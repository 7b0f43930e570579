//! Export and import of arbitrary models: what comes back is what was written, as exactly as the format can.

use proptest::prelude::*;

use super::{Kind, Limits, asc, glb, pcd, ply, read};
use crate::cloud::PointCloud;
use crate::mesh::{INVENTED, Mesh};

/// Some attributes, some triangles; normals of unit length.
fn meshes() -> impl Strategy<Value = Mesh> {
    let vertex = (prop::array::uniform3(-5.0f32..5.0), any::<[u8; 3]>(), prop::array::uniform3(-1.0f32..1.0));
    let vertices = prop::collection::vec(vertex, 1..60);
    let triangles = prop::collection::vec(any::<[u32; 3]>(), 0..40);
    (vertices, triangles, any::<bool>(), any::<bool>()).prop_map(|(vertices, triangles, colors, normals)| {
        let count = vertices.len() as u32;
        let unit = |n: [f32; 3]| {
            let n = [n[0], n[1], n[2] + 1.5];
            let length = n.iter().map(|v| v * v).sum::<f32>().sqrt();
            n.map(|v| v / length)
        };
        let cloud = PointCloud {
            points: vertices.iter().map(|v| v.0).collect(),
            colors: if colors { vertices.iter().map(|v| v.1).collect() } else { Vec::new() },
            normals: if normals { vertices.iter().map(|v| unit(v.2)).collect() } else { Vec::new() },
        };
        let deviation =
            |v: &([f32; 3], [u8; 3], [f32; 3])| if v.1[0] > 200 { INVENTED } else { v.2[0].abs() };
        Mesh {
            vertices: cloud,
            triangles: triangles.iter().map(|t| t.map(|i| i % count)).collect(),
            deviations_metres: if colors { vertices.iter().map(deviation).collect() } else { Vec::new() },
        }
    })
}

fn close(a: &[[f32; 3]], b: &[[f32; 3]], tolerance: f32) -> bool {
    a.len() == b.len() && a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() <= tolerance)
}

proptest! {
    #[test]
    fn asc_keeps_micrometres_and_colours(mesh in meshes()) {
        let mut bytes = Vec::new();
        asc::write(&mesh.vertices, &mut bytes).unwrap();
        let back = read(Kind::Asc, bytes.as_slice(), &Limits::default()).unwrap();
        prop_assert_eq!(Kind::sniff(&bytes), Some(Kind::Asc));
        prop_assert!(close(&back.vertices.points, &mesh.vertices.points, 1e-6));
        if mesh.vertices.has_colors() {
            prop_assert_eq!(back.vertices.colors, mesh.vertices.colors);
        }
    }

    #[test]
    fn ply_keeps_everything(mesh in meshes()) {
        let mut bytes = Vec::new();
        ply::write(&mesh, &mut bytes).unwrap();
        let back = read(Kind::Ply, bytes.as_slice(), &Limits::default()).unwrap();
        prop_assert_eq!(Kind::sniff(&bytes), Some(Kind::Ply));
        prop_assert_eq!(&back.vertices.points, &mesh.vertices.points);
        prop_assert_eq!(&back.vertices.colors, &mesh.vertices.colors);
        prop_assert_eq!(&back.deviations_metres, &mesh.deviations_metres);
        prop_assert!(close(&back.vertices.normals, &mesh.vertices.normals, 1e-6));
        prop_assert_eq!(back.triangles, mesh.triangles);
    }

    #[test]
    fn pcd_keeps_the_points(mesh in meshes()) {
        let mut bytes = Vec::new();
        pcd::write(&mesh.vertices, &mut bytes).unwrap();
        let back = read(Kind::Pcd, bytes.as_slice(), &Limits::default()).unwrap().vertices;
        prop_assert_eq!(Kind::sniff(&bytes), Some(Kind::Pcd));
        prop_assert_eq!(&back.points, &mesh.vertices.points);
        prop_assert_eq!(&back.colors, &mesh.vertices.colors);
        prop_assert!(close(&back.normals, &mesh.vertices.normals, 1e-6));
    }

    #[test]
    fn glb_keeps_everything(mesh in meshes()) {
        let mut bytes = Vec::new();
        glb::write(&mesh, &mut bytes).unwrap();
        let back = read(Kind::Glb, bytes.as_slice(), &Limits::default()).unwrap();
        prop_assert_eq!(Kind::sniff(&bytes), Some(Kind::Glb));
        prop_assert_eq!(&back.deviations_metres, &mesh.deviations_metres);
        prop_assert_eq!(&back.vertices.points, &mesh.vertices.points);
        prop_assert_eq!(&back.vertices.colors, &mesh.vertices.colors);
        prop_assert!(close(&back.vertices.normals, &mesh.vertices.normals, 1e-6));
        prop_assert_eq!(back.triangles, mesh.triangles);
    }

    #[test]
    fn no_bytes_make_a_reader_panic(kind in 0..4usize, noise in prop::collection::vec(any::<u8>(), 0..400), at in any::<prop::sample::Index>(), mesh in meshes()) {
        let kind = [Kind::Asc, Kind::Ply, Kind::Pcd, Kind::Glb][kind];
        let mut bytes = Vec::new();
        match kind {
            Kind::Asc => asc::write(&mesh.vertices, &mut bytes),
            Kind::Ply => ply::write(&mesh, &mut bytes),
            Kind::Pcd => pcd::write(&mesh.vertices, &mut bytes),
            Kind::Glb => glb::write(&mesh, &mut bytes),
        }.unwrap();
        let at = at.index(bytes.len());
        for (place, byte) in bytes[at..].iter_mut().zip(noise) {
            *place = byte;
        }
        // Either is right; a panic is not.
        if let Ok(mesh) = read(kind, bytes.as_slice(), &Limits::default()) {
            prop_assert!(!mesh.vertices.is_empty());
            prop_assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.vertices.len()));
        }
    }
}
