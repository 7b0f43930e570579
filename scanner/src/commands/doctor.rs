//! `scan-product doctor`: what is plugged in, and a live check of a sensor with what to do in words.

use std::fmt::Write;

use anyhow::Context;
use kinect::probe;
use kinect::source::SensorInfo;
use reconstruct::board::KnownBoard;
use serde_json::json;

use super::devices;
use super::simulate::board_named;
use crate::capture::hints::Level;
use crate::capture::sensors::{Opener, ThisComputer};
use crate::cli::{DONE, NO_GOOD_SCAN};
use crate::doctor::{Finding, judge, watch};
use crate::ui::Ui;

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Put the board with a box on it 0.8 m before the sensor. Exit status 1: something must be changed before a scan can be good.

Examples:
  scan-product doctor --board a3
  scan-product doctor --sensor freenect --seconds 10
  scan-product doctor --sensor simulated --board a3")]
pub struct Args {
    /// The sensor, as `scan-product devices` names it [default: the first that can be used]
    #[arg(long, value_name = "ADDRESS")]
    sensor: Option<String>,
    /// The board before it: a4, a3, a2 or a board.json; without it the checks of scale and markers are left out
    #[arg(long, value_name = "PAPER|FILE")]
    board: Option<String>,
    /// How long to look on
    #[arg(long, value_name = "S", default_value_t = 3.0, value_parser = seconds)]
    seconds: f64,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|e| format!("write seconds, as 3 ({e})"))?;
    if (0.5..=600.0).contains(&seconds) { Ok(seconds) } else { Err("0.5 to 600 seconds".to_owned()) }
}

/// Runs the command.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let look = probe::look();
    let devices = devices::for_machines(&look)?;
    let board = args.board.as_deref().map(board_named).transpose()?;
    let usable = || look.sensors.iter().filter(|s| s.is_usable()).find_map(|s| s.address.clone());
    let Some(address) = args.sensor.clone().or_else(usable) else {
        let words = format!("{}\nThere is no sensor to check.", devices::in_words(&look));
        ui.result(&words, &json!({"devices": devices, "sensor": null, "findings": [], "good": false}));
        return Ok(NO_GOOD_SCAN);
    };
    ui.note(&format!("looking through {address} for {} seconds", args.seconds));
    let (sensor, findings) = check(&address, board.as_ref(), args.seconds)?;
    let good = findings.iter().all(|finding| finding.level < Level::Red);
    let shown = json!({"address": sensor.address, "model": sensor.model, "serial": sensor.serial});
    ui.result(
        &format!("{}\n{}", devices::in_words(&look), in_words(&sensor, &findings, board.is_some())),
        &json!({"devices": devices, "sensor": shown, "findings": findings, "good": good}),
    );
    Ok(if good { DONE } else { NO_GOOD_SCAN })
}

fn check(
    address: &str,
    board: Option<&KnownBoard>,
    seconds: f64,
) -> anyhow::Result<(SensorInfo, Vec<Finding>)> {
    let mut source = ThisComputer.open(address, board).with_context(|| format!("cannot check {address}"))?;
    let watched = watch(source.as_mut(), seconds).with_context(|| format!("cannot check {address}"))?;
    let sensor = source.sensor().clone();
    let findings = judge(&watched, &sensor, board);
    Ok((sensor, findings))
}

fn in_words(sensor: &SensorInfo, findings: &[Finding], has_board: bool) -> String {
    let mut words = format!("Live check of {}\n", sensor.model);
    for finding in findings {
        let sign = match finding.level {
            Level::Green => "ok  ",
            Level::Yellow => "note",
            Level::Red => "!   ",
        };
        // Writing into memory does not fail.
        let _ = writeln!(words, "  {sign} {}", finding.text);
    }
    if !has_board {
        words += "  Not checked: markers, print and depth scale. Name the board, as --board a3.\n";
    }
    words.trim_end().to_owned()
}
