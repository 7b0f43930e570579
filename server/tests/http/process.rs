//! The program itself: its start, its commands, and its end that lets uploads finish.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use super::support::{ASC, PASSWORD, Server, Who, exchange, head_of, id_of, read_all, until};

fn program(data: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_product-server"));
    command.env("ALLROUND_DATA", data).env_remove("ALLROUND_PASSWORD").stderr(Stdio::null());
    command
}

/// A running server and what it said until it listened.
fn start(data: &Path) -> (Child, BufReader<std::process::ChildStdout>, String) {
    let mut child = program(data).args(["--listen", "127.0.0.1:0"]).stdout(Stdio::piped()).spawn().unwrap();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    out.read_line(&mut line).unwrap();
    let address = line.trim().rsplit("http://").next().unwrap().to_string();
    (child, out, address)
}

fn terminate(child: &Child) {
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
}

fn run(command: &mut Command) -> (bool, String) {
    let output = command.stdin(Stdio::null()).output().unwrap();
    (output.status.success(), String::from_utf8(output.stdout).unwrap())
}

#[test]
fn a_signal_lets_uploads_finish() {
    let folder = tempfile::tempdir().unwrap();
    let (done, _) = run(program(folder.path())
        .args(["user", "add", "--admin", "ann"])
        .env("ALLROUND_PASSWORD", PASSWORD));
    assert!(done);
    let add = ["token", "add", "--user", "ann", "--name", "t", "--scope", "upload"];
    let (done, token) = run(program(folder.path()).args(add));
    assert!(done && token.starts_with("arp_"));
    let token = Who::Token(token.trim().to_string());
    let (mut child, _out, address) = start(folder.path());
    let length = ASC.len().to_string();
    let mut stream = TcpStream::connect(&address).unwrap();
    let head = head_of("POST", "/api/models?title=late", &token, &[("Content-Length", &length)]);
    stream.write_all(head.as_bytes()).unwrap();
    stream.write_all(&ASC.as_bytes()[..30]).unwrap();
    let spool = folder.path().join("spool");
    until("the body is coming", || std::fs::read_dir(&spool).unwrap().count() == 1);
    terminate(&child);
    until("no new connection is taken", || TcpStream::connect(&address).is_err());
    let answer = exchange(&mut stream, &ASC.as_bytes()[30..]);
    assert!(answer.starts_with("HTTP/1.1 201"), "{answer}");
    assert!(child.wait().unwrap().success());
}

#[test]
fn the_first_start_prints_a_link_for_the_first_admin() {
    let folder = tempfile::tempdir().unwrap();
    let (mut child, mut out, address) = start(folder.path());
    let (mut words, mut link) = (String::new(), String::new());
    out.read_line(&mut words).unwrap();
    out.read_line(&mut link).unwrap();
    assert!(words.contains("no admin yet"), "{words}");
    let token = link.trim().rsplit("token=").next().unwrap();
    let body = format!(r#"{{"token": "{token}", "name": "ann", "password": "{PASSWORD}"}}"#);
    let request = format!(
        "POST /api/setup HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Type: application/json\r\n\
         Content-Length: {}\r\n\r\n{body}",
        body.len()
    );
    let ask = || {
        let mut stream = TcpStream::connect(&address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        read_all(&mut stream)
    };
    assert!(ask().starts_with("HTTP/1.1 201"));
    assert!(ask().starts_with("HTTP/1.1 403"));
    terminate(&child);
    assert!(child.wait().unwrap().success());
    let (mut child, mut out, _) = start(folder.path());
    terminate(&child);
    let mut rest = String::new();
    out.read_to_string(&mut rest).unwrap();
    assert_eq!(rest, "", "no link any more");
    assert!(child.wait().unwrap().success());
}

#[test]
fn commands_say_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let add = |name: &str, password: &str| {
        run(program(folder.path()).args(["user", "add", name]).env("ALLROUND_PASSWORD", password)).0
    };
    assert!(add("sam", PASSWORD));
    assert!(!add("SAM", PASSWORD), "taken");
    assert!(!add("max", "short"));
    let token = ["token", "add", "--user", "nobody", "--name", "t", "--scope", "upload"];
    assert!(!run(program(folder.path()).args(token)).0);
    assert!(!run(program(folder.path()).args(["--public-url", "shop.example"])).0);
    let (done, text) = run(program(folder.path()).arg("openapi"));
    assert!(done && text == server::routes::openapi_json());
}

#[test]
fn in_process_too_the_end_waits_for_requests() {
    let mut server = Server::start();
    let sam = server.manager("sam");
    let path = format!("/api/products/{}/model", id_of(&server.draft(&sam, "mug")));
    let length = ASC.len().to_string();
    let mut stream = server.connect();
    stream.write_all(head_of("PUT", &path, &sam, &[("Content-Length", &length)]).as_bytes()).unwrap();
    stream.write_all(&ASC.as_bytes()[..30]).unwrap();
    until("the body is coming", || server.spooled().len() == 1);
    server.stop();
    let answer = exchange(&mut stream, &ASC.as_bytes()[30..]);
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    server.wait();
}
