//! Around every request: an id, one line of log, counts, security headers, and the body of problems.

use std::sync::OnceLock;
use std::time::Instant;

use axum::body::Body;
use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::Response;
use metrics_exporter_prometheus::{PrometheusBuilder, PrometheusHandle};

use crate::error::{Problem, Told};

/// What pages may load: only what this server serves, nothing inline.
const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
    connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'; \
    worker-src 'self' blob:";

/// Headers of every response that does not set them itself.
const HEADERS: [(&str, &str); 6] = [
    ("content-security-policy", CONTENT_SECURITY_POLICY),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "same-origin"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
];

/// Longest request id taken over from a proxy.
const ID_CHARS: usize = 64;

/// The recorder of this process; several servers in one process (tests) share it.
pub fn metrics_handle() -> PrometheusHandle {
    static HANDLE: OnceLock<PrometheusHandle> = OnceLock::new();
    HANDLE
        .get_or_init(|| {
            let recorder = PrometheusBuilder::new().build_recorder();
            let handle = recorder.handle();
            if metrics::set_global_recorder(recorder).is_err() {
                tracing::warn!("another metrics recorder is installed; /metrics stays empty");
            }
            handle
        })
        .clone()
}

/// The middleware.
pub async fn observe(request: Request, next: Next) -> Response {
    let started = Instant::now();
    let id = request_id(&request);
    let method = request.method().clone();
    let path = request.uri().path().to_string();
    let route =
        request.extensions().get::<MatchedPath>().map_or("none".to_string(), |m| m.as_str().to_string());
    let mut response = next.run(request).await;
    let cause = write_problem(&mut response, &path, &id);
    let status = response.status().as_u16();
    let millis = started.elapsed().as_secs_f64() * 1000.0;
    // Anybody can invent methods; only known ones are counted apart.
    let known = [
        Method::GET,
        Method::HEAD,
        Method::POST,
        Method::PUT,
        Method::PATCH,
        Method::DELETE,
        Method::OPTIONS,
    ];
    let counted = if known.contains(&method) { method.as_str() } else { "other" };
    let labels = [("method", counted.to_string()), ("route", route), ("status", status.to_string())];
    metrics::counter!("http_requests_total", &labels).increment(1);
    metrics::histogram!("http_request_duration_seconds", &labels[..2]).record(millis / 1000.0);
    if let Some(cause) = cause {
        tracing::error!(request_id = id, %method, path, status, millis, cause, "request failed");
    } else {
        tracing::info!(request_id = id, %method, path, status, millis, "request");
    }
    for (name, value) in HEADERS {
        response.headers_mut().entry(name).or_insert(HeaderValue::from_static(value));
    }
    if let Ok(value) = HeaderValue::from_str(&id) {
        response.headers_mut().insert("x-request-id", value);
    }
    response
}

fn request_id(request: &Request) -> String {
    let sent = request.headers().get("x-request-id").and_then(|value| value.to_str().ok());
    let good = |id: &&str| {
        (1..=ID_CHARS).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-')
    };
    sent.filter(good).map_or_else(crate::model::new_id, str::to_string)
}

/// Writes the body of an error; returns its cause where it is to be logged.
fn write_problem(response: &mut Response, path: &str, id: &str) -> Option<String> {
    let status = response.status();
    let told = response.extensions_mut().remove::<Told>();
    let plain_error = (status.is_client_error() || status.is_server_error())
        && response.headers().get(header::CONTENT_TYPE).is_none_or(|t| t != "application/problem+json")
        && path.starts_with("/api");
    let told = match told {
        Some(told) => told,
        None if plain_error => generic(status),
        None => return None,
    };
    let problem = Problem {
        kind: "about:blank",
        title: status.canonical_reason().unwrap_or("Error").to_string(),
        status: status.as_u16(),
        detail: told.detail,
        code: told.code.to_string(),
        request_id: id.to_string(),
    };
    let body = serde_json::to_vec(&problem).unwrap_or_default();
    response.headers_mut().remove(header::CONTENT_LENGTH);
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
    response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    *response.body_mut() = Body::from(body);
    told.cause
}

/// Words for errors that the framework answered by itself.
fn generic(status: StatusCode) -> Told {
    let (code, detail) = match status {
        StatusCode::METHOD_NOT_ALLOWED => ("method_not_allowed", "This address does not take that method."),
        StatusCode::NOT_FOUND => ("not_found", "There is nothing at this address."),
        status if status.is_server_error() => {
            ("internal", "Something went wrong inside the server. Try again.")
        }
        _ => ("bad_request", "The request cannot be used; compare it with /api/openapi.json."),
    };
    let cause = status.is_server_error().then(|| "a handler panicked".to_string());
    Told { code, detail: detail.to_string(), cause }
}
