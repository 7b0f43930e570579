//! Resumable uploads (tus 1.0.0).

use std::io::Write;
use std::time::Duration;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest, Sha256};

use super::support::{ASC, Answer, Server, Who, head_of, id_of, until};

const CHUNK: (&str, &str) = ("content-type", "application/offset+octet-stream");
const TUS: (&str, &str) = ("tus-resumable", "1.0.0");

fn hash(bytes: &[u8]) -> String {
    server::model::hex(&Sha256::digest(bytes))
}

fn metadata(product: &str, kind: &str, name: &str, sha256: &str) -> String {
    let pairs = [("product", product), ("kind", kind), ("filename", name), ("sha256", sha256)];
    pairs.map(|(key, value)| format!("{key} {}", STANDARD.encode(value))).join(",")
}

fn begin(server: &Server, who: &Who, length: usize, metadata: &str) -> Answer {
    let length = length.to_string();
    server.raw(
        "POST",
        "/api/uploads",
        who,
        &[TUS, ("upload-length", &length), ("upload-metadata", metadata)],
        vec![],
    )
}

fn model_upload(server: &Server, who: &Who) -> (String, String) {
    let id = id_of(&server.draft(who, "mug"));
    let begun =
        begin(server, who, ASC.len(), &metadata(&id, "model", "mug.asc", &hash(ASC.as_bytes()))).expect(201);
    assert!(begun.header("upload-expires").ends_with("GMT"));
    (id, begun.header("location").to_string())
}

fn patch(server: &Server, who: &Who, path: &str, offset: usize, bytes: &[u8]) -> Answer {
    server.raw("PATCH", path, who, &[TUS, CHUNK, ("upload-offset", &offset.to_string())], bytes.into())
}

fn offset(server: &Server, who: &Who, path: &str) -> usize {
    server.raw("HEAD", path, who, &[TUS], vec![]).expect(200).header("upload-offset").parse().unwrap()
}

#[test]
fn in_two_pieces() {
    let server = Server::start();
    let sam = server.manager("sam");
    let (id, path) = model_upload(&server, &sam);
    let bytes = ASC.as_bytes();
    assert_eq!(patch(&server, &sam, &path, 0, &bytes[..20]).expect(204).header("upload-offset"), "20");
    patch(&server, &sam, &path, 5, &bytes[5..]).refused(409, "wrong_offset");
    assert_eq!(server.get(&path, &sam).json()["state"], "receiving");
    patch(&server, &sam, &path, 20, &bytes[20..]).expect(204);
    let status = server.get(&path, &sam).expect(200).json();
    assert_eq!((&status["state"], &status["offset"]), (&"done".into(), &ASC.len().into()));
    let product = server.get(&format!("/api/products/{id}"), &sam).json();
    assert_eq!(
        (&product["model"]["points"], &product["model"]["original_name"]),
        (&3.into(), &"mug.asc".into())
    );
    assert!(server.spooled().is_empty());
    patch(&server, &sam, &path, ASC.len(), b"").expect(204);
}

#[test]
fn a_broken_connection_costs_only_the_rest() {
    let server = Server::start();
    let sam = server.manager("sam");
    let (id, path) = model_upload(&server, &sam);
    let length = ASC.len().to_string();
    let headers = [TUS, CHUNK, ("Upload-Offset", "0"), ("Content-Length", length.as_str())];
    let mut stream = server.connect();
    stream.write_all(head_of("PATCH", &path, &sam, &headers).as_bytes()).unwrap();
    stream.write_all(&ASC.as_bytes()[..25]).unwrap();
    until("the first bytes are there", || offset(&server, &sam, &path) == 25);
    patch(&server, &sam, &path, 25, &ASC.as_bytes()[25..]).refused(423, "upload_in_use");
    drop(stream);
    until("the broken request is over", || {
        patch(&server, &sam, &path, 25, &ASC.as_bytes()[25..]).status == 204
    });
    let product = server.get(&format!("/api/products/{id}"), &sam).json();
    assert_eq!(product["model"]["sha256"], hash(ASC.as_bytes()));
}

#[test]
fn damage_on_the_way_is_noticed() {
    let server = Server::start();
    let sam = server.manager("sam");
    let (id, path) = model_upload(&server, &sam);
    let wrong = format!("sha256 {}", STANDARD.encode(Sha256::digest(b"other")));
    let headers = [TUS, CHUNK, ("upload-offset", "0"), ("upload-checksum", wrong.as_str())];
    server.raw("PATCH", &path, &sam, &headers, ASC.into()).refused(460, "checksum_mismatch");
    assert_eq!(offset(&server, &sam, &path), 0, "the damaged piece is thrown away");
    let damaged = ASC.replace("255", "155");
    patch(&server, &sam, &path, 0, damaged.as_bytes()).refused(422, "hash_mismatch");
    assert_eq!(server.get(&path, &sam).json()["state"], "failed");
    assert!(server.get(&format!("/api/products/{id}"), &sam).json()["model"].is_null());
    assert!(server.spooled().is_empty() && server.stored().is_empty());
    let right = format!("sha256 {}", STANDARD.encode(Sha256::digest(ASC)));
    let (_, path) = model_upload(&server, &sam);
    let headers = [TUS, CHUNK, ("upload-offset", "0"), ("upload-checksum", right.as_str())];
    server.raw("PATCH", &path, &sam, &headers, ASC.into()).expect(204);
}

#[test]
fn uploads_are_their_owners_and_within_limits() {
    let server = Server::start_with(|config| {
        config.limits.report_bytes = 100;
        config.limits.uploads_under_way = 1;
    });
    let (sam, sue) = (server.manager("sam"), server.manager("sue"));
    let id = id_of(&server.draft(&sam, "mug"));
    let sha = hash(b"x");
    begin(&server, &sue, 5, &metadata(&id, "model", "m.asc", &sha)).refused(404, "not_found");
    begin(&server, &sam, 101, &metadata(&id, "report", "r.json", &sha)).refused(413, "too_large");
    begin(&server, &sam, 5, &metadata(&id, "virus", "r.json", &sha)).refused(400, "bad_metadata");
    begin(&server, &sam, 5, &metadata(&id, "model", "m.asc", "../x")).refused(400, "bad_metadata");
    begin(&server, &sam, 5, "product ???").refused(400, "bad_metadata");
    let (_, path) = model_upload(&server, &sam);
    begin(&server, &sam, 5, &metadata(&id, "model", "m.asc", &sha)).refused(409, "too_many_uploads");
    server.get(&path, &sue).refused(404, "not_found");
    patch(&server, &sue, &path, 0, b"x").refused(404, "not_found");
    patch(&server, &sam, &path, 0, &[b'#'; 1000]).refused(413, "too_large");
    server
        .raw("PATCH", &path, &sam, &[TUS, ("upload-offset", "0")], b"x".into())
        .refused(415, "wrong_content_type");
    server.raw("DELETE", &path, &sam, &[TUS], vec![]).expect(204);
    server.get(&path, &sam).refused(404, "not_found");
    assert!(server.spooled().is_empty());
    let options = server.raw("OPTIONS", "/api/uploads", &Who::Nobody, &[], vec![]).expect(204);
    assert!(options.header("tus-extension").contains("checksum"));
}

#[test]
fn uploads_run_out() {
    let server = Server::start_with(|config| config.times.upload_lifetime = Duration::ZERO);
    let sam = server.manager("sam");
    let (_, path) = model_upload(&server, &sam);
    server.get(&path, &sam).refused(404, "not_found");
    server.block_on(server::clean::clean(&server.app)).unwrap();
}
