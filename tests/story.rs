//! From a built model to a listing that a buyer turns round: the seller's command, the server, the admin, the public.

#![allow(clippy::unwrap_used, reason = "helpers of tests, too")]

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use clap::Parser;
use reconstruct::cloud::PointCloud;
use reconstruct::mesh::Mesh;
use reconstruct::{model_file, stream};
use scanner::cli::Cli;
use scanner::ui::Ui;
use scanner::upload::{Destination, Listing, STATE_FILE, Token, UploadError, publish};
use serde_json::{Value, json};
use server::config::{Config, PasswordCost};
use server::model::{Role, Scope};
use server::state::App;
use server::tokens::{NewToken, issue};

const POINTS: usize = 20_000;

/// A real product server with a seller and an admin.
pub(crate) struct Shop {
    pub(crate) address: SocketAddr,
    pub(crate) seller: String,
    pub(crate) admin: String,
    stop: Option<tokio::sync::oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    agent: ureq::Agent,
    _data: tempfile::TempDir,
}

impl Shop {
    pub(crate) fn open() -> Self {
        let data = tempfile::tempdir().unwrap();
        let mut config = Config::new(data.path(), ([127, 0, 0, 1], 0).into());
        config.password_cost = PasswordCost { memory_kib: 8, passes: 1 };
        let (stop, stopped) = tokio::sync::oneshot::channel();
        let (ready, is_ready) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            let runtime =
                tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
            runtime.block_on(async move {
                let app = App::open(config).await.unwrap();
                let seller = token(&app, "sam", Role::Seller, Scope::Upload).await;
                let admin = token(&app, "ann", Role::Admin, Scope::Manage).await;
                let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
                ready.send((listener.local_addr().unwrap(), seller, admin)).unwrap();
                server::serve::serve(listener, app, async { drop(stopped.await) }).await;
            });
        });
        let (address, seller, admin) = is_ready.recv().unwrap();
        let agent = ureq::Agent::config_builder().http_status_as_error(false).build().new_agent();
        Self { address, seller, admin, stop: Some(stop), thread: Some(thread), agent, _data: data }
    }

    pub(crate) fn get(&self, path: &str, token: Option<&str>) -> (u16, Vec<u8>) {
        let mut request = self.agent.get(format!("http://{}{path}", self.address));
        if let Some(token) = token {
            request = request.header("authorization", format!("Bearer {token}"));
        }
        let mut answer = request.call().unwrap();
        (answer.status().as_u16(), answer.body_mut().read_to_vec().unwrap())
    }

    pub(crate) fn json(&self, path: &str, token: Option<&str>) -> Value {
        let (status, body) = self.get(path, token);
        assert_eq!(status, 200, "{path}");
        serde_json::from_slice(&body).unwrap()
    }

    pub(crate) fn activate(&self, id: &str, token: &str) -> u16 {
        let request = self.agent.post(format!("http://{}/api/products/{id}/status", self.address));
        let request = request.header("authorization", format!("Bearer {token}"));
        request.send_json(json!({"status": "active"})).unwrap().status().as_u16()
    }
}

impl Drop for Shop {
    fn drop(&mut self) {
        drop(self.stop.take());
        let ended = self.thread.take().unwrap().join();
        assert!(ended.is_ok() || std::thread::panicking(), "the server panicked");
    }
}

async fn token(app: &App, name: &str, role: Role, scope: Scope) -> String {
    let hash = app.passwords.hash("correct horse battery".into()).await.unwrap();
    let account = app.db.insert_account(name, &hash, role).await.unwrap();
    let new = NewToken { name: "test".into(), scopes: vec![scope], days: None };
    issue(&app.db, &account.id, new).await.unwrap().0
}

/// What `scan-product build` would have written.
fn built(folder: &Path) -> Vec<u8> {
    let mut rng = fastrand::Rng::with_seed(3);
    let points: Vec<[f32; 3]> =
        (0..POINTS).map(|_| [rng.f32() * 0.1, rng.f32() * 0.08, rng.f32() * 0.2]).collect();
    let colors = points.iter().map(|p| p.map(|v| (v * 1000.0) as u8)).collect();
    let mesh = Mesh {
        vertices: PointCloud { points, colors, normals: vec![] },
        triangles: vec![],
        ..Mesh::default()
    };
    let mut model = Vec::new();
    model_file::ply::write(&mesh, &mut model).unwrap();
    std::fs::write(folder.join("model.ply"), &model).unwrap();
    let picture = reconstruct::image::ColorImage::filled(64, 48, [200, 30, 30]);
    std::fs::write(folder.join("poster.png"), scanner::pictures::encode_color(&picture).unwrap()).unwrap();
    let report = json!({"version": 1, "views": [{"name": "000", "used": true}], "dimensions_m": [0.1, 0.08, 0.2],
        "verdict": "good", "warnings": []});
    std::fs::write(folder.join("report.json"), report.to_string()).unwrap();
    model
}

/// A line between client and server that breaks, or halts, when its budget of bytes is used up.
struct Line {
    address: SocketAddr,
    left: Arc<AtomicI64>,
    sent: Arc<AtomicI64>,
}

/// What a line does when its budget is used up.
#[derive(Clone, Copy)]
enum AtEnd {
    Break,
    Halt,
}

impl Line {
    fn to(server: SocketAddr, at_end: AtEnd) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let line = Self {
            address: listener.local_addr().unwrap(),
            left: Arc::new(AtomicI64::new(i64::MAX)),
            sent: Arc::default(),
        };
        let (left, sent) = (line.left.clone(), line.sent.clone());
        // Ends with the test's process.
        std::thread::spawn(move || {
            for client in listener.incoming() {
                let (client, left, sent) = (client.unwrap(), left.clone(), sent.clone());
                let Ok(server) = TcpStream::connect(server) else { continue };
                let (back_from, back_to) = (server.try_clone().unwrap(), client.try_clone().unwrap());
                std::thread::spawn(move || {
                    forward(&back_from, &back_to, &AtomicI64::new(i64::MAX), &AtomicI64::new(0), at_end);
                });
                std::thread::spawn(move || forward(&client, &server, &left, &sent, at_end));
            }
        });
        line
    }
}

fn forward(mut from: &TcpStream, mut to: &TcpStream, left: &AtomicI64, sent: &AtomicI64, at_end: AtEnd) {
    let mut piece = [0; 8192];
    while let Ok(n @ 1..) = from.read(&mut piece) {
        if matches!(at_end, AtEnd::Halt) && left.load(Ordering::SeqCst) < n as i64 {
            left.store(0, Ordering::SeqCst);
            // The connection stands and nothing moves until the line is mended; then it is found broken.
            while left.load(Ordering::SeqCst) == 0 {
                std::thread::sleep(Duration::from_millis(5));
            }
            break;
        }
        if left.fetch_sub(n as i64, Ordering::SeqCst) < n as i64 || to.write_all(&piece[..n]).is_err() {
            break;
        }
        sent.fetch_add(n as i64, Ordering::SeqCst);
    }
    let _ = (from.shutdown(Shutdown::Both), to.shutdown(Shutdown::Both));
}

fn destination(address: SocketAddr, token: &str, attempts: u32) -> Destination {
    let mut destination = Destination::new(format!("http://{address}"), Token::new(token).unwrap());
    (destination.attempts, destination.first_pause) = (attempts, Duration::from_millis(10));
    destination
}

fn mug() -> Listing {
    Listing { title: "Blue mug".into(), price: Some((2500, "EUR".into())), ..Listing::default() }
}

#[test]
fn a_seller_uploads_an_admin_activates_and_the_public_sees() {
    let shop = Shop::open();
    let out = tempfile::tempdir().unwrap();
    let model = built(out.path());
    let to = destination(shop.address, &shop.seller, 2);
    let published = publish(out.path(), &to, &mug(), &Ui::silent()).unwrap();
    assert_eq!(published.url, format!("http://{}/p/{}", shop.address, published.product_id));
    assert_eq!(published.status, "draft");
    assert!(!out.path().join(STATE_FILE).exists());
    let path = format!("/api/products/{}", published.product_id);
    assert_eq!(shop.get(&path, None).0, 404);
    assert_eq!(shop.activate(&published.product_id, &shop.seller), 403);
    assert_eq!(shop.activate(&published.product_id, &shop.admin), 200);
    let product = shop.json(&path, None);
    assert_eq!((&product["title"], &product["price_minor"]), (&json!("Blue mug"), &json!(2500)));
    assert_eq!((&product["verdict"], &product["dimensions_m"]), (&json!("good"), &json!([0.1, 0.08, 0.2])));
    assert_eq!(shop.get(product["model"]["original_url"].as_str().unwrap(), None), (200, model));
    let (_, bytes) = shop.get(product["model"]["stream_url"].as_str().unwrap(), None);
    let (header, _) = stream::decode(&bytes).unwrap();
    assert_eq!(header.points as usize, POINTS);
    let (status, picture) = shop.get(product["poster_url"].as_str().unwrap(), None);
    assert!(status == 200 && picture.starts_with(&[0xff, 0xd8]));
    assert_eq!(shop.json("/api/products", None)["total"], 1);
}

#[test]
fn a_broken_connection_is_gone_on_with_at_once() {
    let shop = Shop::open();
    let out = tempfile::tempdir().unwrap();
    built(out.path());
    let line = Line::to(shop.address, AtEnd::Break);
    line.left.store(150_000, Ordering::SeqCst);
    let mended = line.left.clone();
    let mender = std::thread::spawn(move || {
        while mended.load(Ordering::SeqCst) > 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
        mended.store(i64::MAX, Ordering::SeqCst);
    });
    publish(out.path(), &destination(line.address, &shop.seller, 10), &mug(), &Ui::silent()).unwrap();
    mender.join().unwrap();
}

#[test]
fn the_command_started_again_goes_on_where_it_stopped() {
    let shop = Shop::open();
    let out = tempfile::tempdir().unwrap();
    let bytes = built(out.path()).len() as i64;
    let line = Line::to(shop.address, AtEnd::Break);
    line.left.store(bytes / 2, Ordering::SeqCst);
    let to = destination(line.address, &shop.seller, 2);
    let broken = publish(out.path(), &to, &mug(), &Ui::silent()).unwrap_err();
    assert!(matches!(broken, UploadError::NoConnection { .. }), "{broken}");
    assert!(broken.to_string().contains("run the same command again"), "{broken}");
    let state = std::fs::read_to_string(out.path().join(STATE_FILE)).unwrap();
    assert!(!state.contains(&shop.seller), "no token on the disk");
    line.left.store(i64::MAX, Ordering::SeqCst);
    line.sent.store(0, Ordering::SeqCst);
    let published =
        publish(out.path(), &destination(line.address, &shop.seller, 10), &mug(), &Ui::silent()).unwrap();
    assert!(line.sent.load(Ordering::SeqCst) < bytes * 9 / 10, "only the rest was sent");
    let mine = shop.json("/api/manage/products", Some(&shop.seller));
    assert_eq!((&mine["total"], &mine["items"][0]["id"]), (&json!(1), &json!(published.product_id)));
}

#[cfg(unix)]
#[test]
fn an_upload_interrupted_by_ctrl_c_is_gone_on_with() {
    let shop = Shop::open();
    let out = tempfile::tempdir().unwrap();
    let bytes = built(out.path()).len() as i64;
    let line = Line::to(shop.address, AtEnd::Halt);
    line.left.store(bytes / 2, Ordering::SeqCst);
    let folder = out.path().to_str().unwrap().to_owned();
    let upload = |address: SocketAddr| {
        let mut command = crate::cli::support::command();
        command.args(["upload", &folder, "--title", "Mug", "--server", &format!("http://{address}")]);
        command.env("ALLROUND_TOKEN", &shop.seller).stderr(std::process::Stdio::piped());
        command.spawn().unwrap()
    };
    let mut child = upload(line.address);
    while line.left.load(Ordering::SeqCst) > 0 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before the line halted");
        std::thread::sleep(Duration::from_millis(2));
    }
    let killed = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.unwrap().success());
    let ended = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(130), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    line.left.store(i64::MAX, Ordering::SeqCst);
    let again = upload(line.address).wait_with_output().unwrap();
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    let mine = shop.json("/api/manage/products", Some(&shop.seller));
    assert_eq!(mine["total"], json!(1));
    let id = mine["items"][0]["id"].as_str().unwrap();
    let listing = shop.json(&format!("/api/products/{id}"), Some(&shop.seller));
    assert_eq!(listing["model"]["points"], json!(POINTS));
}

#[test]
fn refusals_are_told_in_the_servers_words() {
    let shop = Shop::open();
    let out = tempfile::tempdir().unwrap();
    let fails = |token: &str| {
        publish(out.path(), &destination(shop.address, token, 2), &mug(), &Ui::silent())
            .unwrap_err()
            .to_string()
    };
    assert!(fails(&shop.seller).contains("no model"), "an empty folder");
    std::fs::write(out.path().join("model.asc"), "0 0 0 1 2 3\nnan 0 0 1 2 3\n").unwrap();
    assert!(fails("arp_wrong").contains("does not accept the upload token"));
    let refused = fails(&shop.seller);
    assert!(refused.contains("refused to take the model") && refused.contains('2'), "{refused}");
    std::fs::write(out.path().join("model.asc"), "0 0 0 1 2 3\n").unwrap();
    let published =
        publish(out.path(), &destination(shop.address, &shop.seller, 2), &mug(), &Ui::silent()).unwrap();
    let mine = shop.json("/api/manage/products", Some(&shop.seller));
    assert_eq!((&mine["total"], &mine["items"][0]["id"]), (&json!(1), &json!(published.product_id)));
}

#[test]
fn the_command_line_reads_the_token_from_a_file() {
    let shop = Shop::open();
    let out = tempfile::tempdir().unwrap();
    built(out.path());
    let token_file = out.path().join("token");
    std::fs::write(&token_file, format!("{}\n", shop.seller)).unwrap();
    let server = format!("http://{}", shop.address);
    let args = [
        "scan-product",
        "-q",
        "upload",
        out.path().to_str().unwrap(),
        "--server",
        &server,
        "--title",
        "Mug",
        "--price",
        "25.00",
        "--currency",
        "EUR",
        "--category",
        "home",
        "--condition",
        "like_new",
        "--token-file",
    ];
    let args = args.into_iter().chain([token_file.to_str().unwrap()]);
    assert_eq!(scanner::cli::run(&Cli::try_parse_from(args).unwrap()).unwrap(), scanner::cli::DONE);
    let mine = shop.json("/api/manage/products", Some(&shop.seller));
    assert_eq!(
        (&mine["items"][0]["price_minor"], &mine["items"][0]["condition"]),
        (&json!(2500), &json!("like_new"))
    );
}
