//! How the bus behaves: environment variables, read once.

use std::path::PathBuf;
use std::sync::LazyLock;
use std::time::Duration;

/// What the test wants.
pub(crate) struct Settings {
    /// `FAKE_USB_FRAMES`: images each stream sends before it falls silent; endless where not set.
    pub(crate) frames: u32,
    /// `FAKE_USB_PRESENT`: the Kinects are plugged in while this file exists.
    pub(crate) present: Option<PathBuf>,
    /// `FAKE_USB_DROP`: packets that get lost: `STREAM:FRAME:PACKET,PACKET…`, STREAM being `depth` or `video`.
    pub(crate) dropped: Option<(u8, u32, Vec<usize>)>,
    /// `FAKE_USB_NO_MOTOR`: only the cameras answer.
    pub(crate) no_motor: bool,
    /// `FAKE_USB_START_TICKS`: the 60 MHz counter at the first image.
    pub(crate) start_ticks: u32,
    /// `FAKE_USB_JOURNAL`: registers, lamp and motor are written down here, a line a change.
    pub(crate) journal: Option<PathBuf>,
    /// `FAKE_USB_SERIALS`: the Kinects' serial numbers, with commas between them.
    pub(crate) serials: Vec<String>,
    /// `FAKE_USB_PACE_MILLIS`: time between images; none where not set.
    pub(crate) pace: Duration,
    /// `FAKE_USB_REFUSE_OPEN`: what opening a device returns: -3 no permission.
    pub(crate) refuse_open: i32,
    /// `FAKE_USB_REFUSE_CLAIM`: what claiming an interface returns: -6 busy.
    pub(crate) refuse_claim: i32,
}

/// The settings.
pub(crate) static SETTINGS: LazyLock<Settings> = LazyLock::new(|| Settings {
    frames: number("FRAMES").unwrap_or(u32::MAX),
    present: std::env::var_os("FAKE_USB_PRESENT").map(PathBuf::from),
    dropped: text("DROP").and_then(|words| dropped(&words)),
    no_motor: text("NO_MOTOR").is_some(),
    start_ticks: number("START_TICKS").unwrap_or(100_000),
    journal: std::env::var_os("FAKE_USB_JOURNAL").map(PathBuf::from),
    serials: text("SERIALS")
        .map_or_else(|| vec!["A00365A00000000A".into()], |list| list.split(',').map(str::to_owned).collect()),
    pace: Duration::from_millis(number("PACE_MILLIS").unwrap_or(0)),
    refuse_open: number("REFUSE_OPEN").unwrap_or(0),
    refuse_claim: number("REFUSE_CLAIM").unwrap_or(0),
});

fn text(name: &str) -> Option<String> {
    std::env::var(format!("FAKE_USB_{name}")).ok()
}

fn number<T: std::str::FromStr>(name: &str) -> Option<T> {
    text(name)?.parse().ok()
}

fn dropped(words: &str) -> Option<(u8, u32, Vec<usize>)> {
    let mut words = words.split(':');
    let endpoint = if words.next()? == "depth" { crate::kinect::DEPTH } else { crate::kinect::VIDEO };
    let frame = words.next()?.parse().ok()?;
    Some((endpoint, frame, words.next()?.split(',').filter_map(|packet| packet.parse().ok()).collect()))
}
