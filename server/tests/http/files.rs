//! Stored files: in full, in part, cached, and only for those who may see the product.

use serde_json::json;

use super::support::{ASC, Server, Who, id_of};

#[test]
fn ranges_and_etags() {
    let server = Server::start();
    let product = server.active(&server.manager("sam"), "mug");
    let url = product["model"]["original_url"].as_str().unwrap();
    let get = |headers: &[(&str, &str)]| server.raw("GET", url, &Who::Nobody, headers, vec![]);
    let whole = get(&[]).expect(200);
    assert_eq!(whole.body, ASC.as_bytes());
    assert_eq!(whole.header("cache-control"), "public, max-age=31536000, immutable");
    assert_eq!(whole.header("content-disposition"), "attachment; filename=\"model.asc\"");
    assert_eq!(whole.header("accept-ranges"), "bytes");
    assert_eq!(whole.header("content-length"), ASC.len().to_string());
    let etag = whole.header("etag").to_string();
    assert_eq!(etag, format!("\"{}\"", product["model"]["sha256"].as_str().unwrap()));
    get(&[("if-none-match", &etag)]).expect(304);
    let part = get(&[("range", "bytes=4-6")]).expect(206);
    assert_eq!(part.body, &ASC.as_bytes()[4..7]);
    assert_eq!(part.header("content-range"), format!("bytes 4-6/{}", ASC.len()));
    assert_eq!(get(&[("range", "bytes=-5")]).expect(206).body, &ASC.as_bytes()[ASC.len() - 5..]);
    assert_eq!(get(&[("range", "bytes=4-6"), ("if-range", &etag)]).expect(206).body.len(), 3);
    assert_eq!(get(&[("range", "bytes=4-6"), ("if-range", "\"old\"")]).expect(200).body.len(), ASC.len());
    let beyond = get(&[("range", "bytes=5000-")]).refused(416, "bad_range");
    assert_eq!(beyond.header("content-range"), format!("bytes */{}", ASC.len()));
    let head = server.raw("HEAD", url, &Who::Nobody, &[], vec![]).expect(200);
    assert_eq!((head.header("content-length"), head.body.len()), (ASC.len().to_string().as_str(), 0));
}

#[test]
fn the_stream_is_what_the_viewer_expects() {
    let server = Server::start();
    let product = server.active(&server.manager("sam"), "mug");
    let bytes = server.get(product["model"]["stream_url"].as_str().unwrap(), &Who::Nobody).expect(200).body;
    assert_eq!(bytes.len() as u64, product["model"]["stream_bytes"].as_u64().unwrap());
    let (header, mesh) = reconstruct::stream::decode(&bytes).unwrap();
    assert_eq!((header.kind.as_str(), header.points), ("points", 3));
    assert!(mesh.vertices.colors.contains(&[255, 0, 0]));
    let highest = mesh.vertices.points.iter().map(|p| p[1]).fold(0.0, f32::max);
    assert!((highest - 0.02).abs() < 1e-6, "{highest} m");
}

#[test]
fn what_is_not_public_is_not_served() {
    let server = Server::start();
    let sam = server.manager("sam");
    let product = server.active(&sam, "mug");
    let url = product["model"]["original_url"].as_str().unwrap().to_string();
    let path = format!("/api/products/{}", id_of(&product));
    server.get(&url, &Who::Nobody).expect(200);
    server.post(&format!("{path}/status"), &sam, json!({"status": "draft"})).expect(200);
    server.get(&url, &Who::Nobody).refused(404, "not_found");
    assert!(server.get(&url, &sam).expect(200).header("cache-control").starts_with("private"));
}

#[test]
fn paths_have_no_way_out() {
    let server = Server::start();
    let sam = server.manager("sam");
    let id = id_of(&server.draft(&sam, "mug"));
    let path = format!("/api/products/{id}");
    for (sent, kept) in [
        ("../../../etc/passwd", "passwd.asc"),
        ("..\\..\\boot.ini", "boot.ini.asc"),
        ("/absolute.asc", "absolute.asc"),
        ("a\"; x=\"b.asc", "a___x__b.asc"),
        ("....", "model.asc"),
    ] {
        let headers = [("x-filename", sent)];
        let product =
            server.raw("PUT", &format!("{path}/model"), &sam, &headers, ASC.into()).expect(200).json();
        assert_eq!(product["model"]["original_name"], kept, "{sent}");
        server.get(product["model"]["original_url"].as_str().unwrap(), &sam).expect(200);
    }
    let sha = "0".repeat(64);
    for file in [
        format!("{sha}/model.asc"),
        "..%2f..%2fallround.sqlite/x".to_string(),
        format!("{sha}/..%2f..%2f..%2fallround.sqlite"),
        "%00/x".to_string(),
    ] {
        server.get(&format!("{path}/files/{file}"), &sam).refused(404, "not_found");
    }
}

#[test]
fn the_same_bytes_are_kept_once_and_as_long_as_somebody_uses_them() {
    let server = Server::start();
    let sam = server.manager("sam");
    let one = server.draft_with_model(&sam, "one");
    let after_one = server.stored();
    let other = server.draft_with_model(&sam, "other");
    assert_eq!(server.stored(), after_one);
    server.raw("DELETE", &format!("/api/products/{one}"), &sam, &[], vec![]).expect(204);
    assert_eq!(server.stored(), after_one);
    let changed = ASC.replace("255", "254");
    server.raw("PUT", &format!("/api/products/{other}/model"), &sam, &[], changed.into()).expect(200);
    assert_eq!(server.stored().len(), after_one.len(), "the former files are gone");
    assert_ne!(server.stored(), after_one);
}

#[test]
fn pictures_are_written_anew_and_small() {
    let server = Server::start();
    let sam = server.manager("sam");
    let path = format!("/api/products/{}", id_of(&server.draft(&sam, "mug")));
    let png = png_of(1600, 1200);
    let image = [("content-type", "image/png")];
    let product = server.raw("PUT", &format!("{path}/poster"), &sam, &image, png).expect(200).json();
    for (field, most) in [("poster_url", 60_000), ("thumb_url", 15_000)] {
        let picture = server.get(product[field].as_str().unwrap(), &sam).expect(200);
        assert_eq!(picture.header("content-type"), "image/jpeg");
        assert!(
            picture.body.starts_with(&[0xff, 0xd8]) && picture.body.len() <= most,
            "{field} {}",
            picture.body.len()
        );
    }
    let jpeg = server.get(product["poster_url"].as_str().unwrap(), &sam).body;
    server.raw("PUT", &format!("{path}/poster"), &sam, &[("content-type", "image/jpeg")], jpeg).expect(200);
}

#[test]
fn a_model_without_a_picture_gets_one_until_the_seller_sends_another() {
    let server = Server::start();
    let sam = server.manager("sam");
    let path = format!("/api/products/{}", server.draft_with_model(&sam, "mug"));
    let poster = || server.get(&path, &sam).json()["poster_url"].as_str().unwrap().to_string();
    let drawn = poster();
    assert!(server.get(&drawn, &sam).expect(200).body.starts_with(&[0xff, 0xd8]));
    server.raw("PUT", &format!("{path}/poster"), &sam, &[], png_of(100, 100)).expect(200);
    let sent = poster();
    assert_ne!(drawn, sent);
    let changed = ASC.replace("255", "254");
    server.raw("PUT", &format!("{path}/model"), &sam, &[], changed.into()).expect(200);
    assert_eq!(poster(), sent, "a new model keeps the seller's picture");
}

#[test]
fn the_report_is_shown() {
    let server = Server::start();
    let sam = server.manager("sam");
    let path = format!("/api/products/{}", id_of(&server.draft(&sam, "mug")));
    let report = json!({"version": 1, "views": [{"name": "000", "used": true}, {"name": "001", "used": false}],
        "dimensions_m": [0.12, 0.08, 0.1], "dimensions_uncertainty_m": [0.001, 0.001, 0.002], "verdict": "good",
        "warnings": ["The handle was seen from one side only."], "software": "0.1.0"});
    let put = |report| server.send("PUT", &format!("{path}/report"), &sam, &[], Some(report));
    let product = put(report).expect(200).json();
    assert_eq!(product["scan"]["views_used"], 1);
    assert_eq!((&product["verdict"], &product["dimensions_m"][0]), (&json!("good"), &json!(0.12)));
    let kept = server.get(product["scan"]["report_url"].as_str().unwrap(), &sam).expect(200);
    assert_eq!(kept.json()["views"][1]["used"], false);
    put(json!({"version": 1, "dimensions_m": [1e300, 0, 0]})).refused(422, "bad_report");
    put(json!({"version": 1, "verdict": "<b>superb</b>"})).refused(422, "bad_report");
}

/// A PNG with some structure in it.
pub(crate) fn png_of(width: u32, height: u32) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    let pixel = |i: u32| [(i % width % 251) as u8, (i / width % 241) as u8, (i * 7 % 239) as u8];
    let data: Vec<u8> = (0..width * height).flat_map(pixel).collect();
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&data).unwrap();
    writer.finish().unwrap();
    out
}
