//! The server's HTTP interface, as far as an upload needs it.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::time::Duration;

use serde_json::{Value, json};
use ureq::http::Response;
use ureq::{Agent, Body, SendBody};

use super::{Destination, Meter, Outgoing, UploadError};

const CONNECT_TIME: Duration = Duration::from_secs(15);
/// Reading a large model takes the server a while.
const ANSWER_TIME: Duration = Duration::from_mins(10);
/// No byte got through for this long: the connection is dead.
const STALL_TIME: Duration = Duration::from_mins(1);
const ANSWER_BYTES: u64 = 4 << 20;

/// The upload token; never printed.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    /// A token as it stands in a file or in the environment.
    pub fn new(text: &str) -> Result<Self, UploadError> {
        let text = text.trim();
        if text.is_empty() || !text.bytes().all(|b| b.is_ascii_graphic()) {
            return Err(UploadError::BadToken);
        }
        Ok(Self(text.to_string()))
    }
}

impl std::fmt::Debug for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token(hidden)")
    }
}

/// How far the server is with a file.
#[derive(Debug)]
pub(super) enum Offset {
    /// Send from here.
    At(u64),
    /// Verified and attached.
    Done,
    /// Refused, and why.
    Failed(String),
    /// Unknown: ran out, or never begun.
    Gone,
}

/// Talks to one server.
#[derive(Debug)]
pub(super) struct Client {
    agent: Agent,
    server: String,
    destination: Destination,
}

/// Counts failures without progress.
#[derive(Debug)]
pub(super) struct Patience<'a> {
    destination: &'a Destination,
    failures: u32,
    offset: Option<u64>,
}

impl Patience<'_> {
    pub(super) fn progressed_to(&mut self, offset: u64) {
        if self.offset.is_some_and(|before| offset > before) {
            self.failures = 0;
        }
        self.offset = Some(offset);
    }

    /// Waits before the next attempt; an error when there were too many.
    pub(super) fn failed(&mut self, cause: &str) -> Result<(), UploadError> {
        self.failures += 1;
        if self.failures >= self.destination.attempts {
            return Err(UploadError::NoConnection {
                server: self.destination.server.clone(),
                cause: cause.to_string(),
            });
        }
        std::thread::sleep(self.destination.first_pause * 2u32.saturating_pow(self.failures - 1));
        Ok(())
    }
}

type Answer = Result<Response<Body>, ureq::Error>;

impl Client {
    pub(super) fn new(destination: &Destination) -> Result<Self, UploadError> {
        let config = Agent::config_builder()
            .http_status_as_error(false)
            .max_redirects(0)
            .max_redirects_will_error(false)
            .timeout_connect(Some(CONNECT_TIME))
            .timeout_recv_response(Some(ANSWER_TIME))
            .timeout_per_write(Some(STALL_TIME))
            .user_agent(concat!("scan-product/", env!("CARGO_PKG_VERSION")));
        let server = checked_server(&destination.server)?;
        Ok(Self { agent: config.build().new_agent(), server, destination: destination.clone() })
    }

    pub(super) fn server(&self) -> &str {
        &self.server
    }

    pub(super) fn patience(&self) -> Patience<'_> {
        Patience { destination: &self.destination, failures: 0, offset: None }
    }

    /// Asks who we are, before anything is sent.
    pub(super) fn check_token(&self) -> Result<(), UploadError> {
        let answer = self.retry(|| self.get("/api/session"))?;
        match answer.status().as_u16() {
            200 => match self.json(answer)?["user"] {
                Value::Null => Err(UploadError::TokenRefused(self.server.clone())),
                _ => Ok(()),
            },
            401 => Err(UploadError::TokenRefused(self.server.clone())),
            _ => Err(self.refused("answer", answer)),
        }
    }

    pub(super) fn product(&self, id: &str) -> Result<Option<Value>, UploadError> {
        let answer = self.retry(|| self.get(&format!("/api/products/{id}")))?;
        match answer.status().as_u16() {
            200 => self.json(answer).map(Some),
            404 => Ok(None),
            _ => Err(self.refused("show the listing", answer)),
        }
    }

    pub(super) fn create_product(&self, listing: &Value) -> Result<String, UploadError> {
        // Not tried again: an answer that got lost would leave two listings.
        let request = self.agent.post(self.url("/api/products")).header("authorization", self.bearer());
        let answer = request.send_json(listing).map_err(|error| self.no_connection(&error))?;
        if answer.status() != 201 {
            return Err(self.refused("make the listing", answer));
        }
        let id = self.json(answer)?["id"].as_str().map(str::to_string);
        id.filter(|id| id.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-'))
            .ok_or_else(|| self.not_ours("a listing without an id"))
    }

    /// Announces a file; returns where to send it.
    pub(super) fn begin(&self, file: &Outgoing, product_id: &str) -> Result<String, UploadError> {
        let name = file.path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let pairs =
            [("product", product_id), ("kind", file.kind), ("filename", &name), ("sha256", &file.sha256)];
        let metadata: Vec<String> =
            pairs.iter().map(|(key, value)| format!("{key} {}", base64(value))).collect();
        let answer = self.retry(|| {
            self.agent
                .post(self.url("/api/uploads"))
                .header("authorization", self.bearer())
                .header("tus-resumable", "1.0.0")
                .header("upload-length", file.bytes.to_string())
                .header("upload-metadata", metadata.join(","))
                .send_empty()
        })?;
        if answer.status() != 201 {
            return Err(self.refused(super::refused_what(file.kind), answer));
        }
        let location =
            answer.headers().get("location").and_then(|value| value.to_str().ok()).unwrap_or_default();
        let path = location.strip_prefix(&self.server).unwrap_or(location);
        // The token goes there: only to our own server.
        if path.starts_with("/api/uploads/") {
            Ok(path.to_string())
        } else {
            Err(self.not_ours("an upload elsewhere"))
        }
    }

    /// How far the server is.
    pub(super) fn offset(&self, address: &str) -> Result<Offset, UploadError> {
        let answer = self.retry(|| self.get(address))?;
        match answer.status().as_u16() {
            200 => {}
            404 | 410 => return Ok(Offset::Gone),
            _ => return Err(self.refused("go on", answer)),
        }
        let status = self.json(answer)?;
        match status["state"].as_str() {
            Some("done") => Ok(Offset::Done),
            Some("failed") => {
                Ok(Offset::Failed(status["detail"].as_str().unwrap_or("no reason given").to_string()))
            }
            Some("receiving") => {
                status["offset"].as_u64().map(Offset::At).ok_or_else(|| self.not_ours("no offset"))
            }
            _ => Err(self.not_ours("an upload without a state")),
        }
    }

    /// Sends what is left; `Some` tells of trouble after which it is worth asking for the offset and going on.
    pub(super) fn append(
        &self,
        address: &str,
        file: &Outgoing,
        offset: u64,
        meter: &mut Meter<'_>,
    ) -> Result<Option<String>, UploadError> {
        let unreadable = |cause| UploadError::File { what: "read", path: file.path.clone(), cause };
        let mut source = File::open(&file.path).map_err(unreadable)?;
        source.seek(SeekFrom::Start(offset)).map_err(unreadable)?;
        let rest = file.bytes.saturating_sub(offset);
        let mut body = Watched { source: source.take(rest), at: offset, meter };
        let answer = self
            .agent
            .patch(self.url(address))
            .header("authorization", self.bearer())
            .header("tus-resumable", "1.0.0")
            .header("upload-offset", offset.to_string())
            .header("content-type", "application/offset+octet-stream")
            .header("content-length", rest.to_string())
            .send(SendBody::from_reader(&mut body));
        let answer = match answer {
            Ok(answer) => answer,
            Err(error) => return Ok(Some(error.to_string())),
        };
        match answer.status().as_u16() {
            // Of a refusal (422) the reason stays with the upload and is told by its state.
            200..=299 | 422 => Ok(None),
            408 | 409 | 423 | 425 | 429 | 460 | 500 | 502..=504 => {
                Ok(Some(self.refused("go on", answer).to_string()))
            }
            _ => Err(self.refused(super::refused_what(file.kind), answer)),
        }
    }

    fn url(&self, path: &str) -> String {
        format!("{}{path}", self.server)
    }

    fn bearer(&self) -> String {
        format!("Bearer {}", self.destination.token.0)
    }

    fn get(&self, path: &str) -> Answer {
        self.agent.get(self.url(path)).header("authorization", self.bearer()).call()
    }

    /// Asks again where nobody answered or the server was busy; only for what can safely be asked twice.
    fn retry(&self, ask: impl Fn() -> Answer) -> Result<Response<Body>, UploadError> {
        let mut patience = self.patience();
        loop {
            match ask() {
                Ok(answer) if matches!(answer.status().as_u16(), 429 | 502..=504) => {
                    patience.failed(&self.refused("answer", answer).to_string())?;
                }
                Ok(answer) => return Ok(answer),
                Err(error) => patience.failed(&error.to_string())?,
            }
        }
    }

    fn json(&self, mut answer: Response<Body>) -> Result<Value, UploadError> {
        let text = answer.body_mut().with_config().limit(ANSWER_BYTES).read_to_vec();
        let value = text.ok().and_then(|text| serde_json::from_slice(&text).ok());
        value.ok_or_else(|| self.not_ours("no JSON"))
    }

    /// The server's own words, where it sent some.
    fn refused(&self, what: &'static str, answer: Response<Body>) -> UploadError {
        let status = answer.status().as_u16();
        if (300..400).contains(&status) {
            let to =
                answer.headers().get("location").and_then(|v| v.to_str().ok()).unwrap_or("another address");
            return self.not_ours(&format!("it points to {to}"));
        }
        let problem = self.json(answer).unwrap_or(json!({}));
        let detail = problem["detail"].as_str().map_or_else(|| format!("status {status}"), str::to_string);
        UploadError::Refused { what, status, detail }
    }

    fn no_connection(&self, error: &ureq::Error) -> UploadError {
        UploadError::NoConnection { server: self.server.clone(), cause: error.to_string() }
    }

    fn not_ours(&self, what: &str) -> UploadError {
        UploadError::NotOurServer { server: self.server.clone(), what: what.to_string() }
    }
}

/// Shows how far reading the file has come.
struct Watched<'a, 'b, R> {
    source: R,
    at: u64,
    meter: &'a mut Meter<'b>,
}

impl<R: Read> Read for Watched<'_, '_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.source.read(buffer)?;
        self.at += n as u64;
        self.meter.reached(self.at);
        Ok(n)
    }
}

/// `http(s)://host[:port]`, without anything after it.
fn checked_server(text: &str) -> Result<String, UploadError> {
    let server = text.trim().trim_end_matches('/');
    let host = server.strip_prefix("https://").or_else(|| server.strip_prefix("http://")).unwrap_or_default();
    let odd = |c: char| c.is_whitespace() || c.is_control() || matches!(c, '/' | '?' | '#' | '@');
    if host.is_empty() || host.contains(odd) {
        Err(UploadError::BadServer(text.to_string()))
    } else {
        Ok(server.to_string())
    }
}

/// Base64 of text (RFC 4648), for tus metadata.
fn base64(text: &str) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits = |triple: &[u8]| {
        let bits = (0..3).fold(0u32, |bits, i| bits << 8 | u32::from(triple.get(i).copied().unwrap_or(0)));
        let used = triple.len() + 1;
        (0..4).map(
            move |i| {
                if i < used { char::from(DIGITS[(bits >> (18 - 6 * i) & 63) as usize]) } else { '=' }
            },
        )
    };
    text.as_bytes().chunks(3).flat_map(digits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_as_rfc_4648_has_it() {
        for (text, expected) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
        ] {
            assert_eq!(base64(text), expected);
        }
    }

    #[test]
    fn only_plain_addresses_are_servers() {
        assert_eq!(checked_server("https://shop.example/").unwrap(), "https://shop.example");
        assert_eq!(checked_server("http://localhost:8080").unwrap(), "http://localhost:8080");
        for bad in ["shop.example", "ftp://x", "https://", "https://a@b", "https://a/b", "https://a b"] {
            assert!(checked_server(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_token_is_not_shown() {
        let token = Token::new("arp_secret\n").unwrap();
        assert!(!format!("{token:?}").contains("secret"));
        assert!(Token::new("two words").is_err());
        assert!(Token::new(" ").is_err());
    }
}
