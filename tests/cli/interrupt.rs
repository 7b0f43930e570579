//! Ctrl-C at the beginning of every stage: exit 130, and what was there before is still there, whole.
#![cfg(unix)]

use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::Value;

use super::support::{
    RESULT, assert_old_result, build, bytes_of, command, mug, names, nothing_half_written, put_old_result,
    scan,
};

/// Stages in the order in which a run announces them.
fn stages(events: &str) -> Vec<String> {
    let events = events.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    events.filter(|e| e["event"] == "stage").map(|e| e["name"].as_str().unwrap().to_owned()).collect()
}

/// A shell that sends the signal as soon as it is told to: started beforehand, so that no time is lost.
struct Killer(Child);

impl Killer {
    fn of(child: &Child) -> Self {
        let script = format!("read go && kill -INT {}", child.id());
        Self(Command::new("sh").args(["-c", &script]).stdin(Stdio::piped()).spawn().unwrap())
    }

    fn go(mut self) {
        self.0.stdin.take().unwrap().write_all(b"go\n").unwrap();
        assert!(self.0.wait().unwrap().success(), "the program had ended before the signal");
    }
}

/// Runs the command, interrupts it at the beginning of `stage`, and gives the exit status.
fn interrupted(arguments: &[&str], stage: &str) -> Option<i32> {
    let child = command().args(arguments).arg("--json").stderr(Stdio::piped()).stdout(Stdio::piped()).spawn();
    let mut child = child.unwrap();
    let mut killer = Some(Killer::of(&child));
    let mut events = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while events.read_line(&mut line).unwrap() > 0 {
        let event: Value = serde_json::from_str(&line).unwrap();
        if event["event"] == "stage" && event["name"] == stage {
            killer.take().unwrap().go();
            break;
        }
        line.clear();
    }
    assert!(killer.is_none(), "no stage {stage} came");
    let mut rest = String::new();
    events.read_to_string(&mut rest).unwrap();
    assert!(!rest.contains("\"error\""), "{rest}");
    child.wait().unwrap().code()
}

#[test]
fn a_build_interrupted_in_any_stage_leaves_the_older_result() {
    let home = tempfile::tempdir().unwrap();
    let all = build(mug(), &home.path().join("whole"), &["--json"]).with_status(0);
    let all = stages(&all.err);
    assert!(all.len() >= 6, "{all:?}");
    for stage in &all {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        put_old_result(&out);
        let arguments = ["build", mug().to_str().unwrap(), "--out", out.to_str().unwrap()];
        let status = interrupted(&arguments, stage);
        nothing_half_written(home.path());
        if stage == all.last().unwrap() {
            check_whole(status, &out);
        } else {
            assert_eq!(status, Some(130), "{stage}");
            assert_old_result(&out);
        }
    }
}

/// The last stage takes moments: the signal may come before or after the result is in its place, never in between.
#[track_caller]
fn check_whole(status: Option<i32>, out: &Path) {
    assert!(matches!(status, Some(0 | 130)), "{status:?}");
    let files = bytes_of(out);
    let old = RESULT.iter().filter(|name| files[**name] == format!("old {name}").into_bytes()).count();
    assert!(old == 0 || (old == RESULT.len() && status == Some(130)), "{old} old files, {status:?}");
}

#[test]
fn a_simulation_interrupted_leaves_nothing() {
    let home = tempfile::tempdir().unwrap();
    let simulate = |out: &str| {
        let out = home.path().join(out).to_str().unwrap().to_owned();
        ["simulate", "--product", "bowl", "--views", "2", "--frames", "4", "--out", &out].map(str::to_owned)
    };
    let all = scan(simulate("whole").iter().map(String::as_str).chain(["--json"])).with_status(0);
    for stage in stages(&all.err) {
        let arguments = simulate("rec");
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let status = interrupted(&arguments, &stage);
        let whole = home.path().join("rec/recording.json").is_file();
        assert!(status == Some(130) || (status == Some(0) && whole), "{stage}: {status:?}");
        assert!(whole || names(home.path()) == ["whole"], "{stage}: {:?}", names(home.path()));
        nothing_half_written(home.path());
    }
}
