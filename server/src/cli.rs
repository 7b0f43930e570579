//! The command line: serve, and what an operator does beside a running server.

use std::io::{BufRead, IsTerminal, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, bail};
use clap::{Args, Parser, Subcommand, ValueEnum};
use tokio::net::TcpListener;

use crate::auth::password::Passwords;
use crate::auth::secret;
use crate::config::Config;
use crate::db::Db;
use crate::db::account::AccountChange;
use crate::error::Error;
use crate::model::{Role, Scope};
use crate::state::App;
use crate::tokens::{NewToken, issue};

/// Store, list and stream 3D listings of products.
#[derive(Debug, Parser)]
#[command(
    name = "product-server",
    version,
    about,
    max_term_width = 100,
    args_conflicts_with_subcommands = true
)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    serve: ServeArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Accounts
    #[command(subcommand)]
    User(UserCommand),
    /// API tokens
    #[command(subcommand)]
    Token(TokenCommand),
    /// Print the description of the HTTP API
    Openapi,
}

#[derive(Debug, Args)]
struct ServeArgs {
    /// Folder of the database and all files; made where it is absent
    #[arg(long, env = "ALLROUND_DATA", value_name = "DIR", default_value = "data")]
    data: PathBuf,
    /// Address to listen on
    #[arg(long, env = "ALLROUND_LISTEN", value_name = "ADDRESS", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// The address people use, as https://shop.example; https makes cookies secure
    #[arg(long, env = "ALLROUND_PUBLIC_URL", value_name = "URL")]
    public_url: Option<String>,
    /// Behind a proxy that writes X-Forwarded-For: its last entry is the client
    #[arg(long, env = "ALLROUND_BEHIND_PROXY")]
    behind_proxy: bool,
    /// Largest model, in MiB
    #[arg(long, env = "ALLROUND_MAX_MODEL_MIB", value_name = "MIB", default_value_t = 256,
          value_parser = clap::value_parser!(u64).range(1..=4096))]
    max_model_mib: u64,
    /// Most points of a model
    #[arg(long, env = "ALLROUND_MAX_POINTS", value_name = "POINTS", default_value_t = 5_000_000)]
    max_points: usize,
    /// Seconds that requests may still take after a signal to stop
    #[arg(long, env = "ALLROUND_SHUTDOWN_GRACE", value_name = "SECONDS", default_value_t = 60)]
    shutdown_grace: u64,
    /// How log lines look
    #[arg(long, env = "ALLROUND_LOG", value_enum, default_value = "json")]
    log: LogStyle,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum LogStyle {
    Json,
    Text,
}

#[derive(Debug, Args)]
struct DataArgs {
    /// Folder of the database
    #[arg(long, env = "ALLROUND_DATA", value_name = "DIR", default_value = "data")]
    data: PathBuf,
}

#[derive(Debug, Subcommand)]
enum UserCommand {
    /// Make an account; the password comes from ALLROUND_PASSWORD, a file, or is asked for
    Add {
        name: String,
        /// May see and activate all listings, and make accounts
        #[arg(long)]
        admin: bool,
        #[command(flatten)]
        password: PasswordArgs,
        #[command(flatten)]
        data: DataArgs,
    },
    /// Set a new password; all sessions of the account end
    Password {
        name: String,
        #[command(flatten)]
        password: PasswordArgs,
        #[command(flatten)]
        data: DataArgs,
    },
}

#[derive(Debug, Args)]
struct PasswordArgs {
    /// File whose first line is the password
    #[arg(long, value_name = "FILE")]
    password_file: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum TokenCommand {
    /// Make a token and print it, this once
    Add {
        /// Whose token
        #[arg(long)]
        user: String,
        /// What the token is for
        #[arg(long)]
        name: String,
        /// upload: make listings and send files; manage: also edit, activate, delete
        #[arg(long = "scope", value_enum, required = true)]
        scopes: Vec<ScopeArg>,
        /// Days until it runs out; never, where this is not given
        #[arg(long)]
        days: Option<u32>,
        #[command(flatten)]
        data: DataArgs,
    },
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ScopeArg {
    Upload,
    Manage,
}

/// Runs the command.
pub fn run(cli: Cli) -> anyhow::Result<()> {
    match cli.command {
        Some(Command::Openapi) => {
            std::io::stdout().write_all(crate::routes::openapi_json().as_bytes())?;
            Ok(())
        }
        Some(Command::User(command)) => block_on(user(command))?,
        Some(Command::Token(command)) => block_on(token(command))?,
        None => block_on(serve(cli.serve))?,
    }
}

fn block_on<T>(work: impl Future<Output = T>) -> anyhow::Result<T> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    Ok(runtime.block_on(work))
}

async fn serve(args: ServeArgs) -> anyhow::Result<()> {
    start_log(args.log);
    let mut config = Config::new(args.data, args.listen);
    config.public_url = args.public_url.map(|url| checked_url(&url)).transpose()?;
    config.behind_proxy = args.behind_proxy;
    config.limits.model_bytes = args.max_model_mib << 20;
    config.limits.points = args.max_points;
    config.limits.triangles = args.max_points.saturating_mul(2);
    config.times.shutdown_grace = Duration::from_secs(args.shutdown_grace);
    let stop = stop_signal()?;
    let folder = config.data.clone();
    let app =
        App::open(config).await.with_context(|| format!("cannot use the folder {}", folder.display()))?;
    let listener = TcpListener::bind(args.listen)
        .await
        .with_context(|| format!("cannot listen on {}; is another server running there?", args.listen))?;
    let address = listener.local_addr()?;
    let url = app.config.public_url.clone().unwrap_or_else(|| format!("http://{address}"));
    println!("Allround listens on http://{address}");
    if let Some(token) = setup_link(&app.db).await? {
        println!(
            "There is no admin yet. Open this link once to make the first one:\n{url}/setup?token={token}"
        );
    }
    std::io::stdout().flush()?;
    crate::serve::serve(listener, app, stop).await;
    Ok(())
}

/// A new one-time link's token where there is no admin.
pub async fn setup_link(db: &Db) -> anyhow::Result<Option<String>> {
    if db.has_admin().await? {
        return Ok(None);
    }
    let token = secret::random()?;
    db.replace_setup_link(&secret::hash(&token)).await?;
    Ok(Some(token))
}

fn checked_url(url: &str) -> anyhow::Result<String> {
    let url = url.trim_end_matches('/');
    let authority = url.strip_prefix("https://").or_else(|| url.strip_prefix("http://"));
    if authority.is_none_or(|a| a.is_empty() || a.contains(['/', '?', '#', '@', ' '])) {
        bail!("--public-url must look like https://shop.example, without a path");
    }
    Ok(url.to_string())
}

fn start_log(style: LogStyle) {
    let builder = tracing_subscriber::fmt().with_max_level(tracing::Level::INFO).with_writer(std::io::stderr);
    match style {
        LogStyle::Json => {
            builder.json().flatten_event(true).with_current_span(false).with_span_list(false).init();
        }
        LogStyle::Text => builder.with_ansi(std::io::stderr().is_terminal()).init(),
    }
}

/// Done at Ctrl-C or SIGTERM. Installed at once, so that a signal during the start is not lost.
fn stop_signal() -> anyhow::Result<impl Future<Output = ()>> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
    })
}

async fn open_db(data: &Path) -> anyhow::Result<(Db, Config)> {
    std::fs::create_dir_all(data).with_context(|| format!("cannot make the folder {}", data.display()))?;
    let config = Config::new(data, ([127, 0, 0, 1], 0).into());
    let db = Db::open(&data.join("allround.sqlite"), config.times.database_busy).await?;
    Ok((db, config))
}

async fn user(command: UserCommand) -> anyhow::Result<()> {
    match command {
        UserCommand::Add { name, admin, password, data } => {
            let name = crate::routes::account_name(&name)?;
            let (db, config) = open_db(&data.data).await?;
            let hash = Passwords::new(config.password_cost)?.hash(read_password(&password)?).await?;
            let role = if admin { Role::Admin } else { Role::Seller };
            db.insert_account(&name, &hash, role).await.map_err(|error| {
                if crate::db::violates_unique(&error) {
                    Error::conflict("name_taken", "Somebody has this name already.")
                } else {
                    error.into()
                }
            })?;
            db.close().await;
            println!("Made the account {name}.");
        }
        UserCommand::Password { name, password, data } => {
            let (db, config) = open_db(&data.data).await?;
            let account =
                db.account_by_name(&name).await?.with_context(|| format!("there is no account {name}"))?;
            let hash = Passwords::new(config.password_cost)?.hash(read_password(&password)?).await?;
            let change = AccountChange { password_hash: Some(hash), ..AccountChange::default() };
            db.change_account(&account.id, &change).await?;
            db.close().await;
            println!("Changed the password of {name}.");
        }
    }
    Ok(())
}

async fn token(command: TokenCommand) -> anyhow::Result<()> {
    let TokenCommand::Add { user, name, scopes, days, data } = command;
    let (db, _) = open_db(&data.data).await?;
    let account = db.account_by_name(&user).await?.with_context(|| format!("there is no account {user}"))?;
    let scope = |scope: &ScopeArg| match scope {
        ScopeArg::Upload => Scope::Upload,
        ScopeArg::Manage => Scope::Manage,
    };
    let new = NewToken { name, scopes: scopes.iter().map(scope).collect(), days };
    let (text, _) = issue(&db, &account.id, new).await?;
    db.close().await;
    println!("{text}");
    Ok(())
}

/// From the file, the environment, a question on the terminal, or the first line of standard input; never from arguments,
/// which everybody on the machine can see.
fn read_password(args: &PasswordArgs) -> anyhow::Result<String> {
    if let Some(file) = &args.password_file {
        let text =
            std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
        return Ok(text.lines().next().unwrap_or_default().to_string());
    }
    if let Ok(password) = std::env::var("ALLROUND_PASSWORD") {
        return Ok(password);
    }
    if std::io::stdin().is_terminal() {
        let password = rpassword::prompt_password("Password: ")?;
        if rpassword::prompt_password("Once more: ")? != password {
            bail!("the two passwords differ");
        }
        return Ok(password);
    }
    let mut line = String::new();
    std::io::stdin().lock().read_line(&mut line)?;
    Ok(line.trim_end_matches(['\r', '\n']).to_string())
}
