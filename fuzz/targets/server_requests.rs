//! Requests to the server: method, path, headers and body, through every route, as an admin with all rights.
//!
//! An input is `METHOD PATH`, headers, an empty line, the body. `{p}` is a listing's id, `{u}` a resumable upload's, `{f}` a
//! stored file. Whatever comes, no answer is the server's own failure, and every refusal says what it is.
#![no_main]

use std::path::Path;
use std::sync::{Mutex, OnceLock};

use axum::body::Body;
use axum::http::{Request, Response, header};
use axum::{Router, body};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use libfuzzer_sys::fuzz_target;
use serde_json::{Value, json};
use server::config::{Config, PasswordCost};
use server::model::{Role, Scope};
use server::state::App;
use server::tokens::{NewToken, issue};
use tokio::runtime::Runtime;
use tower::ServiceExt;

const ASC: &str = "0 0 0 255 0 0\n10 0 5 0 255 0\n3 20 5 1 2 3\n";
const MOST_BYTES: usize = 8 << 20;

/// A server without a socket, and somebody who may do everything.
struct Shop {
    runtime: Runtime,
    router: Router,
    token: String,
    /// A listing with a model: its id and the address of a stored file.
    listing: Mutex<Option<(String, String)>>,
    _folder: tempfile::TempDir,
}

impl Shop {
    fn open() -> Self {
        // In memory where that can be: a disk's flushes would take most of the time.
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
        let folder = folder.expect("a temporary folder can be made");
        let runtime = Runtime::new().expect("a runtime can be started");
        let (router, token) = runtime.block_on(async {
            let mut config = Config::new(folder.path(), ([127, 0, 0, 1], 0).into());
            config.password_cost = PasswordCost { memory_kib: 8, passes: 1 };
            config.limits.model_bytes = 1 << 20;
            config.limits.login_burst = 1_000_000;
            let app = App::open(config).await.expect("the server opens");
            let hash = app.passwords.hash("correct horse".into()).await.expect("a password is hashed");
            let ann = app.db.insert_account("ann", &hash, Role::Admin).await.expect("an account is made");
            let new =
                NewToken { name: "fuzz".into(), scopes: vec![Scope::Upload, Scope::Manage], days: None };
            let (token, _) = issue(&app.db, &ann.id, new).await.expect("a token is made");
            (server::routes::router(app), token)
        });
        Self { runtime, router, token, listing: Mutex::new(None), _folder: folder }
    }

    fn send(&self, request: Request<Body>) -> (Response<()>, Vec<u8>) {
        self.runtime.block_on(async {
            let response = self.router.clone().oneshot(request).await.expect("a router does not fail");
            let (parts, body) = response.into_parts();
            let bytes = body::to_bytes(body, MOST_BYTES).await.expect("answers end");
            (Response::from_parts(parts, ()), bytes.to_vec())
        })
    }

    fn ask(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> (Response<()>, Value) {
        let mut request = Request::builder().method(method).uri(path);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let request = request.header("authorization", format!("Bearer {}", self.token));
        let (answer, bytes) =
            self.send(request.body(Body::from(body.to_owned())).expect("our own requests are sound"));
        (answer, serde_json::from_slice(&bytes).unwrap_or_default())
    }

    /// The listing that inputs name, made anew when one has deleted it.
    fn listing(&self) -> (String, String) {
        let mut kept = self.listing.lock().expect("nothing panics here and goes on");
        let there =
            |id: &str| self.ask("GET", &format!("/api/products/{id}"), &[], "").0.status().is_success();
        if let Some(listing) = kept.clone().filter(|(id, _)| there(id)) {
            return listing;
        }
        let json = [("content-type", "application/json")];
        let (_, product) = self.ask("POST", "/api/products", &json, r#"{"title": "Lamp"}"#);
        let id = product["id"].as_str().expect("a listing is made").to_owned();
        let model = [("content-type", "text/plain"), ("x-filename", "lamp.asc")];
        let (_, product) = self.ask("PUT", &format!("/api/products/{id}/model"), &model, ASC);
        let file = product["model"]["stream_url"].as_str().expect("a model is stored").to_owned();
        kept.insert((id, file)).clone()
    }

    fn upload(&self, product: &str) -> String {
        // The kind is "report".
        let metadata = format!("product {},kind cmVwb3J0", base64(product));
        let headers = [("upload-length", "16"), ("upload-metadata", metadata.as_str())];
        let (answer, _) = self.ask("POST", "/api/uploads", &headers, "");
        let location = answer.headers()[header::LOCATION].to_str().expect("an address is text");
        location.rsplit('/').next().unwrap_or_default().to_owned()
    }
}

fn base64(text: &str) -> String {
    STANDARD.encode(text)
}

fn shop() -> &'static Shop {
    static SHOP: OnceLock<Shop> = OnceLock::new();
    SHOP.get_or_init(Shop::open)
}

fn seeds() -> Vec<Vec<u8>> {
    let report = json!({"version": 1, "views": [{"name": "000", "used": true, "reason": null}], "points": 3,
        "dimensions_m": [0.1, 0.2, 0.3], "dimensions_uncertainty_m": [0.001, 0.001, 0.001], "warnings": ["dark"],
        "verdict": "good", "software": "0.1.0"});
    let as_json = "content-type: application/json";
    let metadata = "upload-metadata: product {b},kind bW9kZWw=,filename bW9kZWwucGx5";
    let digest = "upload-checksum: sha256 47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=";
    let texts = [
        "GET /api/products?q=lamp&category=home&page=2&per_page=5\n\n".to_owned(),
        "GET /api/manage/products?status=draft&q=a\n\n".to_owned(),
        "GET /api/products/{p}\nif-none-match: \"v1\"\n\n".to_owned(),
        format!("POST /api/products\n{as_json}\n\n{{\"title\": \"Mug\", \"description\": \"blue\", \"price_minor\": 250, \"currency\": \"EUR\", \"category\": \"home\", \"condition\": \"good\"}}"),
        format!("PATCH /api/products/{{p}}\n{as_json}\nif-match: \"v1\"\n\n{{\"title\": \"Mug\", \"price_minor\": null, \"currency\": null}}"),
        format!("POST /api/products/{{p}}/status\n{as_json}\n\n{{\"status\": \"active\"}}"),
        "DELETE /api/products/{p}\n\n".to_owned(),
        format!("PUT /api/products/{{p}}/report\n{as_json}\n\n{report}"),
        format!("PUT /api/products/{{p}}/model\nx-filename: m.asc\ncontent-type: text/plain\n\n{ASC}"),
        format!("POST /api/models?title=Lamp\ncontent-type: text/plain\n\n{ASC}"),
        "GET {f}\nrange: bytes=4-9\nif-range: \"x\"\n\n".to_owned(),
        "HEAD {f}\nrange: bytes=-5\n\n".to_owned(),
        "GET {f}\nif-none-match: W/\"abc\", *\n\n".to_owned(),
        format!("POST /api/uploads\ntus-resumable: 1.0.0\nupload-length: 16\n{metadata}\n\n"),
        format!("PATCH /api/uploads/{{u}}\ncontent-type: application/offset+octet-stream\nupload-offset: 0\n{digest}\n\n"),
        "PATCH /api/uploads/{u}\ncontent-type: application/offset+octet-stream\nupload-offset: 0\n\n{\"version\": 1   }".to_owned(),
        "HEAD /api/uploads/{u}\n\n".to_owned(),
        "DELETE /api/uploads/{u}\n\n".to_owned(),
        format!("POST /api/session\n{as_json}\norigin: http://a\nhost: a\n\n{{\"name\": \"ann\", \"password\": \"correct horse\"}}"),
        "GET /api/session\ncookie: session=abc; allround_session=def\n\n".to_owned(),
        format!("POST /api/tokens\n{as_json}\n\n{{\"name\": \"pc\", \"scopes\": [\"upload\"], \"days\": 3}}"),
        format!("POST /api/users\n{as_json}\n\n{{\"name\": \"sam\", \"password\": \"long enough password\", \"role\": \"seller\"}}"),
        "GET /p/{p}\naccept-encoding: gzip, br;q=0.5\n\n".to_owned(),
        "GET /index.html\nif-none-match: \"abc\"\n\n".to_owned(),
    ];
    texts.map(String::into_bytes).to_vec()
}

fn parse(data: &[u8], names: &mut Names) -> Option<(Request<Body>, bool)> {
    let end = data.windows(2).position(|pair| pair == b"\n\n")?;
    let (head, body) = (std::str::from_utf8(&data[..end]).ok()?, &data[end + 2..]);
    let head = names.fill(head);
    let mut lines = head.split('\n');
    let (method, path) = lines.next()?.split_once(' ')?;
    let is_api = path.starts_with("/api/");
    let mut request = Request::builder().method(method).uri(path);
    for (name, value) in lines.filter_map(|line| line.split_once(": ")) {
        request = request.header(name, value);
    }
    if !request.headers_ref()?.contains_key("authorization") && !head.contains("cookie") {
        request = request.header("authorization", format!("Bearer {}", shop().token));
    }
    request.body(Body::from(body.to_vec())).ok().map(|request| (request, is_api))
}

/// A resumable upload that an input names, given up after it.
#[derive(Default)]
struct Names(Option<String>);

impl Names {
    fn fill(&mut self, text: &str) -> String {
        if !["{p}", "{f}", "{u}", "{b}"].iter().any(|name| text.contains(name)) {
            return text.to_owned();
        }
        let (product, file) = shop().listing();
        let text = text.replace("{p}", &product).replace("{f}", &file).replace("{b}", &base64(&product));
        if !text.contains("{u}") {
            return text;
        }
        text.replace("{u}", self.0.insert(shop().upload(&product)))
    }
}

impl Drop for Names {
    fn drop(&mut self) {
        if let Some(upload) = &self.0 {
            shop().ask("DELETE", &format!("/api/uploads/{upload}"), &[], "");
        }
    }
}

fuzz_target!(init: fuzz::write_seeds(seeds), |data: &[u8]| {
    let mut names = Names::default();
    let Some((request, is_api)) = parse(data, &mut names) else { return };
    let is_head = request.method() == "HEAD";
    let (answer, bytes) = shop().send(request);
    let status = answer.status();
    assert!(!status.is_server_error(), "{status}: {}", String::from_utf8_lossy(&bytes));
    if status.is_client_error() && is_api && !is_head {
        let problem: Value = serde_json::from_slice(&bytes).unwrap_or_default();
        assert!(problem["detail"].as_str().is_some_and(|detail| !detail.is_empty()), "{status} without a reason");
    }
});
