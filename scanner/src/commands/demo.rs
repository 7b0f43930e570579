//! `scan-product demo`: from a simulated scan, or a recording of yours, to a listing in the browser on this machine.

use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use serde_json::json;

use super::build;
use crate::cli::DONE;
use crate::simulate::{Kind, ScanSpec, scan_with, write};
use crate::ui::Ui;
use crate::upload::{Destination, Listing, Published, Token, publish};

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The server keeps running until Ctrl-C. With DEMO_EXIT=1 in the environment it ends once the address is printed.")]
pub struct Args {
    /// A recording of yours instead of the simulated one
    #[arg(long, value_name = "DIR")]
    recording: Option<PathBuf>,
    /// What the simulated Kinect scans
    #[arg(long, value_enum, default_value_t = Kind::Camera, conflicts_with = "recording")]
    product: Kind,
    /// Folder for recording, model and the server's data
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    work: PathBuf,
    /// Port of the server; another free one is taken where it is in use
    #[arg(long, default_value_t = 8080)]
    port: u16,
    /// The server program; by default the one beside this program
    #[arg(long, value_name = "FILE")]
    server_program: Option<PathBuf>,
}

/// The running server, so that Ctrl-C ends it as well.
static SERVER: Mutex<Option<Child>> = Mutex::new(None);

const ADMIN: &str = "demo";

/// Scans, builds, serves, publishes, and stays until it is interrupted.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let program = server_program(args)?;
    fs::create_dir_all(&args.work)
        .with_context(|| format!("cannot make the folder {}", args.work.display()))?;
    let recording = match &args.recording {
        Some(recording) => recording.clone(),
        None => simulate(args, ui)?,
    };
    let model = args.work.join("model");
    let status = build::run(&build::Args::of(recording.clone(), model.clone()), &ui.quieter())?;
    if status != DONE {
        return Ok(status);
    }
    let address = free_address(args.port)?;
    let data = args.work.join("server");
    let password_file = make_admin(&program, &args.work, &data)?;
    let token = make_token(&program, &data)?;
    start_server(&program, &data, &address)?;
    let url = format!("http://{address}");
    let published =
        wait_until_ready(&url).and_then(|()| list(&model, &url, &token, &title(args, &recording), ui));
    let published = published.inspect_err(|_| {
        stop_server();
    })?;
    let words = format!(
        "The listing is at {}\nAdmin pages: {url}/manage (name {ADMIN}, password in {})",
        published.url,
        password_file.display()
    );
    ui.result(&words, &json!({"url": published.url, "product_id": published.product_id, "model": model}));
    if std::env::var_os("DEMO_EXIT").is_some_and(|v| v == "1") {
        stop_server();
        return Ok(DONE);
    }
    ui.note("The server runs until Ctrl-C.");
    wait_for_server()
}

/// Ends the server, if one runs; says whether one did.
pub fn stop_server() -> bool {
    let child = SERVER.lock().unwrap_or_else(PoisonError::into_inner).take();
    let Some(mut child) = child else { return false };
    // The standard library can only kill; asking first lets it finish what it is at.
    let asked =
        Command::new("kill").args(["-TERM", &child.id().to_string()]).status().is_ok_and(|s| s.success());
    if !asked {
        let _ = child.kill();
    }
    let _ = child.wait();
    true
}

fn server_program(args: &Args) -> anyhow::Result<PathBuf> {
    let beside = std::env::current_exe()?.with_file_name("product-server");
    let program = args.server_program.clone().unwrap_or(beside);
    ensure!(
        program.is_file(),
        "{} is not there; build it with `cargo build --release --bins`, or name it with --server-program",
        program.display()
    );
    Ok(program)
}

fn simulate(args: &Args, ui: &Ui) -> anyhow::Result<PathBuf> {
    let spec = ScanSpec { scale_error: 0.015, ..ScanSpec::new(args.product, 1) };
    let out = args.work.join("recording");
    let stage = ui.stage("simulated Kinect scans", spec.views);
    let scan = scan_with(&spec, || stage.step())?;
    write(&scan, &out)?;
    stage.done();
    Ok(out)
}

fn title(args: &Args, recording: &Path) -> String {
    if args.recording.is_none() {
        return format!("Demo: a {} (simulated scan)", args.product);
    }
    let name = recording.file_name().map(|n| n.to_string_lossy().into_owned());
    format!("Demo: {}", name.unwrap_or_else(|| "a scan".to_owned()))
}

/// The wished port on this machine, or any free one.
fn free_address(port: u16) -> anyhow::Result<String> {
    let listener = TcpListener::bind(("127.0.0.1", port)).or_else(|_| TcpListener::bind(("127.0.0.1", 0)));
    let address = listener.context("no port of this machine is free")?.local_addr()?;
    Ok(address.to_string())
}

/// Makes the admin, or gives an earlier one a new password, which is kept in a file only its owner can read.
fn make_admin(program: &Path, work: &Path, data: &Path) -> anyhow::Result<PathBuf> {
    let file = work.join("admin-password.txt");
    let mut random = [0u8; 16];
    std::io::Read::read_exact(&mut fs::File::open("/dev/urandom")?, &mut random)?;
    let password = u128::from_be_bytes(random).to_string();
    write_private(&file, &password)?;
    let run = |verb: &[&str]| {
        let mut command = Command::new(program);
        command.arg("user").args(verb).arg("--password-file").arg(&file).arg("--data").arg(data);
        command.stdin(Stdio::null()).output().context("the server program does not start")
    };
    let added = run(&["add", ADMIN, "--admin"])?;
    if !added.status.success() {
        let changed = run(&["password", ADMIN])?;
        ensure!(changed.status.success(), "no admin could be made: {}", said(&added.stderr));
    }
    Ok(file)
}

fn write_private(path: &Path, text: &str) -> anyhow::Result<()> {
    let mut options = fs::OpenOptions::new();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let mut file = options.open(path).with_context(|| format!("cannot write {}", path.display()))?;
    std::io::Write::write_all(&mut file, text.as_bytes())?;
    Ok(())
}

fn make_token(program: &Path, data: &Path) -> anyhow::Result<String> {
    let output = Command::new(program)
        .args([
            "token", "add", "--user", ADMIN, "--name", "demo", "--scope", "upload", "--scope", "manage",
            "--days", "1",
        ])
        .arg("--data")
        .arg(data)
        .output()?;
    ensure!(output.status.success(), "no token could be made: {}", said(&output.stderr));
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn said(stderr: &[u8]) -> String {
    String::from_utf8_lossy(stderr).trim().to_owned()
}

fn start_server(program: &Path, data: &Path, address: &str) -> anyhow::Result<()> {
    let log = fs::File::create(data.join("server.log"))?;
    let child = Command::new(program)
        .arg("--data")
        .arg(data)
        .args(["--listen", address])
        .stdin(Stdio::null())
        .stdout(log.try_clone()?)
        .stderr(log)
        .spawn()
        .context("the server does not start")?;
    *SERVER.lock().unwrap_or_else(PoisonError::into_inner) = Some(child);
    Ok(())
}

/// Asks until the server answers, or half a minute has passed, or it has ended.
fn wait_until_ready(url: &str) -> anyhow::Result<()> {
    let started = Instant::now();
    while started.elapsed() < Duration::from_secs(30) {
        if ureq::get(format!("{url}/readyz")).call().is_ok() {
            return Ok(());
        }
        if has_ended()?.is_some() {
            bail!("the server ended at once; its log is in server/server.log of the demo's folder");
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    bail!("the server does not answer; its log is in server/server.log of the demo's folder")
}

/// Uploads the model and activates the listing.
fn list(model: &Path, url: &str, token: &str, title: &str, ui: &Ui) -> anyhow::Result<Published> {
    let listing = Listing {
        title: title.to_owned(),
        description: Some("Made by the demo: turn it round, zoom in, measure it.".to_owned()),
        price: Some((2500, "EUR".to_owned())),
        category: Some("other".to_owned()),
        condition: Some("good".to_owned()),
    };
    let published = publish(model, &Destination::new(url, Token::new(token)?), &listing, &ui.quieter())?;
    ureq::post(format!("{url}/api/products/{}/status", published.product_id))
        .header("authorization", format!("Bearer {token}"))
        .send_json(json!({"status": "active"}))
        .context("the listing could not be activated")?;
    Ok(published)
}

fn has_ended() -> anyhow::Result<Option<bool>> {
    let mut server = SERVER.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(child) = server.as_mut() else { return Ok(Some(true)) };
    Ok(child.try_wait()?.map(|status| status.success()))
}

fn wait_for_server() -> anyhow::Result<u8> {
    loop {
        match has_ended()? {
            Some(true) => return Ok(DONE),
            Some(false) => {
                bail!("the server ended with an error; its log is in server/server.log of the demo's folder")
            }
            None => std::thread::sleep(Duration::from_millis(200)),
        }
    }
}
