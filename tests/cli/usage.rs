//! Help texts, wrong usage, and how the program speaks.

use serde_json::Value;

use super::support::{Broken, build, command, mug, scan};

const COMMANDS: [&str; 15] = [
    "capture",
    "resume",
    "devices",
    "doctor",
    "rebuild",
    "build",
    "report",
    "calibrate",
    "board",
    "import",
    "record",
    "simulate",
    "upload",
    "demo",
    "completions",
];

#[test]
fn the_help_of_the_program_and_of_every_command() {
    let ran = scan(["--help"]).with_status(0);
    insta::assert_snapshot!("help", ran.out);
    for name in COMMANDS {
        let ran = scan([name, "--help"]).with_status(0);
        assert_eq!(ran.err, "");
        insta::assert_snapshot!(format!("help_{name}"), ran.out);
    }
}

#[test]
fn every_command_is_in_the_list() {
    let help = scan(["--help"]).with_status(0).out;
    let list = help.split("Commands:").nth(1).unwrap().split("\n\n").next().unwrap();
    let listed: Vec<&str> = list.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(listed.len(), COMMANDS.len() + 1, "{listed:?}");
    assert!(COMMANDS.iter().all(|name| listed.contains(name)), "{listed:?}");
}

#[test]
fn wrong_usage() {
    let usages: [(&str, &[&str]); 12] = [
        ("unknown_command", &["scann"]),
        ("unknown_option", &["build", "rec", "--out", "out", "--colour"]),
        ("no_out", &["build", "rec"]),
        ("no_recording", &["build", "--out", "out"]),
        ("unknown_product", &["simulate", "--product", "car", "--out", "rec"]),
        ("unknown_method", &["build", "rec", "--out", "out", "--method", "magic"]),
        ("no_number", &["build", "rec", "--out", "out", "--seed", "many"]),
        ("quiet_and_verbose", &["build", "rec", "--out", "out", "--quiet", "--verbose"]),
        (
            "knock_without_board",
            &["simulate", "--product", "mug", "--out", "rec", "--no-board", "--knock", "1"],
        ),
        ("unknown_shell", &["completions", "tcsh"]),
        ("depth_without_surface", &["import", "cloud.ply", "--out", "out", "--depth", "9"]),
        ("camera_of_two_numbers", &["import", "pictures", "--out", "rec", "--color-camera", "525,525"]),
    ];
    for (name, arguments) in usages {
        let ran = scan(arguments).with_status(2);
        assert_eq!(ran.out, "", "{name}");
        insta::assert_snapshot!(format!("usage_{name}"), ran.err);
    }
}

/// Numbers that no scan can have are refused before any work.
#[test]
fn simulations_that_cannot_be() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("rec");
    let wrong: [&[&str]; 14] = [
        &["--views", "0"],
        &["--views", "1000000000"],
        &["--frames", "0"],
        &["--frames", "1000000000"],
        &["--knock", "99"],
        &["--scale-error", "nan"],
        &["--scale-error", "5"],
        &["--warp-px", "inf"],
        &["--hide-board", "2"],
        &["--distances", "0"],
        &["--elevations", "nan"],
        &["--elevations", "-80"],
        &["--board", "nowhere.json"],
        &["--family", "qr"],
    ];
    for options in wrong {
        let fixed = ["simulate", "--product", "mug", "--out", out.to_str().unwrap()];
        let ran = scan(fixed.iter().chain(options)).with_status(2);
        assert!(ran.err.starts_with("error: "), "{options:?}: {}", ran.err);
        assert!(!out.exists(), "{options:?}");
    }
}

#[test]
fn the_version() {
    let ran = scan(["--version"]).with_status(0);
    assert_eq!(ran.out, format!("scan-product {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn completions_of_the_shells() {
    for shell in ["bash", "zsh", "fish"] {
        let ran = scan(["completions", shell]).with_status(0);
        assert!(COMMANDS.iter().all(|name| ran.out.contains(name)), "{shell}");
        assert!(ran.out.contains("scan-product") && ran.out.contains("method"), "{shell}");
        assert_eq!(ran.err, "");
    }
}

#[cfg(unix)]
#[test]
fn bash_understands_its_completions() {
    let script = format!(
        "source <(\"{}\" completions bash) && complete -p scan-product",
        super::support::program().display()
    );
    let ran = std::process::Command::new("bash").args(["-c", &script]).output();
    let Ok(ran) = ran else { return println!("skipped: there is no bash") };
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    assert!(String::from_utf8_lossy(&ran.stdout).contains("-F _scan"), "{ran:?}");
}

#[test]
fn json_is_json_line_by_line() {
    let home = tempfile::tempdir().unwrap();
    let ran = build(mug(), home.path(), &["--json"]).with_status(0);
    let result: Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(result["report"]["version"], 1);
    assert_eq!(result["report"], super::support::json(&home.path().join("report.json")));
    let events: Vec<Value> = ran.err.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let count = |kind: &str| events.iter().filter(|event| event["event"] == kind).count();
    assert!(count("stage") >= 6);
    assert_eq!(count("stage"), count("stage_done"));
}

#[test]
fn errors_are_json_too() {
    let ran = scan(["build", "/nowhere", "--out", "/nowhere/out", "--json"]).with_status(2);
    let event: Value = serde_json::from_str(ran.err.trim()).unwrap();
    assert_eq!(event["event"], "error");
    assert!(event["text"].as_str().unwrap().contains("recording.json"));
    assert_eq!(ran.out, "");
}

#[test]
fn a_scan_without_a_model_is_json_too() {
    let broken = Broken::mug();
    broken.edit("board.json", |board| board["family"] = "tag36h11".into());
    let ran = build(&broken.recording(), &broken.out(), &["--json"]).with_status(1);
    let result: Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(result["report"]["verdict"], "poor");
    assert!(ran.err.lines().all(|line| serde_json::from_str::<Value>(line).is_ok()), "{}", ran.err);
}

#[test]
fn quiet_says_only_the_result() {
    let home = tempfile::tempdir().unwrap();
    let ran = build(mug(), home.path(), &["--quiet"]).with_status(0);
    // four views leave some of it unseen: that is said even so
    let only_warnings =
        ran.err.lines().all(|line| line.starts_with("warning: ") && line.contains("never seen"));
    assert!(only_warnings, "{}", ran.err);
    assert!(ran.out.contains("points from 4 of 4 views"), "{}", ran.out);
}

#[test]
fn quiet_still_says_what_is_wrong() {
    let ran = scan(["build", "/nowhere", "--out", "/nowhere/out", "--quiet"]).with_status(2);
    assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
}

#[test]
fn verbose_says_more_about_every_view() {
    let home = tempfile::tempdir().unwrap();
    let usual = build(mug(), home.path(), &[]).with_status(0);
    let verbose = build(mug(), home.path(), &["--verbose"]).with_status(0);
    assert!(verbose.err.lines().count() > usual.err.lines().count(), "{}", verbose.err);
    for view in ["000", "001", "002", "003"] {
        assert!(verbose.err.contains(&format!("view {view}")), "{}", verbose.err);
    }
}

/// Standard error is no terminal here, so there is no colour with `NO_COLOR` and none without.
#[test]
fn no_colours_where_nobody_sees_them() {
    for no_color in ["", "1"] {
        let mut command = command();
        command.args(["build", "/nowhere", "--out", "/nowhere/out"]).env("NO_COLOR", no_color);
        let ran = super::support::Ran::from(command.output().unwrap()).with_status(2);
        assert!(!ran.err.contains('\x1b'), "{:?}", ran.err);
    }
}

/// On a terminal there are colours and bars; `NO_COLOR` takes the colours. `script` makes the terminal.
#[cfg(target_os = "linux")]
#[test]
fn colours_on_a_terminal_and_none_with_no_color() {
    let say = |no_color: &str| {
        let line = format!("\"{}\" build /nowhere --out /nowhere/out", super::support::program().display());
        let mut command = super::support::clean(std::process::Command::new("script"));
        command.args(["-qec", &line, "/dev/null"]).env("NO_COLOR", no_color).env("TERM", "xterm-256color");
        command.stdin(std::process::Stdio::null()).output().map(|o| String::from_utf8(o.stdout).unwrap())
    };
    let Ok(colored) = say("") else { return println!("skipped: there is no `script`") };
    assert!(colored.contains("\x1b[31merror:"), "{colored:?}");
    let plain = say("1").unwrap();
    assert!(plain.contains("error: ") && !plain.contains('\x1b'), "{plain:?}");
}

/// A reader that goes away early (`| head`) is no reason to crash.
#[cfg(unix)]
#[test]
fn closed_pipes_do_not_crash() {
    for arguments in ["completions bash", "--help"] {
        let script = format!("\"{}\" {arguments} | true; exit 0", super::support::program().display());
        let ran = std::process::Command::new("sh").args(["-c", &script]).output().unwrap();
        let err = String::from_utf8_lossy(&ran.stderr);
        assert!(!err.contains("panicked"), "{err}");
    }
}
