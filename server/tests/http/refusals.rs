//! Bad input: each gets one clear refusal, nothing is lost, nothing half-written stays.

use std::fmt::{Display, Formatter};
use std::io::{Read, Write};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use futures_util::stream::BoxStream;
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use serde_json::json;
use server::storage::Storage;

use super::support::{ASC, Server, exchange, head_of, id_of, read_all};

/// Sends a model that must be refused, and checks that the product and the folders stay as they were.
#[track_caller]
fn check(server: &Server, body: impl Into<Vec<u8>>, status: u16, code: &str, says: &str) {
    let sam = server.manager("sam");
    let id = server.draft_with_model(&sam, "keeps its model");
    let (before, stored) = (server.get(&format!("/api/products/{id}"), &sam).body, server.stored());
    let answer =
        server.raw("PUT", &format!("/api/products/{id}/model"), &sam, &[], body.into()).refused(status, code);
    let detail = answer.json()["detail"].as_str().unwrap().to_lowercase();
    assert!(detail.contains(says), "{detail:?} should say {says:?}");
    assert_eq!(server.get(&format!("/api/products/{id}"), &sam).body, before, "the product stays");
    assert_eq!((server.stored(), server.spooled()), (stored, vec![]), "nothing half-written stays");
}

fn ply(header: &str, body: &[u8]) -> Vec<u8> {
    let mut bytes = format!("ply\n{header}end_header\n").into_bytes();
    bytes.extend_from_slice(body);
    bytes
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

#[test]
fn models_that_are_none() {
    let server = Server::start_with(|config| {
        config.limits.points = 1000;
        config.limits.line_bytes = 200;
    });
    check(&server, "", 422, "empty_body", "empty");
    check(&server, "<html><script>alert(1)</script></html>", 415, "not_a_model", ".asc");
    check(&server, vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0], 415, "not_a_model", "unpack");
    check(&server, "PK\x03\x04 zip", 415, "not_a_model", "unpack");
    check(&server, "# .PCD v0.7\nVERSION 0.7\n", 415, "not_a_model", "pcd");
    check(&server, "0 0 0 1 2 3\nnan 0 0 1 2 3\n", 422, "bad_model", "2");
    check(&server, "0 0 0 1 2 3\n0 inf 0 1 2 3\n", 422, "bad_model", "2");
    check(&server, "0 0 0 1 2 3\n0 1e999 0 1 2 3\n", 422, "bad_model", "2");
    check(&server, "0 0 0 1 2 3\n".repeat(1001), 422, "bad_model", "1000");
    check(&server, format!("0 0 0 1 2 3\n{}\n", "9".repeat(100_000)), 422, "bad_model", "line");
    let nan = [f32::NAN.to_le_bytes(), 0f32.to_le_bytes(), 0f32.to_le_bytes()].concat();
    let one = format!("format binary_little_endian 1.0\nelement vertex 1\n{XYZ}");
    check(&server, ply(&one, &nan), 422, "bad_model", "point");
    let infinite = nan.iter().copied().rev().collect::<Vec<_>>();
    check(&server, ply(&one, &infinite[..8]), 422, "bad_model", "");
}

#[test]
fn huge_announcements_cost_nothing() {
    let server = Server::start();
    let billion = format!("format binary_little_endian 1.0\nelement vertex 1000000000\n{XYZ}");
    check(&server, ply(&billion, &[0; 120]), 422, "bad_model", "1000000000");
    let absurd = format!("format binary_little_endian 1.0\nelement vertex 18446744073709551615\n{XYZ}");
    check(&server, ply(&absurd, &[0; 120]), 422, "bad_model", "");
    let bomb = format!(
        "format binary_little_endian 1.0\nelement vertex 1\n{XYZ}element face 1\nproperty list uint int vertex_indices\n"
    );
    let body = [&[0u8; 12][..], &u32::MAX.to_le_bytes()].concat();
    check(&server, ply(&bomb, &body), 422, "bad_model", "");
}

#[test]
fn bodies_that_are_announced_wrongly() {
    let server = Server::start_with(|config| config.limits.model_bytes = 1000);
    let sam = server.manager("sam");
    let path = format!("/api/products/{}/model", id_of(&server.draft(&sam, "mug")));
    let put = |headers: &[(&str, &str)], body: Vec<u8>| server.raw("PUT", &path, &sam, headers, body);
    for wrong in ["text/html", "image/png", "application/json", "multipart/form-data; boundary=x"] {
        put(&[("content-type", wrong)], ASC.into()).refused(415, "wrong_content_type");
    }
    put(&[("content-encoding", "gzip")], ASC.into()).refused(415, "packed_body");
    put(&[("content-type", "application/x-www-form-urlencoded")], ASC.into()).expect(200);
    put(&[], vec![b'#'; 1001]).refused(413, "too_large");
    let chunked = format!(
        "{}{:x}\r\n{}\r\n0\r\n\r\n",
        head_of("PUT", &path, &sam, &[("Transfer-Encoding", "chunked")]),
        5000,
        "#".repeat(5000)
    );
    let answer = exchange(&mut server.connect(), chunked.as_bytes());
    assert!(answer.starts_with("HTTP/1.1 413") && answer.contains("too_large"), "{answer}");
    let endless = head_of("PUT", &path, &sam, &[("Content-Length", "99999999999999")]);
    let mut stream = server.connect();
    stream.write_all(endless.as_bytes()).unwrap();
    let mut first = [0; 12];
    stream.read_exact(&mut first).unwrap();
    assert_eq!(&first, b"HTTP/1.1 413");
    assert!(server.spooled().is_empty());
}

#[test]
fn slow_bodies_and_slow_heads_are_given_up() {
    let server = Server::start_with(|config| {
        config.times.body_pause = Duration::from_millis(200);
        config.times.header_read = Duration::from_millis(200);
    });
    let sam = server.manager("sam");
    let path = format!("/api/products/{}/model", id_of(&server.draft(&sam, "mug")));
    let half = head_of("PUT", &path, &sam, &[("Content-Length", "100")]) + "0 0 0 1";
    let answer = exchange(&mut server.connect(), half.as_bytes());
    assert!(answer.starts_with("HTTP/1.1 408") && answer.contains("too_slow"), "{answer}");
    assert!(server.spooled().is_empty());
    let answer = exchange(&mut server.connect(), b"GET / HTTP/1.1\r\nHost:");
    assert!(!answer.contains("200 OK"), "{answer}");
}

#[test]
fn a_trickle_is_too_slow_though_it_never_pauses() {
    let server = Server::start_with(|config| {
        config.times.body_pause = Duration::from_millis(400);
        config.times.body_bytes_per_second = 1_000_000;
    });
    let sam = server.manager("sam");
    let path = format!("/api/products/{}/model", id_of(&server.draft(&sam, "mug")));
    let mut stream = server.connect();
    stream.write_all(head_of("PUT", &path, &sam, &[("Content-Length", "100000")]).as_bytes()).unwrap();
    let mut writer = stream.try_clone().unwrap();
    let drip = std::thread::spawn(move || {
        while writer.write_all(b"#").is_ok() {
            std::thread::sleep(Duration::from_millis(20));
        }
    });
    let mut first = [0; 12];
    stream.read_exact(&mut first).unwrap();
    assert_eq!(&first, b"HTTP/1.1 408");
    drop(stream.shutdown(std::net::Shutdown::Both));
    drip.join().unwrap();
}

#[test]
fn pictures_that_are_none() {
    let server = Server::start_with(|config| config.limits.picture_pixels = 10_000);
    let sam = server.manager("sam");
    let path = format!("/api/products/{}/poster", id_of(&server.draft(&sam, "mug")));
    let put = |body: Vec<u8>| server.raw("PUT", &path, &sam, &[("content-type", "image/png")], body);
    put(b"GIF89a".into()).refused(415, "not_a_picture");
    put(b"<svg xmlns='http://www.w3.org/2000/svg'/>".into()).refused(415, "not_a_picture");
    let png = super::files::png_of(90, 90);
    put(png[..png.len() / 2].into()).refused(422, "bad_picture");
    put(super::files::png_of(200, 200)).refused(422, "picture_too_large");
    put(vec![0xff, 0xd8, 0xff, 0xe0, 0, 2]).refused(422, "bad_picture");
    put(png).expect(200);
}

#[test]
fn a_locked_database_is_busy_not_broken() {
    let server = Server::start_with(|config| config.times.database_busy = Duration::from_millis(100));
    let sam = server.manager("sam");
    let id = server.draft_with_model(&sam, "mug");
    let file = server.folder.path().join("allround.sqlite");
    server.block_on(async {
        let other = server::db::Db::open(&file, Duration::from_secs(1)).await.unwrap();
        let lock = other.begin().await.unwrap();
        let stored = server.stored();
        std::thread::scope(|scope| {
            let ask = scope.spawn(|| {
                let refused = server.post("/api/products", &sam, json!({"title": "x"})).refused(503, "busy");
                assert!(!refused.header("retry-after").is_empty());
                assert!(!String::from_utf8_lossy(&refused.body).contains("sqlite"));
                let model = ASC.replace("255", "250");
                server
                    .raw("PUT", &format!("/api/products/{id}/model"), &sam, &[], model.into())
                    .refused(503, "busy");
                server.get(&format!("/api/products/{id}"), &sam).expect(200);
                server.get("/readyz", &sam).expect(503);
            });
            ask.join().unwrap();
        });
        assert_eq!(server.stored(), stored, "what was stored for nothing is deleted");
        lock.rollback().await.unwrap();
        other.close().await;
    });
    server.post("/api/products", &sam, json!({"title": "x"})).expect(201);
}

#[test]
fn a_full_storage_is_told_and_leaves_no_trace() {
    let folder = tempfile::tempdir().unwrap();
    let real = folder.path().join("files");
    std::fs::create_dir_all(&real).unwrap();
    let inner = object_store::local::LocalFileSystem::new_with_prefix(&real).unwrap();
    let full = Arc::new(AtomicBool::new(false));
    let storage = Storage::over(Arc::new(MayBeFull { inner, full: full.clone() }));
    let server = Server::start_over(folder, storage, |_| ());
    let sam = server.manager("sam");
    let id = server.draft_with_model(&sam, "mug");
    let (before, stored) = (server.get(&format!("/api/products/{id}"), &sam).body, server.stored());
    full.store(true, Ordering::SeqCst);
    let other = ASC.replace("255", "250");
    let refused = server.raw("PUT", &format!("/api/products/{id}/model"), &sam, &[], other.clone().into());
    refused.refused(507, "storage_full");
    server.raw("POST", "/api/models?title=x", &sam, &[], other.clone().into()).refused(507, "storage_full");
    server.get("/readyz", &sam).expect(507);
    assert_eq!(server.get(&format!("/api/products/{id}"), &sam).body, before);
    assert_eq!((server.stored(), server.spooled()), (stored, vec![]));
    assert_eq!(server.get("/api/manage/products", &sam).json()["total"], 1, "no draft without its model");
    full.store(false, Ordering::SeqCst);
    server.raw("PUT", &format!("/api/products/{id}/model"), &sam, &[], other.into()).expect(200);
}

#[test]
fn connections_are_limited_but_everybody_gets_a_turn() {
    let server = Server::start_with(|config| {
        config.limits.connections = 2;
        config.times.header_read = Duration::from_millis(300);
    });
    let idle: Vec<_> = (0..4).map(|_| server.connect()).collect();
    let answer =
        exchange(&mut server.connect(), b"GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    drop(idle);
}

#[test]
fn nonsense_on_the_wire_is_refused() {
    let server = Server::start();
    for bytes in
        [&b"\x16\x03\x01\x02\x00\x01\x00"[..], b"GET / HTTP/9.9\r\n\r\n", b"GET /\xff HTTP/1.1\r\n\r\n"]
    {
        let mut stream = server.connect();
        stream.write_all(bytes).unwrap();
        stream.shutdown(std::net::Shutdown::Write).unwrap();
        let answer = read_all(&mut stream);
        assert!(!answer.contains("200 OK"), "{answer}");
    }
    let long = format!("GET /{} HTTP/1.1\r\nHost: x\r\n\r\n", "x".repeat(1 << 20));
    let mut stream = server.connect();
    // The server may hang up while this is still being sent.
    let _ = stream.write_all(long.as_bytes());
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    assert!(!String::from_utf8_lossy(&answer).contains("200 OK"));
}

/// A store whose disk can be full.
#[derive(Debug)]
struct MayBeFull {
    inner: object_store::local::LocalFileSystem,
    full: Arc<AtomicBool>,
}

impl MayBeFull {
    fn check(&self) -> Result<()> {
        if !self.full.load(Ordering::SeqCst) {
            return Ok(());
        }
        let source = std::io::Error::from(std::io::ErrorKind::StorageFull);
        Err(Error::Generic { store: "test", source: Box::new(source) })
    }
}

impl Display for MayBeFull {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("MayBeFull")
    }
}

#[async_trait::async_trait]
impl ObjectStore for MayBeFull {
    async fn put_opts(&self, location: &Path, payload: PutPayload, options: PutOptions) -> Result<PutResult> {
        self.check()?;
        self.inner.put_opts(location, payload, options).await
    }
    async fn put_multipart_opts(
        &self,
        location: &Path,
        options: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        // The model itself still fits; what is made of it does not.
        self.inner.put_multipart_opts(location, options).await
    }
    async fn get_opts(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        self.inner.get_opts(location, options).await
    }
    async fn get_ranges(&self, location: &Path, ranges: &[Range<u64>]) -> Result<Vec<bytes::Bytes>> {
        self.inner.get_ranges(location, ranges).await
    }
    fn delete_stream(&self, locations: BoxStream<'static, Result<Path>>) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(locations)
    }
    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.inner.list(prefix)
    }
    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }
    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, options).await
    }
}
