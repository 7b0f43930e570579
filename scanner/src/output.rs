//! Results on disk appear whole or not at all: everything is written under a temporary name and renamed when it is
//! complete. A folder that already holds a result keeps it until the new one is there, and keeps foreign files always.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Why a result could not be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// No space left.
    #[error("the disk is full while writing {}; free some space and run the command again, nothing was left behind", .0.display())]
    DiskFull(PathBuf),
    /// The target is a file.
    #[error("{} is a file where a folder is to be written; name another folder", .0.display())]
    NotAFolder(PathBuf),
    /// Pictures or files of somebody else would be replaced.
    #[error("{} is already there and belongs to no recording; name another folder, so that nothing is lost", .0.display())]
    Foreign(PathBuf),
    /// Not allowed, or another trouble of the file system.
    #[error("cannot write {}: {source}; check that the folder exists and that you may write there", .path.display())]
    Io {
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Ctrl-C came first.
    #[error("interrupted")]
    Interrupted,
}

/// Temporary paths that must not outlive the process, and whether it is being interrupted.
struct Unfinished {
    paths: BTreeSet<PathBuf>,
    interrupted: bool,
}

/// So many folders of killed programs are looked at for a free name.
const MOST_LEFT: usize = 1000;

static UNFINISHED: Mutex<Unfinished> = Mutex::new(Unfinished { paths: BTreeSet::new(), interrupted: false });

fn unfinished() -> MutexGuard<'static, Unfinished> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes everything half-written and refuses all further output: for the Ctrl-C handler, before it exits.
pub fn remove_unfinished() {
    let mut unfinished = unfinished();
    unfinished.interrupted = true;
    for path in std::mem::take(&mut unfinished.paths) {
        remove(&path);
    }
}

/// Whether Ctrl-C came.
pub fn is_interrupted() -> bool {
    unfinished().interrupted
}

/// Says before long work whether a result can be written to `target` at all; leaves nothing.
pub fn check_writable(target: &Path) -> Result<(), OutputError> {
    OutputDir::begin(target, &[]).map(drop)
}

/// Removes a temporary file or folder. Another thread may be writing into it: what it adds is removed in the next round.
fn remove(path: &Path) {
    for _ in 0..100 {
        let gone = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        match gone {
            Err(e) if e.kind() != io::ErrorKind::NotFound => std::thread::yield_now(),
            _ => return,
        }
    }
}

fn register(path: &Path) -> Result<(), OutputError> {
    let mut unfinished = unfinished();
    if unfinished.interrupted {
        return Err(OutputError::Interrupted);
    }
    unfinished.paths.insert(path.to_owned());
    Ok(())
}

fn io_error(path: &Path, source: io::Error) -> OutputError {
    match source.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => OutputError::DiskFull(path.to_owned()),
        _ => OutputError::Io { path: path.to_owned(), source },
    }
}

/// A folder being written. Dropped without [`Self::commit`], it leaves nothing.
#[derive(Debug)]
pub struct OutputDir {
    target: PathBuf,
    temporary: PathBuf,
    owned: Vec<String>,
}

impl OutputDir {
    /// Starts writing `target`. `owned` are the names this kind of result consists of: older ones are replaced, or
    /// removed where the new result has none; anything else in the folder stays.
    pub fn begin(target: &Path, owned: &[&str]) -> Result<Self, OutputError> {
        if target.exists() && !target.is_dir() {
            return Err(OutputError::NotAFolder(target.to_owned()));
        }
        let temporary = temporary_path(target)?;
        register(&temporary)?;
        let owned = owned.iter().map(|&name| name.to_owned()).collect();
        let dir = Self { target: target.to_owned(), temporary, owned };
        fs::create_dir_all(&dir.temporary).map_err(|e| io_error(target, e))?;
        Ok(dir)
    }

    /// As [`Self::begin`], but it grows in `OUT.partial` beside (or `partial` inside, where `OUT` is there already), so that
    /// people find what is left of it should the program be killed. What an earlier one left stays.
    pub fn begin_in_sight(target: &Path, owned: &[&str]) -> Result<Self, OutputError> {
        let mut dir = Self::begin(target, owned)?;
        let base = if target.is_dir() { target.join("recording") } else { target.to_owned() };
        for number in 1..MOST_LEFT {
            let mut name = base.file_name().unwrap_or_default().to_owned();
            name.push(if number == 1 { ".partial".to_owned() } else { format!(".partial-{number}") });
            let path = base.with_file_name(name);
            register(&path)?;
            match fs::create_dir(&path) {
                Ok(()) => {
                    let hidden = std::mem::replace(&mut dir.temporary, path);
                    remove(&hidden);
                    unfinished().paths.remove(&hidden);
                    return Ok(dir);
                }
                Err(e) => {
                    // It is somebody else's: an interruption must not remove it.
                    unfinished().paths.remove(&path);
                    if e.kind() != io::ErrorKind::AlreadyExists {
                        return Err(io_error(target, e));
                    }
                }
            }
        }
        // Nobody has left so many; then the usual place will do.
        Ok(dir)
    }

    /// The folder to write into until [`Self::commit`].
    pub fn path(&self) -> &Path {
        &self.temporary
    }

    /// Writes one file of the result; `name` may hold sub-folders.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), OutputError> {
        self.write_with(name, |file| file.write_all(bytes))
    }

    /// Writes one file of the result through a buffered writer.
    pub fn write_with<F>(&self, name: &str, write: F) -> Result<(), OutputError>
    where
        F: FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    {
        let path = self.temporary.join(name);
        let shown = self.target.join(name);
        let all = || {
            self.make_subfolders(name)?;
            let mut file = BufWriter::with_capacity(1 << 16, File::create(&path)?);
            write(&mut file)?;
            file.flush()
        };
        all().map_err(|e| io_error(&shown, e))
    }

    /// Replaces one file of the unfinished result as a whole: at any moment the old one or the new one is there.
    pub fn renew(&self, name: &str, bytes: &[u8]) -> Result<(), OutputError> {
        let beside = format!("{name}.new");
        self.write(&beside, bytes)?;
        let path = self.temporary.join(name);
        fs::rename(self.temporary.join(beside), &path).map_err(|e| io_error(&self.target.join(name), e))
    }

    /// Makes the folders of `name` inside the temporary one, but never that itself: an interruption may have removed it.
    fn make_subfolders(&self, name: &str) -> io::Result<()> {
        let mut folder = self.temporary.clone();
        for part in Path::new(name).parent().iter().flat_map(|p| p.components()) {
            folder.push(part);
            match fs::create_dir(&folder) {
                Err(e) if e.kind() != io::ErrorKind::AlreadyExists => return Err(e),
                _ => {}
            }
        }
        Ok(())
    }

    /// Puts the result into its place. An older result is kept aside until the new one is there, and put back on failure.
    pub fn commit(self) -> Result<(), OutputError> {
        // Held to the end: an interruption waits until the result is in place.
        let mut unfinished = unfinished();
        if unfinished.interrupted {
            return Err(OutputError::Interrupted);
        }
        let result = if self.target.is_dir() {
            self.replace_entries()
        } else {
            fs::rename(&self.temporary, &self.target)
        };
        unfinished.paths.remove(&self.temporary);
        drop(unfinished);
        result.map_err(|e| io_error(&self.target, e))
    }

    /// Moves the old result aside, the new one in, and removes the old; on failure everything is moved back.
    fn replace_entries(&self) -> io::Result<()> {
        let new: Vec<OsString> =
            fs::read_dir(&self.temporary)?.map(|e| e.map(|e| e.file_name())).collect::<io::Result<_>>()?;
        let aside = self.temporary.join(".replaced");
        fs::create_dir(&aside)?;
        let mut done: Vec<(PathBuf, PathBuf)> = Vec::new();
        let mut move_entry = |from: PathBuf, to: PathBuf| -> io::Result<()> {
            fs::rename(&from, &to)?;
            done.push((from, to));
            Ok(())
        };
        let owned = self.owned.iter().map(OsString::from);
        let leaving: BTreeSet<OsString> = owned.chain(new.iter().cloned()).collect();
        let mut all = || -> io::Result<()> {
            for name in &leaving {
                let old = self.target.join(name);
                if old.symlink_metadata().is_ok() {
                    move_entry(old, aside.join(name))?;
                }
            }
            new.iter().try_for_each(|name| move_entry(self.temporary.join(name), self.target.join(name)))
        };
        let result = all();
        if result.is_err() {
            for (from, to) in done.iter().rev() {
                fs::rename(to, from)?;
            }
        }
        result
    }
}

impl Drop for OutputDir {
    fn drop(&mut self) {
        remove(&self.temporary);
        unfinished().paths.remove(&self.temporary);
    }
}

/// Writes one file under a temporary name and renames it into place.
pub fn write_file(target: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let temporary = sibling(target)?;
    register(&temporary)?;
    let result = fs::write(&temporary, bytes).and_then(|()| fs::rename(&temporary, target));
    if result.is_err() {
        remove(&temporary);
    }
    unfinished().paths.remove(&temporary);
    result.map_err(|e| io_error(target, e))
}

/// Where a folder grows: inside the target where that exists (the same file system for sure), else beside it.
fn temporary_path(target: &Path) -> Result<PathBuf, OutputError> {
    if target.is_dir() { Ok(target.join(temporary_name("result".as_ref()))) } else { sibling(target) }
}

fn sibling(target: &Path) -> Result<PathBuf, OutputError> {
    let no_name = || io::Error::new(io::ErrorKind::InvalidInput, "the path has no last name");
    let name = target.file_name().ok_or_else(|| io_error(target, no_name()))?;
    Ok(target.with_file_name(temporary_name(name)))
}

fn temporary_name(name: &std::ffi::OsStr) -> OsString {
    static COUNTER: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);
    let count = COUNTER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    let mut temporary = OsString::from(".");
    temporary.push(name);
    temporary.push(format!(".{}-{count}.unfinished", std::process::id()));
    temporary
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn nothing_is_seen_before_the_end() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        let dir = OutputDir::begin(&out, &["a.txt"]).unwrap();
        dir.write("a.txt", b"1").unwrap();
        dir.write("color/b.txt", b"2").unwrap();
        assert!(!out.exists());
        dir.commit().unwrap();
        assert_eq!(names(home.path()), ["out"]);
        assert_eq!(names(&out), ["a.txt", "color"]);
    }

    #[test]
    fn what_grows_in_sight_takes_nobodys_place() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        fs::create_dir(home.path().join("out.partial")).unwrap();
        fs::write(home.path().join("out.partial/a.txt"), "left").unwrap();
        let dir = OutputDir::begin_in_sight(&out, &["a.txt"]).unwrap();
        dir.renew("a.txt", b"1").unwrap();
        dir.renew("a.txt", b"2").unwrap();
        assert_eq!(fs::read(home.path().join("out.partial-2/a.txt")).unwrap(), b"2");
        dir.commit().unwrap();
        assert_eq!(
            (names(home.path()), names(&out)),
            (vec!["out".into(), "out.partial".into()], vec!["a.txt".into()])
        );
        let dir = OutputDir::begin_in_sight(&out, &["a.txt"]).unwrap();
        assert!(out.join("recording.partial").is_dir());
        drop(dir);
        assert_eq!((names(home.path()).len(), names(&out)), (2, vec!["a.txt".into()]));
    }

    #[test]
    fn an_abandoned_result_leaves_nothing() {
        let home = tempfile::tempdir().unwrap();
        let dir = OutputDir::begin(&home.path().join("deep/out"), &[]).unwrap();
        dir.write("a.txt", b"1").unwrap();
        drop(dir);
        assert_eq!(names(&home.path().join("deep")), [""; 0]);
    }

    #[test]
    fn an_older_result_goes_and_foreign_files_stay() {
        let home = tempfile::tempdir().unwrap();
        fs::create_dir(home.path().join("color")).unwrap();
        for name in ["model.asc", "report.json", "notes.txt", "color/old.png"] {
            fs::write(home.path().join(name), "old").unwrap();
        }
        let dir = OutputDir::begin(home.path(), &["model.asc", "report.json", "color"]).unwrap();
        dir.write("report.json", b"new").unwrap();
        assert_eq!(fs::read(home.path().join("report.json")).unwrap(), b"old");
        dir.commit().unwrap();
        assert_eq!(names(home.path()), ["notes.txt", "report.json"]);
        assert_eq!(fs::read(home.path().join("report.json")).unwrap(), b"new");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_named_and_the_older_result_stays() {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("model.asc"), "old").unwrap();
        let dir = OutputDir::begin(home.path(), &["model.asc"]).unwrap();
        std::os::unix::fs::symlink("/dev/full", dir.path().join("model.asc")).unwrap();
        let error = dir.write("model.asc", b"new").unwrap_err();
        assert!(matches!(&error, OutputError::DiskFull(path) if path.ends_with("model.asc")), "{error}");
        drop(dir);
        assert_eq!(names(home.path()), ["model.asc"]);
        assert_eq!(fs::read(home.path().join("model.asc")).unwrap(), b"old");
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let home = tempfile::tempdir().unwrap();
        let file = home.path().join("out");
        write_file(&file, b"x").unwrap();
        assert!(matches!(OutputDir::begin(&file, &[]), Err(OutputError::NotAFolder(_))));
        assert_eq!(names(home.path()), ["out"]);
    }
}
