//! The same input gives the same bytes, whatever the number of threads.

use std::path::{Path, PathBuf};

use super::support::{RESULT, bytes_of, command, json, mug};

/// Builds with a number of threads and gives the folder.
fn built(home: &Path, threads: &str, more: &[&str]) -> PathBuf {
    let out = home.join(threads);
    let mut command = command();
    command.arg("build").arg(mug()).arg("--out").arg(&out).args(more).env("RAYON_NUM_THREADS", threads);
    super::support::Ran::from(command.output().unwrap()).with_status(0);
    out
}

#[track_caller]
fn check_same(more: &[&str]) {
    let home = tempfile::tempdir().unwrap();
    let (one, two) = (built(home.path(), "1", more), built(home.path(), "2", more));
    let (one_files, two_files) = (bytes_of(&one), bytes_of(&two));
    for name in RESULT.iter().filter(|name| **name != "report.json") {
        assert!(one_files[*name] == two_files[*name], "{name} depends on the number of threads");
        assert!(one_files[*name].len() > 100, "{name} is empty");
    }
    let report = |folder: &Path| {
        let mut report = json(&folder.join("report.json"));
        report["timings_ms"].take();
        report
    };
    assert_eq!(report(&one), report(&two));
}

#[test]
fn the_joint_method() {
    check_same(&[]);
}

#[test]
fn the_method_of_the_source() {
    check_same(&["--method", "source"]);
}

#[test]
fn a_simulation() {
    let home = tempfile::tempdir().unwrap();
    let simulate = |threads: &str| {
        let out = home.path().join(threads);
        let arguments =
            ["simulate", "--product", "shoe", "--views", "2", "--frames", "2", "--seed", "9", "--out"];
        let ran = command().args(arguments).arg(&out).env("RAYON_NUM_THREADS", threads).output().unwrap();
        super::support::Ran::from(ran).with_status(0);
        ["", "color", "depth", "truth"].map(|folder| files_of(&out.join(folder)))
    };
    assert!(simulate("1") == simulate("2"), "a simulated recording depends on the number of threads");
}

fn files_of(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let names = super::support::names(folder).into_iter().filter(|name| folder.join(name).is_file());
    names.map(|name| (name.clone(), std::fs::read(folder.join(name)).unwrap())).collect()
}
