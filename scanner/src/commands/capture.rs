//! `scan-product capture`: the guided capture on a page in the browser.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use crate::capture::{self, Options};
use crate::cli::DONE;
use crate::ui::Ui;

/// Arguments.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Opens a page in the browser that leads from the sensor to the published listing. The page is only for whoever has the
address that is printed: it holds a token that is new with every start.

Examples:
  scan-product                                   the same as `scan-product capture`
  scan-product capture --sensor simulated        try it without a Kinect")]
pub struct Args {
    /// Where and how it listens
    #[command(flatten)]
    pub daemon: DaemonArgs,
    /// Sensor to begin with: simulated, simulated:mug, replay:FOLDER, or an address as `scan-product devices` names it
    #[arg(long, value_name = "ADDRESS")]
    pub sensor: Option<String>,
    /// Folder in which every product gets a folder of its own [default: `scans` in the home folder]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Arguments of everything that starts the daemon.
#[derive(Debug, Clone, clap::Args)]
pub struct DaemonArgs {
    /// Port to listen at; 0 takes any free one
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port: u16,
    /// Address to listen at, beyond this computer if it says so: everybody there who sees the traffic can give orders
    #[arg(long, value_name = "IP", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    pub listen: IpAddr,
    /// Only print the address
    #[arg(long)]
    pub no_browser: bool,
    /// Server to propose for publishing, as https://shop.example
    #[arg(long, value_name = "URL")]
    pub server: Option<String>,
}

impl Args {
    /// What `scan-product` does without arguments.
    pub fn usual() -> Self {
        let daemon =
            DaemonArgs { port: 0, listen: IpAddr::V4(Ipv4Addr::LOCALHOST), no_browser: false, server: None };
        Self { daemon, sensor: None, out: None }
    }
}

/// Runs until it is told to end.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let home = args.out.clone().map_or_else(scans_folder, Ok)?;
    capture::run(&options(&args.daemon, args.sensor.clone(), home), ui)?;
    Ok(DONE)
}

/// The daemon's options.
pub(super) fn options(args: &DaemonArgs, sensor: Option<String>, home: PathBuf) -> Options {
    Options {
        address: SocketAddr::new(args.listen, args.port),
        browser: !args.no_browser,
        sensor,
        home,
        resume: None,
        server: args.server.clone(),
    }
}

/// `scans` in the home folder.
pub(super) fn scans_folder() -> anyhow::Result<PathBuf> {
    let home = std::env::home_dir().filter(|home| home.is_dir());
    home.map(|home| home.join("scans"))
        .ok_or_else(|| anyhow::anyhow!("there is no home folder: name a folder for the scans with --out"))
}
