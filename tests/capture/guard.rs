//! Nobody else gives orders: token, origin and host.

use serde_json::{Value, json};

use super::daemon::Daemon;

type Headers<'a> = &'a [(&'a str, &'a str)];

fn status(daemon: &Daemon, method: &str, path: &str, headers: Headers) -> u16 {
    let address = format!("{}{path}", daemon.base);
    let mut answer = if method == "GET" {
        let request =
            headers.iter().fold(daemon.agent.get(address), |r, (name, value)| r.header(*name, *value));
        request.call().unwrap()
    } else {
        let request =
            headers.iter().fold(daemon.agent.post(address), |r, (name, value)| r.header(*name, *value));
        request.send_json(json!({})).unwrap()
    };
    let status = answer.status().as_u16();
    if status == 403 {
        assert_eq!(answer.headers()["content-type"], "application/problem+json", "{method} {path}");
        let problem: Value = answer.body_mut().read_json().unwrap();
        assert!(problem["detail"].as_str().is_some_and(|text| text.ends_with('.')), "{problem}");
        assert!(!problem.to_string().contains(&daemon.token));
    }
    status
}

#[test]
fn orders_need_the_token_the_own_origin_and_the_own_host() {
    let out = tempfile::tempdir().unwrap();
    let daemon = Daemon::capture(out.path(), "simulated:bowl");
    let good = daemon.bearer();
    let authority = daemon.base.strip_prefix("http://").unwrap().to_owned();
    let port = authority.rsplit(':').next().unwrap();
    let wrong = format!("Bearer {}", "0".repeat(64));
    let half = format!("Bearer {}", &daemon.token[..32]);
    for (method, path) in
        [("GET", "/api/state"), ("POST", "/api/build"), ("GET", "/api/live"), ("GET", "/api/nothing")]
    {
        let check = |headers: Headers, expected: bool| {
            let status = status(&daemon, method, path, headers);
            assert_eq!(status == 403, !expected, "{method} {path} {headers:?}: {status}");
        };
        check(&[], false);
        check(&[("authorization", &wrong)], false);
        check(&[("authorization", &half)], false);
        check(&[("authorization", &daemon.token)], false);
        check(&[("authorization", &good)], true);
        check(&[("authorization", &good), ("origin", &daemon.base)], true);
        check(&[("authorization", &good), ("origin", &format!("http://localhost:{port}"))], true);
        for origin in ["https://evil.example", "null", "http://127.0.0.1:1", &format!("https://{authority}")]
        {
            check(&[("authorization", &good), ("origin", origin)], false);
        }
        for host in [
            "evil.example",
            &format!("evil.example:{port}"),
            "127.0.0.1:1",
            &format!("127.0.0.1.evil.example:{port}"),
        ] {
            check(&[("authorization", &good), ("host", host)], false);
        }
    }
    let with_token = |path: &str| format!("{path}?token={}", daemon.token);
    assert_eq!(status(&daemon, "GET", &with_token("/api/state"), &[]), 200);
    assert_eq!(status(&daemon, "GET", "/api/state?token=0", &[]), 403);
    assert_eq!(status(&daemon, "POST", &with_token("/api/build"), &[]), 403, "a form can name an address");
}

#[test]
fn the_page_needs_no_token_and_carries_a_strict_policy() {
    let out = tempfile::tempdir().unwrap();
    let daemon = Daemon::capture(out.path(), "simulated:bowl");
    let answer = daemon.agent.get(format!("{}/", daemon.base)).call().unwrap();
    assert_eq!(answer.status(), 200);
    let policy = answer.headers()["content-security-policy"].to_str().unwrap();
    let own = daemon.base.replace("http://", "ws://");
    for part in [
        "default-src 'none'",
        "script-src 'self'",
        "frame-ancestors 'none'",
        &format!("connect-src 'self' {own};"),
    ] {
        assert!(policy.contains(part), "{part}: {policy}");
    }
    assert!(!policy.contains("unsafe"), "{policy}");
    assert_eq!(answer.headers()["x-content-type-options"], "nosniff");
    let foreign = daemon.agent.get(format!("{}/", daemon.base)).header("host", "evil.example");
    assert_eq!(foreign.call().unwrap().status(), 403);
    for path in ["/../Cargo.toml", "/%2e%2e/%2e%2e/etc/passwd", "/nothing.js"] {
        assert_eq!(
            daemon.agent.get(format!("{}{path}", daemon.base)).call().unwrap().status(),
            404,
            "{path}"
        );
    }
}

#[test]
fn orders_that_make_no_sense_are_refused_in_words() {
    let out = tempfile::tempdir().unwrap();
    let daemon = Daemon::capture(out.path(), "simulated:bowl");
    let refused = |path: &str, body: Value, status: u16, words: &str| {
        let said = daemon.refused(path, &body, status);
        assert!(said.contains(words), "{path}: {said}");
    };
    refused("/api/views", json!({}), 409, "board");
    refused("/api/build", json!({}), 409, "at least one view");
    refused("/api/build/cancel", json!({}), 409, "Nothing is being built");
    refused("/api/step", json!({"step": "result"}), 409, "Build the model first");
    refused("/api/step", json!({"step": "nowhere"}), 422, "step");
    refused("/api/sensor", json!({"address": "simulated:unicorn"}), 404, "unicorn");
    daemon.order("/api/sensor", &json!({"address": "simulated:bowl"}));
    refused("/api/control", json!({"what": "tilt", "value": 0.1}), 422, "cannot do that");
    refused("/api/board", json!({}), 422, "paper");
    refused("/api/board", json!({"file": {"version": 1, "family": "qr", "tags": []}}), 422, "family");
    refused("/api/auto", json!({"mode": "timer", "seconds": 0}), 422, "seconds");
    refused("/api/model/undo", json!({}), 409, "model");
    refused(
        "/api/publish",
        json!({"server": "http://127.0.0.1:9", "token": "t", "title": "T"}),
        409,
        "model",
    );
    // The refusal comes before all is sent, so the line may be closed under the sender's hands.
    let too_large = daemon.post_bytes("/api/board", "application/json", &vec![b' '; 3 << 20]);
    assert!(matches!(too_large, Ok((413, _)) | Err(_)), "{too_large:?}");
    assert_eq!(daemon.get("/api/preview").0, 404);
    assert_eq!(daemon.get("/api/model").0, 404);
    let (status, pdf) = daemon.get("/api/boards/a3.pdf");
    assert!(status == 200 && pdf.starts_with(b"%PDF"));
    assert_eq!(daemon.get("/api/boards/a9.pdf").0, 404);
}
