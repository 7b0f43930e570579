//! kill -9 at fifty random moments of a capture: every view that was confirmed is there and can be read.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use scanner::capture::journal::Journal;
use scanner::pictures;
use scanner::recording::Recording;
use serde_json::json;

use super::daemon::Daemon;

const KILLS: u64 = 50;
const AT_ONCE: usize = 2;
/// The latest moment after the first order, milliseconds: about two views and a removal.
const LATEST_MILLIS: u64 = 1500;

/// What the daemon has said.
#[derive(Default)]
struct Said {
    /// Confirmed, and not ordered away since.
    there: BTreeSet<String>,
    folder: Option<PathBuf>,
}

/// Gives orders until nobody answers: views, and now and then one of them back.
fn give_orders(daemon: &Daemon, said: &Mutex<Said>, rng: &mut fastrand::Rng) -> Option<()> {
    loop {
        let (status, state) = daemon.try_post("/api/views", &json!({})).ok()?;
        // On a busy machine the picture may have a view refused; it is simply ordered again.
        if status != 200 {
            continue;
        }
        let names: BTreeSet<String> =
            state["views"].as_array()?.iter().map(|v| v["name"].as_str().unwrap().to_owned()).collect();
        let last = names.last()?.clone();
        {
            let mut said = said.lock().unwrap();
            said.there.insert(last.clone());
            said.folder = Some(state["folder"].as_str()?.into());
        }
        if rng.u8(0..3) == 0 {
            said.lock().unwrap().there.remove(&last);
            daemon.try_delete(&format!("/api/views/{last}")).ok()?;
        }
    }
}

/// Every frame of every view can be decoded, not only those that a build would look at.
fn check_readable(folder: &Path, there: &BTreeSet<String>, when: &str) {
    let recording = Recording::open(folder).unwrap_or_else(|e| panic!("{when}: {e}"));
    let names: BTreeSet<String> = recording.view_names().into_iter().collect();
    assert!(names.is_superset(there), "{when}: {there:?} were confirmed, {names:?} are there");
    for (index, view) in recording.file().views.iter().enumerate() {
        assert_eq!(recording.load_view(index).unwrap().depths.len(), 10, "{when}");
        for frame in &view.frames {
            let bytes = std::fs::read(folder.join(&frame.color)).unwrap();
            pictures::decode_color(&bytes, 640, 480)
                .unwrap_or_else(|e| panic!("{when}: {}: {e}", frame.color));
        }
    }
}

/// One capture and its end; gives how many views had been confirmed.
fn kill_once(number: u64) -> usize {
    let mut rng = fastrand::Rng::with_seed(number);
    let out = tempfile::tempdir().unwrap();
    let daemon = Daemon::capture(out.path(), "simulated:bowl");
    daemon.order("/api/board", &json!({"paper": "a3"}));
    let moment = Duration::from_millis(rng.u64(0..LATEST_MILLIS));
    let said = Mutex::new(Said::default());
    std::thread::scope(|scope| {
        scope.spawn(|| give_orders(&daemon, &said, &mut fastrand::Rng::with_seed(!number)));
        std::thread::sleep(moment);
        daemon.kill();
    });
    let said = said.into_inner().unwrap();
    let Some(folder) = said.folder else { return 0 };
    let when = format!("kill {number} after {moment:?}");
    if !said.there.is_empty() {
        check_readable(&folder, &said.there, &when);
    }
    // Going on with it removes what was left of the view in work, and nothing else.
    let journal = Journal::resume(&folder).unwrap_or_else(|e| panic!("{when}: {e}"));
    let named: BTreeSet<String> = journal.file().views.iter().map(|v| v.name.clone()).collect();
    let on_disk: BTreeSet<String> = std::fs::read_dir(folder.join("views"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(named, on_disk, "{when}");
    if !said.there.is_empty() {
        check_readable(&folder, &said.there, &when);
    }
    said.there.len()
}

#[test]
fn no_kill_loses_a_confirmed_view() {
    let (next, confirmed) = (AtomicU64::new(0), AtomicU64::new(0));
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                while let number @ 0..KILLS = next.fetch_add(1, Ordering::Relaxed) {
                    confirmed.fetch_add(kill_once(number) as u64, Ordering::Relaxed);
                }
            });
        }
    });
    let confirmed = confirmed.into_inner();
    println!("{KILLS} kills, {confirmed} confirmed views, all there");
    // On a busy machine most kills come before the first view is complete; some must have had something to lose.
    assert!(confirmed >= KILLS / 10, "hardly any kill had something to lose: {confirmed}");
}
