//! Publishing a built model: a draft listing, then model, picture and report, each as a resumable upload (tus 1.0.0).
//!
//! What was begun is noted in [`STATE_FILE`] beside the files: after a broken connection, or when the command is started
//! again, sending goes on where it stopped. At the end the server's hash of the model is compared with ours.

mod client;
mod state;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

pub use client::Token;
use client::{Client, Offset};
pub use state::STATE_FILE;
use state::{Begun, State};

use crate::ui::{Stage, Ui};

/// What stops an upload; each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum UploadError {
    /// A file of ours cannot be read or written.
    #[error("cannot {what} {}: {cause}", path.display())]
    File { what: &'static str, path: PathBuf, cause: std::io::Error },
    /// No model in the folder.
    #[error("no model.ply, model.glb or model.asc in {}; run `scan-product build` first", .0.display())]
    NoModel(PathBuf),
    /// The address of the server makes no sense.
    #[error("--server {0:?} is not an address; it looks like https://shop.example")]
    BadServer(String),
    /// The token cannot be one.
    #[error(
        "the upload token is empty or has characters that no token has; copy it again from the page of tokens"
    )]
    BadToken,
    /// The server does not know the token.
    #[error("the server does not accept the upload token; make a new one under {0}/manage/tokens")]
    TokenRefused(String),
    /// The server said no, and why.
    #[error("the server refused to {what}: {detail}")]
    Refused { what: &'static str, status: u16, detail: String },
    /// Nobody answers, or the connection broke again and again.
    #[error("no connection to {server}: {cause}; what was sent is kept: run the same command again to go on")]
    NoConnection { server: String, cause: String },
    /// An answer that is not from such a server.
    #[error("{server} does not answer like a product server ({what}); check the address")]
    NotOurServer { server: String, what: String },
    /// What arrived is not what was sent.
    #[error("the server's model is not the one that was sent; run the command again")]
    HashDiffers,
}

/// The server, and how hard to try.
#[derive(Debug, Clone)]
pub struct Destination {
    /// As `https://shop.example`.
    pub server: String,
    pub token: Token,
    /// Attempts without any progress before giving up.
    pub attempts: u32,
    /// After the first failure; it doubles with each further one.
    pub first_pause: Duration,
}

impl Destination {
    /// With a patience of about a quarter of a minute.
    pub fn new(server: impl Into<String>, token: Token) -> Self {
        Self { server: server.into(), token, attempts: 6, first_pause: Duration::from_millis(500) }
    }
}

/// What the listing says.
#[derive(Debug, Clone, Default)]
pub struct Listing {
    pub title: String,
    pub description: Option<String>,
    /// Smallest units and ISO 4217 code.
    pub price: Option<(i64, String)>,
    pub category: Option<String>,
    pub condition: Option<String>,
}

/// Where it went.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Published {
    pub product_id: String,
    /// The listing's address for people.
    pub url: String,
    /// `draft` or `active`.
    pub status: String,
    /// SHA-256 of the model, as the server has it.
    pub sha256: String,
}

/// A file to send.
#[derive(Debug)]
struct Outgoing {
    kind: &'static str,
    path: PathBuf,
    bytes: u64,
    sha256: String,
}

/// Sends a built model as a new draft listing, or goes on with one that was begun.
pub fn publish(
    folder: &Path,
    destination: &Destination,
    listing: &Listing,
    ui: &Ui,
) -> Result<Published, UploadError> {
    let files = collect(folder)?;
    let client = Client::new(destination)?;
    client.check_token()?;
    let mut state = state::load(folder, client.server());
    let product_id = continue_or_create(&client, &mut state, folder, listing, ui)?;
    for file in &files {
        let stage = ui.stage(&format!("sending {}", file.kind), file.bytes as usize);
        send(&client, &mut state, folder, file, &product_id, &stage)?;
        stage.done();
    }
    let product = client.product(&product_id)?.ok_or(UploadError::HashDiffers)?;
    let expected = files.iter().find(|file| file.kind == "model").map(|file| file.sha256.as_str());
    let sha256 = product["model"]["sha256"].as_str();
    if sha256 != expected {
        return Err(UploadError::HashDiffers);
    }
    state::remove(folder)?;
    Ok(Published {
        url: format!("{}/p/{product_id}", client.server()),
        status: product["status"].as_str().unwrap_or("draft").to_string(),
        sha256: sha256.unwrap_or_default().to_string(),
        product_id,
    })
}

/// Names and sizes of the files that [`publish`] sends, and of nothing else.
pub fn files_to_send(folder: &Path) -> Result<Vec<(String, u64)>, UploadError> {
    let name = |file: &Outgoing| file.path.file_name().map(|n| n.to_string_lossy().into_owned());
    Ok(collect(folder)?.iter().filter_map(|file| Some((name(file)?, file.bytes))).collect())
}

/// Report and picture come before the model, so that the listing is whole once the model is there.
fn collect(folder: &Path) -> Result<Vec<Outgoing>, UploadError> {
    let first = |names: &[&str]| names.iter().map(|name| folder.join(name)).find(|path| path.is_file());
    let model =
        first(&["model.ply", "model.glb", "model.asc"]).ok_or_else(|| UploadError::NoModel(folder.into()))?;
    let mut files = Vec::new();
    for (kind, path) in
        [("report", first(&["report.json"])), ("poster", first(&["poster.png", "poster.jpg"]))]
    {
        if let Some(path) = path {
            files.push(outgoing(kind, path)?);
        }
    }
    files.push(outgoing("model", model)?);
    Ok(files)
}

fn outgoing(kind: &'static str, path: PathBuf) -> Result<Outgoing, UploadError> {
    let hash = || -> std::io::Result<(u64, String)> {
        let (mut file, mut digest, mut bytes) = (File::open(&path)?, Sha256::new(), 0);
        let mut piece = vec![0; 1 << 16];
        loop {
            let n = file.read(&mut piece)?;
            if n == 0 {
                break;
            }
            digest.update(&piece[..n]);
            bytes += n as u64;
        }
        let sha256 = hex(&digest.finalize());
        Ok((bytes, sha256))
    };
    match hash() {
        Ok((bytes, sha256)) => Ok(Outgoing { kind, path, bytes, sha256 }),
        Err(cause) => Err(UploadError::File { what: "read", path, cause }),
    }
}

/// The product of an upload that was begun, where it is still there; a new draft otherwise.
fn continue_or_create(
    client: &Client,
    state: &mut State,
    folder: &Path,
    listing: &Listing,
    ui: &Ui,
) -> Result<String, UploadError> {
    let wanted = listing_json(listing);
    if let Some(id) = state.product_id.clone().filter(|_| state.listing == wanted)
        && client.product(&id)?.is_some()
    {
        ui.note("going on with the upload that was begun");
        return Ok(id);
    }
    let id = client.create_product(&wanted)?;
    *state = State { product_id: Some(id.clone()), listing: wanted, ..State::new(client.server()) };
    state::save(folder, state)?;
    Ok(id)
}

fn listing_json(listing: &Listing) -> Value {
    let mut value = json!({ "title": listing.title });
    let mut set = |name: &str, text: &Option<String>| {
        if let Some(text) = text {
            value[name] = json!(text);
        }
    };
    set("description", &listing.description);
    set("category", &listing.category);
    set("condition", &listing.condition);
    if let Some((minor, currency)) = &listing.price {
        value["price_minor"] = json!(minor);
        value["currency"] = json!(currency);
    }
    value
}

/// Sends one file to its end, however often the connection breaks, as long as something gets through.
fn send(
    client: &Client,
    state: &mut State,
    folder: &Path,
    file: &Outgoing,
    product_id: &str,
    stage: &Stage,
) -> Result<(), UploadError> {
    let mut patience = client.patience();
    let mut meter = Meter { stage, shown: 0 };
    let mut tried = None;
    loop {
        let address = match state.address(file.kind, &file.sha256) {
            Some(address) => address,
            None => begin(client, state, folder, file, product_id)?,
        };
        match client.offset(&address)? {
            Offset::Gone => {
                state.files.remove(file.kind);
                patience.failed("the server has forgotten the upload")?;
            }
            Offset::Done => {
                meter.reached(file.bytes);
                return Ok(());
            }
            Offset::Failed(detail) => {
                state.files.remove(file.kind);
                state::save(folder, state)?;
                return Err(UploadError::Refused { what: refused_what(file.kind), status: 422, detail });
            }
            Offset::At(offset) => {
                meter.reached(offset);
                patience.progressed_to(offset);
                if tried == Some(offset) {
                    patience.failed("the server does not get further")?;
                }
                tried = Some(offset);
                if let Some(trouble) = client.append(&address, file, offset, &mut meter)? {
                    tried = None;
                    patience.failed(&trouble)?;
                }
            }
        }
    }
}

/// Shows progress; what has to be sent twice is counted once.
struct Meter<'a> {
    stage: &'a Stage,
    shown: u64,
}

impl Meter<'_> {
    fn reached(&mut self, bytes: u64) {
        self.stage.advance(bytes.saturating_sub(self.shown));
        self.shown = self.shown.max(bytes);
    }
}

fn begin(
    client: &Client,
    state: &mut State,
    folder: &Path,
    file: &Outgoing,
    product_id: &str,
) -> Result<String, UploadError> {
    let address = client.begin(file, product_id)?;
    let begun = Begun { address: address.clone(), sha256: file.sha256.clone() };
    state.files.insert(file.kind.to_string(), begun);
    state::save(folder, state)?;
    Ok(address)
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

fn refused_what(kind: &str) -> &'static str {
    match kind {
        "model" => "take the model",
        "poster" => "take the picture",
        _ => "take the report",
    }
}
