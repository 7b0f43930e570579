//! PCD files as the library writes them, and broken ones.

use super::*;

fn header(fields: &str, sizes: &str, types: &str, points: usize, data: &str) -> Vec<u8> {
    format!(
        "# .PCD v.7\nVERSION .7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {types}\nWIDTH {points}\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {data}\n"
    )
    .into_bytes()
}

#[test]
fn ascii_with_packed_colours_and_holes() {
    let mut bytes = header("x y z rgb", "4 4 4 4", "F F F F", 3, "ascii");
    let packed = f32::from_bits(0x000a_141e);
    bytes.extend(format!("1 2 3 {packed}\nnan nan nan 0\n4 5 6 {packed}\n").as_bytes());
    let cloud = read(bytes.as_slice(), &Limits::default()).unwrap();
    assert_eq!(cloud.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert_eq!(cloud.colors, [[10, 20, 30]; 2]);
}

#[test]
fn ascii_colours_as_whole_numbers() {
    let mut bytes = header("x y z rgb", "4 4 4 4", "F F F U", 1, "ascii");
    bytes.extend(b"1 2 3 4278850590\n");
    assert_eq!(read(bytes.as_slice(), &Limits::default()).unwrap().colors, [[10, 20, 30]]);
}

#[test]
fn compressed_fields_lie_one_after_the_other() {
    let mut bytes = header("x y z", "4 4 4", "F F F", 2, "binary_compressed");
    let columns: Vec<u8> = [1.0f32, 4.0, 2.0, 5.0, 3.0, 6.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let mut packed = vec![23];
    packed.extend(&columns);
    bytes.extend((packed.len() as u32).to_le_bytes());
    bytes.extend(24u32.to_le_bytes());
    bytes.extend(&packed);
    let cloud = read(bytes.as_slice(), &Limits::default()).unwrap();
    assert_eq!(cloud.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    bytes.pop();
    assert!(matches!(read(bytes.as_slice(), &Limits::default()), Err(ModelError::Truncated { .. })));
}

#[test]
fn whole_numbers_of_every_width_keep_their_sign() {
    for (sizes, types, row) in [
        ("1 2 4", "I I I", [&[0xfe][..], &(-300i16).to_le_bytes(), &(-70_000i32).to_le_bytes()].concat()),
        ("1 2 4", "U U U", [&[0xfe][..], &60_000u16.to_le_bytes(), &70_000u32.to_le_bytes()].concat()),
        ("8 8 8", "I U F", [(-5i64).to_le_bytes(), 7u64.to_le_bytes(), 0.5f64.to_le_bytes()].concat()),
    ] {
        let mut bytes = header("x y z", sizes, types, 1, "binary");
        bytes.extend(row);
        let found = read(bytes.as_slice(), &Limits::default()).unwrap().points[0];
        let expected = match types {
            "I I I" => [-2.0, -300.0, -70_000.0],
            "U U U" => [254.0, 60_000.0, 70_000.0],
            _ => [-5.0, 7.0, 0.5],
        };
        assert_eq!(found, expected, "{sizes} {types}");
    }
}

/// The rows as a compressed file, of literals alone.
fn compressed(mut bytes: Vec<u8>, columns: &[u8]) -> Vec<u8> {
    let packed: Vec<u8> =
        columns.chunks(32).flat_map(|part| [&[part.len() as u8 - 1], part].concat()).collect();
    bytes.extend((packed.len() as u32).to_le_bytes());
    bytes.extend((columns.len() as u32).to_le_bytes());
    bytes.extend(packed);
    bytes
}

#[test]
fn compressed_columns_of_any_width_are_read_alike_and_places_without_a_number_left_out() {
    let places = [[1.0f32, 2.0, 3.0], [f32::NAN, 0.0, 0.0], [4.0, 5.0, 6.0]];
    let along = |k: usize| places.iter().map(move |p| p[k]);
    let colors: Vec<u8> = [[30u8, 20, 10, 0], [9, 9, 9, 9], [60, 50, 40, 0]].concat();
    let narrow: Vec<u8> = (0..3).flat_map(along).flat_map(f32::to_le_bytes).chain(colors.clone()).collect();
    let wide: Vec<u8> =
        (0..3).flat_map(along).flat_map(|v| f64::from(v).to_le_bytes()).chain(colors).collect();
    for (sizes, columns) in [("4 4 4 4", narrow), ("8 8 8 4", wide)] {
        let file = compressed(header("x y z rgba", sizes, "F F F U", 3, "binary_compressed"), &columns);
        let cloud = read(file.as_slice(), &Limits::default()).unwrap();
        assert_eq!(cloud.points, [places[0], places[2]], "{sizes}");
        assert_eq!(cloud.colors, [[10, 20, 30], [40, 50, 60]], "{sizes}");
    }
}

#[track_caller]
fn check_refused(bytes: &[u8], expected: &str) {
    let message = read(bytes, &Limits::default()).unwrap_err().to_string();
    assert!(message.contains(expected), "{message}");
}

#[test]
fn broken_files_are_refused_with_a_reason() {
    check_refused(&header("x y z", "4 4 4", "F F F", 1_000_000_000, "binary"), "1000000000 points");
    check_refused(&header("x y z", "4 4 4", "F F F", 2, "binary"), "ends too early");
    check_refused(&header("x y z", "4 4", "F F F", 2, "binary"), "different lengths");
    check_refused(&header("x y z", "4 4 1", "F F F", 2, "binary"), "the size \"1\"");
    check_refused(&header("x y z", "4 4 4", "F F Q", 2, "binary"), "the type \"Q\"");
    check_refused(&header("x y w", "4 4 4", "F F F", 2, "binary"), "no fields x, y and z");
    check_refused(&header("x y z", "4 4 4", "F F F", 2, "zipped"), "\"zipped\"");
    check_refused(b"WIDTH 4000000000\nHEIGHT 5000000000\nDATA binary\n", "absurd");
    check_refused(b"POINTS 3\n", "ends too early");
    let mut infinite = header("x y z", "4 4 4", "F F F", 1, "ascii");
    infinite.extend(b"inf 0 0\n");
    check_refused(&infinite, "point 1 lies at");
    let mut huge = header("x y z", "4 4 4", "F F F", 5_000_000, "binary_compressed");
    huge.extend([9, 0, 0, 0]);
    huge.extend(60_000_000u32.to_le_bytes());
    huge.extend([0; 9]);
    check_refused(&huge, "damaged");
}
