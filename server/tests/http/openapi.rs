//! The committed description of the API is the one the code gives. `UPDATE_SNAPSHOTS=1` writes it anew.

use super::support::{Server, Who};

#[test]
fn the_snapshot_agrees_with_the_code() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi.json");
    let text = server::routes::openapi_json();
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        std::fs::write(file, &text).unwrap();
    }
    let committed = std::fs::read_to_string(file).unwrap();
    assert!(committed == text, "server/openapi.json is old; write it anew with UPDATE_SNAPSHOTS=1");
}

#[test]
fn it_is_served() {
    let server = Server::start();
    let answer = server.get("/api/openapi.json", &Who::Nobody).expect(200);
    assert_eq!(answer.body, server::routes::openapi_json().into_bytes());
    assert!(answer.json()["paths"]["/api/products/{id}"]["patch"].is_object());
}

#[test]
fn health_readiness_and_counts() {
    let server = Server::start();
    server.get("/healthz", &Who::Nobody).expect(200);
    server.get("/readyz", &Who::Nobody).expect(200);
    let counts = server.get("/metrics", &Who::Nobody).expect(200);
    let text = String::from_utf8(counts.body).unwrap();
    assert!(text.contains(r#"http_requests_total{method="GET",route="/readyz",status="200"}"#), "{text}");
}

#[test]
fn pages_are_guarded() {
    let server = Server::start();
    for path in ["/", "/p/some-id", "/manage", "/setup?token=x"] {
        let page = server.get(path, &Who::Nobody).expect(200);
        assert!(page.header("content-type").starts_with("text/html"));
        let policy = page.header("content-security-policy");
        assert!(policy.contains("default-src 'none'") && !policy.contains("unsafe"), "{policy}");
        assert_eq!(page.header("x-content-type-options"), "nosniff");
        let text = String::from_utf8(page.body).unwrap();
        assert!(!text.contains("<style") && !text.contains(" style="), "nothing inline");
    }
    for path in ["/assets/none.js", "/../Cargo.toml", "/favicon-none.ico", "/%2e%2e/%2e%2e/etc/passwd"] {
        let answer = server.get(path, &Who::Nobody);
        assert!(answer.status == 404 || answer.header("content-type").starts_with("text/html"), "{path}");
    }
    server.get("/api/none", &Who::Nobody).refused(404, "not_found");
    server.raw("PUT", "/api/session", &Who::Nobody, &[], vec![]).refused(405, "method_not_allowed");
}
