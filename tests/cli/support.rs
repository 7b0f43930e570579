//! Runs the binary and looks at what it left.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

/// The files of a built model.
pub(crate) const RESULT: [&str; 5] = ["model.asc", "model.glb", "model.ply", "poster.png", "report.json"];

/// The binary under test, beside the tests' own.
pub(crate) fn program() -> PathBuf {
    let tests = std::env::current_exe().unwrap();
    let profile = tests.parent().and_then(Path::parent).unwrap();
    let program = profile.join(format!("scan-product{}", std::env::consts::EXE_SUFFIX));
    assert!(program.is_file(), "{} is missing: run `cargo build --release --bins` first", program.display());
    program
}

/// A run to be, free of what the caller's environment says.
pub(crate) fn command() -> Command {
    clean(Command::new(program()))
}

pub(crate) fn clean(mut command: Command) -> Command {
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        if ["SCAN_", "RAYON_", "NO_COLOR", "CLICOLOR", "COLUMNS"].iter().any(|p| text.starts_with(p)) {
            command.env_remove(&name);
        }
    }
    command
}

/// What a run gave.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) status: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl From<Output> for Ran {
    fn from(output: Output) -> Self {
        Self {
            status: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

impl Ran {
    #[track_caller]
    pub(crate) fn with_status(self, status: i32) -> Self {
        assert!(!self.err.contains("panicked"), "{}", self.err);
        assert_eq!(self.status, Some(status), "out: {}\nerr: {}", self.out, self.err);
        self
    }

    /// The lines of standard error that are no progress: warnings and the error.
    pub(crate) fn complaints(&self) -> Vec<&str> {
        self.err.lines().filter(|l| l.starts_with("error: ") || l.starts_with("warning: ")).collect()
    }
}

/// Runs `scan-product`.
pub(crate) fn scan<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Ran {
    command().args(arguments).output().unwrap().into()
}

/// Runs `scan-product build RECORDING --out OUT` and what else is given.
pub(crate) fn build(recording: &Path, out: &Path, more: &[&str]) -> Ran {
    let fixed = [OsStr::new("build"), recording.as_os_str(), OsStr::new("--out"), out.as_os_str()];
    scan(fixed.into_iter().chain(more.iter().map(OsStr::new)))
}

/// Recordings are made once a run of the tests, beside the other build products.
fn recordings() -> &'static Path {
    static HOME: OnceLock<PathBuf> = OnceLock::new();
    HOME.get_or_init(|| {
        let home = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cli-recordings");
        if home.exists() {
            fs::remove_dir_all(&home).unwrap();
        }
        fs::create_dir_all(&home).unwrap();
        home
    })
}

/// Simulates a recording; `name` tells its folder from others.
pub(crate) fn simulated(name: &str, options: &[&str]) -> PathBuf {
    let folder = recordings().join(name);
    let ran = scan(["simulate", "--quiet", "--out", folder.to_str().unwrap()].iter().chain(options));
    ran.with_status(0);
    folder
}

/// Four views of two frames of a mug on an A3 board. Not to be changed: take [`Broken::mug`] for that.
pub(crate) fn mug() -> &'static Path {
    static MUG: OnceLock<PathBuf> = OnceLock::new();
    MUG.get_or_init(|| simulated("mug", &["--product", "mug", "--views", "4", "--frames", "2"]))
}

/// The mug's model, built once.
pub(crate) fn mug_model() -> &'static Path {
    static MODEL: OnceLock<PathBuf> = OnceLock::new();
    MODEL.get_or_init(|| {
        let out = recordings().join("mug-model");
        build(mug(), &out, &[]).with_status(0);
        out
    })
}

/// A copy of a recording that a test breaks.
pub(crate) struct Broken {
    pub(crate) home: TempDir,
}

impl Broken {
    pub(crate) fn mug() -> Self {
        Self::copy_of(mug())
    }

    pub(crate) fn copy_of(recording: &Path) -> Self {
        let broken = Self { home: tempfile::tempdir().unwrap() };
        copy(recording, &broken.recording());
        broken
    }

    pub(crate) fn recording(&self) -> PathBuf {
        self.home.path().join("rec")
    }

    /// A file of the recording.
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.recording().join(name)
    }

    pub(crate) fn out(&self) -> PathBuf {
        self.home.path().join("out")
    }

    /// Changes a JSON file of the recording.
    pub(crate) fn edit(&self, name: &str, change: impl FnOnce(&mut Value)) {
        let path = self.file(name);
        let mut value = json(&path);
        change(&mut value);
        fs::write(path, value.to_string()).unwrap();
    }

    pub(crate) fn edit_recording(&self, change: impl FnOnce(&mut Value)) {
        self.edit("recording.json", change);
    }

    pub(crate) fn build(&self) -> Ran {
        build(&self.recording(), &self.out(), &[])
    }

    /// The recording can't be used: exit 2, one error line that holds `words`, an older result intact and nothing else.
    #[track_caller]
    pub(crate) fn is_refused(&self, words: &[&str]) {
        put_old_result(&self.out());
        let ran = self.build().with_status(2);
        let complaints = ran.complaints();
        assert_eq!(complaints.len(), 1, "{}", ran.err);
        for word in words {
            assert!(complaints[0].contains(word), "{word:?} is not in {:?}", complaints[0]);
        }
        assert_eq!(ran.out, "");
        assert_old_result(&self.out());
        self.nothing_half_written();
    }

    /// The recording gives no good scan: exit 1, and `report.json` alone says why.
    #[track_caller]
    pub(crate) fn gives_no_scan(&self, words: &[&str]) -> Value {
        let ran = self.build().with_status(1);
        assert_eq!(names(&self.out()), ["report.json"], "{}", ran.out);
        let report = json(&self.out().join("report.json"));
        let reason = report["verdict_reason"].as_str().unwrap();
        for word in words {
            assert!(reason.contains(word), "{word:?} is not in {reason:?}");
        }
        assert!(ran.out.contains(reason), "{}", ran.out);
        assert_eq!((&report["verdict"], &report["points"]), (&"poor".into(), &0.into()));
        self.nothing_half_written();
        report
    }

    /// There is a model without the view `name`, which is named with a reason that holds `words`.
    #[track_caller]
    pub(crate) fn leaves_out(&self, name: &str, words: &[&str]) -> Value {
        let ran = self.build().with_status(0);
        assert_eq!(names(&self.out()), RESULT);
        let report = json(&self.out().join("report.json"));
        for view in report["views"].as_array().unwrap() {
            let left_out = view["name"] == name;
            assert_eq!(view["used"], !left_out, "{view}");
            assert_eq!(view["reason"].is_null(), !left_out, "{view}");
            for word in words.iter().filter(|_| left_out) {
                assert!(
                    view["reason"].as_str().unwrap().contains(word),
                    "{word:?} is not in {}",
                    view["reason"]
                );
            }
        }
        assert!(ran.complaints().iter().any(|c| c.contains(&format!("view {name}: "))), "{}", ran.err);
        self.nothing_half_written();
        report
    }

    /// Only the recording and the result are there, nothing unfinished beside or in them.
    #[track_caller]
    pub(crate) fn nothing_half_written(&self) {
        nothing_half_written(self.home.path());
    }
}

/// No name that begins with a dot, in the folder and below.
#[track_caller]
pub(crate) fn nothing_half_written(folder: &Path) {
    for name in names(folder) {
        assert!(!name.starts_with('.') && !name.contains("partial"), "{name} stayed in {}", folder.display());
        if folder.join(&name).is_dir() {
            nothing_half_written(&folder.join(&name));
        }
    }
}

/// A result of an earlier run, so that its loss would be seen.
pub(crate) fn put_old_result(out: &Path) {
    fs::create_dir_all(out).unwrap();
    for name in RESULT.iter().chain(&["notes.txt"]) {
        fs::write(out.join(name), format!("old {name}")).unwrap();
    }
}

#[track_caller]
pub(crate) fn assert_old_result(out: &Path) {
    let files = bytes_of(out);
    assert_eq!(files.len(), RESULT.len() + 1, "{:?}", files.keys());
    for (name, bytes) in &files {
        assert_eq!(*bytes, format!("old {name}").into_bytes());
    }
}

/// The files of a folder (not of those below).
pub(crate) fn bytes_of(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    names(folder).into_iter().map(|name| (name.clone(), fs::read(folder.join(name)).unwrap())).collect()
}

/// Names in a folder, sorted.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

pub(crate) fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for name in names(from) {
        let (from, to) = (from.join(&name), to.join(&name));
        if from.is_dir() {
            copy(&from, &to);
        } else {
            fs::copy(from, to).unwrap();
        }
    }
}

pub(crate) fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// Points of a `.asc` file, millimetres.
pub(crate) fn asc_points(path: &Path) -> Vec<[f64; 3]> {
    let text = fs::read_to_string(path).unwrap();
    let point = |line: &str| {
        let mut words = line.split_whitespace().map(|w| w.parse().unwrap());
        std::array::from_fn(|_| words.next().unwrap())
    };
    text.lines().map(point).collect()
}
