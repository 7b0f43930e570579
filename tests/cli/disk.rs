//! Results appear whole or not at all, whatever the disk does.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::support::{
    Ran, assert_old_result, build, clean, mug, names, nothing_half_written, program, put_old_result, scan,
};

/// Runs a shell script in which `$PROGRAM`, `$REC` and `$HOME_DIR` are set.
fn shell(script: &str, wrapper: &[&str], home: &Path) -> Ran {
    let mut words = wrapper.iter().copied().chain(["sh", "-c", script]);
    let mut command = clean(Command::new(words.next().unwrap()));
    command.args(words).env("PROGRAM", program()).env("REC", mug()).env("HOME_DIR", home);
    command.output().unwrap().into()
}

/// `ulimit -f` counts blocks of 512 bytes: the first files of the result fit, the larger ones do not.
#[test]
fn a_file_size_limit_stops_the_build_and_leaves_the_older_result() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    put_old_result(&out);
    let script = r#"trap '' XFSZ; ulimit -f 300; exec "$PROGRAM" build "$REC" --out "$HOME_DIR/out""#;
    let ran = shell(script, &["env"], home.path()).with_status(2);
    assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
    assert!(ran.err.contains("cannot write") && ran.err.contains("model."), "{}", ran.err);
    assert_old_result(&out);
    nothing_half_written(home.path());
}

#[test]
fn a_file_size_limit_stops_a_simulation() {
    let home = tempfile::tempdir().unwrap();
    let script = r#"trap '' XFSZ; ulimit -f 100
        exec "$PROGRAM" simulate --product mug --views 1 --frames 1 --out "$HOME_DIR/rec""#;
    let ran = shell(script, &["env"], home.path()).with_status(2);
    assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
    assert_eq!(names(home.path()), [""; 0]);
}

/// A small file system of its own, in a name space that goes away with the shell. Needs the right to mount.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_named_and_leaves_the_older_result() {
    let home = tempfile::tempdir().unwrap();
    let disk = home.path().join("disk");
    fs::create_dir(&disk).unwrap();
    let mount = r#"mount -t tmpfs -o size=600k tmpfs "$HOME_DIR/disk""#;
    let spaces: [&[&str]; 2] =
        [&["unshare", "--mount"], &["unshare", "--user", "--map-root-user", "--mount"]];
    let allowed = |space: &&&[&str]| {
        let words = [space, &["sh", "-c", mount][..]].concat();
        let ran = Command::new(words[0]).args(&words[1..]).env("HOME_DIR", home.path()).output();
        ran.is_ok_and(|ran| ran.status.success())
    };
    let Some(space) = spaces.iter().find(allowed) else {
        println!("skipped: no right to mount a small file system");
        return;
    };
    let script = format!(
        r#"{mount} && cd "$HOME_DIR/disk" && mkdir out && echo old > out/model.asc && echo old > out/report.json
        "$PROGRAM" build "$REC" --out out
        echo "status $?"; ls -A . out; cat out/*
        "$PROGRAM" simulate --product mug --views 2 --frames 1 --out rec
        echo "status $?"; ls -A"#
    );
    let ran = shell(&script, space, home.path()).with_status(0);
    assert_eq!(
        ran.out, "status 2\n.:\nout\n\nout:\nmodel.asc\nreport.json\nold\nold\nstatus 2\nout\n",
        "{}",
        ran.err
    );
    let complaints = ran.complaints();
    assert_eq!(complaints.len(), 2, "{}", ran.err);
    assert!(
        complaints.iter().all(|c| c.contains("the disk is full") && c.contains("free some space")),
        "{complaints:?}"
    );
}

#[test]
fn a_file_in_the_place_of_the_folder() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    fs::write(&out, "precious").unwrap();
    let ran = build(mug(), &out, &[]).with_status(2);
    assert!(ran.err.contains("is a file where a folder is to be written"), "{}", ran.err);
    assert_eq!(fs::read(&out).unwrap(), b"precious");
    assert_eq!(names(home.path()), ["out"]);
}

/// What may not be written is said before the work begins. A kernel file system refuses even the superuser.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_cannot_be_written() {
    for out in ["/proc/out", "/dev/null/out"] {
        let ran = build(mug(), Path::new(out), &[]).with_status(2);
        assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
        assert!(ran.err.contains("cannot write") && ran.err.contains("you may write there"), "{}", ran.err);
        assert!(!ran.err.contains("fuse"), "said only after the work: {}", ran.err);
    }
}

#[test]
fn foreign_files_in_the_folder_stay() {
    let home = tempfile::tempdir().unwrap();
    put_old_result(home.path());
    build(mug(), home.path(), &[]).with_status(0);
    let mut expected = super::support::RESULT.to_vec();
    expected.insert(3, "notes.txt");
    assert_eq!(names(home.path()), expected);
    assert_eq!(fs::read(home.path().join("notes.txt")).unwrap(), b"old notes.txt");
    assert_ne!(fs::read(home.path().join("model.asc")).unwrap(), b"old model.asc");
}

/// A recording's `color` and `depth` would replace a photographer's own.
#[test]
fn a_folder_of_other_pictures_is_not_overwritten() {
    let home = tempfile::tempdir().unwrap();
    fs::create_dir(home.path().join("color")).unwrap();
    fs::write(home.path().join("color/holiday.png"), "precious").unwrap();
    let folder = home.path().to_str().unwrap();
    let simulate = ["simulate", "--product", "mug", "--views", "1", "--frames", "1", "--out", folder];
    let ran = scan(simulate).with_status(2);
    assert!(ran.err.contains("color") && ran.err.contains("another folder"), "{}", ran.err);
    assert!(!ran.err.contains("simulating"), "said only after the work: {}", ran.err);
    assert_eq!(names(home.path()), ["color"]);
    assert_eq!(fs::read(home.path().join("color/holiday.png")).unwrap(), b"precious");
}

#[test]
fn an_older_recording_is_replaced() {
    let home = tempfile::tempdir().unwrap();
    let rec = home.path().join("rec");
    let simulate = |views: &str| {
        let rec = rec.to_str().unwrap();
        scan(["simulate", "--product", "mug", "--views", views, "--frames", "1", "--out", rec])
            .with_status(0);
    };
    simulate("2");
    simulate("1");
    assert_eq!(names(&rec.join("color")), ["000000.png"]);
    assert_eq!(names(home.path()), ["rec"]);
}
