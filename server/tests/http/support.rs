//! A server in this process, people who use it, and a client that hides nothing.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use server::config::{Config, PasswordCost};
use server::model::{Role, Scope};
use server::state::App;
use server::storage::Storage;
use server::tokens::{NewToken, issue};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use ureq::Agent;

pub(crate) const PASSWORD: &str = "correct horse battery";
/// No test waits longer than this for what must happen.
const PATIENCE: Duration = Duration::from_secs(20);

/// Three points.
pub(crate) const ASC: &str = "0.0 0.0 0.0 255 0 0\n10.0 0.0 5.0 0 255 0\n3.0 20.0 5.0 1 2 3\n";

pub(crate) struct Server {
    pub address: SocketAddr,
    pub app: App,
    pub folder: TempDir,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    agent: Agent,
}

/// Who asks.
#[derive(Debug, Clone)]
pub(crate) enum Who {
    Nobody,
    Cookie(String),
    Token(String),
}

pub(crate) struct Answer {
    pub status: u16,
    pub headers: ureq::http::HeaderMap,
    pub body: Vec<u8>,
}

impl Answer {
    pub(crate) fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&self.body)))
    }

    pub(crate) fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().unwrap())
    }

    /// The status was this one.
    #[track_caller]
    pub(crate) fn expect(self, status: u16) -> Self {
        assert_eq!(self.status, status, "{}", String::from_utf8_lossy(&self.body));
        self
    }

    /// A refusal with that code, in the right form.
    #[track_caller]
    pub(crate) fn refused(self, status: u16, code: &str) -> Self {
        let answer = self.expect(status);
        assert_eq!(answer.header("content-type"), "application/problem+json");
        let problem = answer.json();
        assert_eq!(problem["code"], code, "{problem}");
        assert_eq!(problem["status"], status);
        assert_eq!(problem["request_id"], answer.header("x-request-id"));
        assert!(problem["detail"].as_str().is_some_and(|detail| detail.len() > 10));
        answer
    }
}

pub(crate) fn quick_config(folder: &TempDir) -> Config {
    let mut config = Config::new(folder.path(), ([127, 0, 0, 1], 0).into());
    config.password_cost = PasswordCost { memory_kib: 8, passes: 1 };
    config.limits.login_burst = 1000;
    config
}

impl Server {
    pub(crate) fn start() -> Self {
        Self::start_with(|_| ())
    }

    pub(crate) fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let storage = Storage::folder(&folder.path().join("files")).unwrap();
        Self::start_over(folder, storage, change)
    }

    pub(crate) fn start_over(folder: TempDir, storage: Storage, change: impl FnOnce(&mut Config)) -> Self {
        let mut config = quick_config(&folder);
        change(&mut config);
        let (stop, stopped) = oneshot::channel();
        let (ready, is_ready) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            let runtime =
                tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
            runtime.block_on(async move {
                let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
                let app = App::with_storage(config, storage).await.unwrap();
                for (name, role) in [("ann", Role::Admin), ("sam", Role::Seller), ("sue", Role::Seller)] {
                    let hash = app.passwords.hash(PASSWORD.into()).await.unwrap();
                    app.db.insert_account(name, &hash, role).await.unwrap();
                }
                ready.send((listener.local_addr().unwrap(), app.clone())).unwrap();
                server::serve::serve(listener, app, async { drop(stopped.await) }).await;
            });
        });
        let (address, app) = is_ready.recv().unwrap();
        let agent = Agent::config_builder().http_status_as_error(false).max_redirects(0).build().new_agent();
        Self { address, app, folder, stop: Some(stop), thread: Some(thread), agent }
    }

    /// Tells the server to stop; `wait` waits for its end.
    pub(crate) fn stop(&mut self) {
        drop(self.stop.take());
    }

    pub(crate) fn wait(&mut self) {
        self.thread.take().unwrap().join().unwrap();
    }

    pub(crate) fn block_on<T>(&self, work: impl Future<Output = T>) -> T {
        tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap().block_on(work)
    }

    /// A token of that account.
    pub(crate) fn token(&self, name: &str, scopes: &[Scope]) -> Who {
        let (text, _) = self.block_on(async {
            let account = self.app.db.account_by_name(name).await.unwrap().unwrap();
            let new = NewToken { name: "test".into(), scopes: scopes.to_vec(), days: None };
            issue(&self.app.db, &account.id, new).await.unwrap()
        });
        Who::Token(text)
    }

    /// A token that may do everything.
    pub(crate) fn manager(&self, name: &str) -> Who {
        self.token(name, &[Scope::Manage])
    }

    pub(crate) fn log_in(&self, name: &str) -> Who {
        let body = json!({"name": name, "password": PASSWORD});
        let answer = self.send("POST", "/api/session", &Who::Nobody, &[], Some(body)).expect(200);
        Who::Cookie(cookie_of(&answer))
    }

    /// With headers of our choosing and a JSON body.
    pub(crate) fn send(
        &self,
        method: &str,
        path: &str,
        who: &Who,
        headers: &[(&str, &str)],
        body: Option<Value>,
    ) -> Answer {
        let mut headers = headers.to_vec();
        let bytes = body.map(|body| body.to_string().into_bytes());
        if bytes.is_some() {
            headers.push(("content-type", "application/json"));
        }
        self.raw(method, path, who, &headers, bytes.unwrap_or_default())
    }

    /// With headers of our choosing and any body.
    pub(crate) fn raw(
        &self,
        method: &str,
        path: &str,
        who: &Who,
        headers: &[(&str, &str)],
        body: Vec<u8>,
    ) -> Answer {
        let mut request =
            ureq::http::Request::builder().method(method).uri(format!("http://{}{path}", self.address));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        request = match who {
            Who::Nobody => request,
            Who::Cookie(cookie) => request.header("cookie", cookie),
            Who::Token(token) => request.header("authorization", format!("Bearer {token}")),
        };
        let mut answer = self.agent.run(request.body(body).unwrap()).unwrap();
        let body = answer.body_mut().read_to_vec().unwrap();
        Answer { status: answer.status().as_u16(), headers: answer.headers().clone(), body }
    }

    pub(crate) fn get(&self, path: &str, who: &Who) -> Answer {
        self.raw("GET", path, who, &[], Vec::new())
    }

    pub(crate) fn post(&self, path: &str, who: &Who, body: Value) -> Answer {
        self.send("POST", path, who, &[("sec-fetch-site", "same-origin")], Some(body))
    }

    /// A draft; its JSON.
    pub(crate) fn draft(&self, who: &Who, title: &str) -> Value {
        self.post("/api/products", who, json!({"title": title})).expect(201).json()
    }

    /// A draft with a small model; its id.
    pub(crate) fn draft_with_model(&self, who: &Who, title: &str) -> String {
        let id = id_of(&self.draft(who, title));
        self.raw("PUT", &format!("/api/products/{id}/model"), who, &[], ASC.into()).expect(200);
        id
    }

    /// A public listing; its JSON.
    pub(crate) fn active(&self, who: &Who, title: &str) -> Value {
        let id = self.draft_with_model(who, title);
        let admin = self.manager("ann");
        self.post(&format!("/api/products/{id}/status"), &admin, json!({"status": "active"}))
            .expect(200)
            .json()
    }

    /// A connection of our own.
    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Names of all stored files.
    pub(crate) fn stored(&self) -> Vec<String> {
        let mut names = Vec::new();
        let mut folders = vec![self.folder.path().join("files/objects")];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).into_iter().flatten() {
                let entry = entry.unwrap();
                if entry.file_type().unwrap().is_dir() {
                    folders.push(entry.path());
                } else {
                    names.push(entry.file_name().into_string().unwrap());
                }
            }
        }
        names.sort();
        names
    }

    /// Names of all bodies that are still kept.
    pub(crate) fn spooled(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path().join("spool")).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop();
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            assert!(ended.is_ok() || std::thread::panicking(), "the server panicked");
        }
    }
}

pub(crate) fn id_of(product: &Value) -> String {
    product["id"].as_str().unwrap().to_string()
}

pub(crate) fn cookie_of(answer: &Answer) -> String {
    answer.header("set-cookie").split(';').next().unwrap().to_string()
}

/// Asks again and again until it is so; what must happen happens long before patience ends.
#[track_caller]
pub(crate) fn until(what: &str, mut so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !so() {
        assert!(started.elapsed() < PATIENCE, "{what} did not happen");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The head of a request of our own, with a token.
pub(crate) fn head_of(method: &str, path: &str, who: &Who, headers: &[(&str, &str)]) -> String {
    let Who::Token(token) = who else { panic!("a token") };
    let mut text = format!(
        "{method} {path} HTTP/1.1\r\nHost: test\r\nConnection: close\r\nAuthorization: Bearer {token}\r\n"
    );
    for (name, value) in headers {
        text.push_str(&[name, ": ", value, "\r\n"].concat());
    }
    text + "\r\n"
}

/// Sends the bytes and reads all that comes back.
pub(crate) fn exchange(stream: &mut TcpStream, bytes: &[u8]) -> String {
    stream.write_all(bytes).unwrap();
    read_all(stream)
}

pub(crate) fn read_all(stream: &mut TcpStream) -> String {
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}
