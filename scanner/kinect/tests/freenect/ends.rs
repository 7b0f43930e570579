//! Unplugged, ended by a signal, abandoned: what is said, and what the sensor is left like.

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use kinect::child::Overflow;
use kinect::source::{Event, Source};
use rustix::process::{Pid, Signal, kill_process};

use super::bus::{Journal, frame, on_bus, started, until};

/// How long each step may take.
const SOON: Duration = Duration::from_secs(2);
const TIMES: usize = 20;

#[test]
fn unplugged_and_plugged_in_again_twenty_times() {
    let home = tempfile::tempdir().unwrap();
    let plug = home.path().join("plug");
    fs::write(&plug, "").unwrap();
    let settings = [("PRESENT", plug.to_str().unwrap()), ("PACE_MILLIS", "10")];
    let Some(mut launch) = on_bus("freenect", "", &settings) else { return };
    launch.overflow = Overflow::NewestWins;
    let mut source = started(launch);
    frame(&mut source);
    let (mut gone, mut back) = (Duration::ZERO, Duration::ZERO);
    for round in 0..TIMES {
        fs::remove_file(&plug).unwrap();
        let begun = Instant::now();
        loop {
            match source.next_event(SOON) {
                Event::Frame(_) => assert!(begun.elapsed() < SOON, "round {round}"),
                Event::Unplugged => break,
                other => panic!("round {round}: {other:?}"),
            }
        }
        gone = gone.max(begun.elapsed());
        // While it is away it cannot be started, and says so.
        assert!(source.start().is_err());
        fs::write(&plug, "").unwrap();
        let begun = Instant::now();
        source.start().unwrap();
        assert_eq!(frame(&mut source).index, 0);
        back = back.max(begun.elapsed());
    }
    println!("longest: unplugging noticed after {gone:?}, frames again after {back:?}");
    assert!(gone < SOON && back < SOON, "{gone:?} {back:?}");
}

/// The registers of the last moment: both streams off means that the projector is dark.
fn is_dark(journal: &Journal) -> bool {
    journal.last("register 0x6").as_deref() == Some("0x0")
        && journal.last("register 0x5").as_deref() == Some("0x0")
}

fn is_lit(journal: &Journal) -> bool {
    journal.last("register 0x6").as_deref() == Some("0x2")
}

#[test]
fn the_projector_is_dark_after_a_stop_and_after_the_source_is_gone() {
    let journal = Journal::new();
    let settings = [("JOURNAL", journal.setting()), ("PACE_MILLIS", "5")];
    let Some(launch) = on_bus("freenect", "", &settings) else { return };
    let mut source = started(launch);
    frame(&mut source);
    assert!(is_lit(&journal));
    source.stop();
    assert!(is_dark(&journal));
    source.start().unwrap();
    frame(&mut source);
    assert!(is_lit(&journal));
    drop(source);
    assert!(is_dark(&journal));
    assert_eq!(journal.lines().last().map(String::as_str), Some("close motor"));
}

/// The driver's process as a child of this one, told apart by the journal it was given.
fn driver_process(journal: &Journal) -> Pid {
    let wanted = format!("FAKE_USB_JOURNAL={}", journal.setting());
    let processes = fs::read_dir("/proc").unwrap().flatten();
    let numbers = processes.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok());
    let is_driver = |number: &i32| {
        let environment = fs::read(format!("/proc/{number}/environ")).unwrap_or_default();
        environment.split(|&byte| byte == 0).any(|variable| variable == wanted.as_bytes())
    };
    let mut drivers: Vec<i32> = numbers.filter(is_driver).collect();
    assert_eq!(drivers.len(), 1, "{drivers:?}");
    Pid::from_raw(drivers.remove(0)).unwrap()
}

#[test]
fn a_signal_to_the_driver_leaves_the_projector_dark() {
    for signal in [Signal::TERM, Signal::INT] {
        let journal = Journal::new();
        let settings = [("JOURNAL", journal.setting()), ("PACE_MILLIS", "5")];
        let Some(mut launch) = on_bus("freenect", "", &settings) else { return };
        launch.overflow = Overflow::NewestWins;
        let mut source = started(launch);
        frame(&mut source);
        assert!(is_lit(&journal));
        kill_process(driver_process(&journal), signal).unwrap();
        until(|| is_dark(&journal));
        until(|| matches!(source.next_event(SOON), Event::Failed(_)));
        source.start().unwrap();
        frame(&mut source);
    }
}

/// Nobody is left to order anything: the driver notices by itself.
#[test]
fn the_projector_is_dark_after_the_program_was_killed() {
    let journal = Journal::new();
    let settings = [("JOURNAL", journal.setting()), ("PACE_MILLIS", "5")];
    let Some(launch) = on_bus("freenect", "", &settings) else { return };
    let mut command = Command::new(&launch.program);
    command.args(["hold", "freenect", ""]).envs(launch.environment).stdout(Stdio::piped());
    let mut program = command.spawn().unwrap();
    let mut said = String::new();
    BufReader::new(program.stdout.take().unwrap()).read_line(&mut said).unwrap();
    assert_eq!(said, "ready\n");
    assert!(is_lit(&journal));
    program.kill().unwrap();
    program.wait().unwrap();
    let begun = Instant::now();
    until(|| is_dark(&journal));
    assert!(begun.elapsed() < SOON, "{:?}", begun.elapsed());
}
