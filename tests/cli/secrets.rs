//! The upload token comes from the environment or a file, and is never shown.

use super::support::{Ran, command, mug_model};

const TOKEN: &str = "all_0123456789abcdef0123456789abcdef";

/// Runs an upload to where no server listens.
fn upload(more: &[&str], token: Option<&str>) -> Ran {
    let mut command = command();
    command
        .arg("upload")
        .arg(mug_model())
        .args(["--server", "http://127.0.0.1:9", "--title", "Mug"])
        .args(more);
    command.env_remove("ALLROUND_TOKEN");
    if let Some(token) = token {
        command.env("ALLROUND_TOKEN", token);
    }
    command.output().unwrap().into()
}

/// At the same time, because each tries several times to reach the server.
#[test]
fn no_output_shows_the_token() {
    let check = |how: &str| {
        let ran = upload(&[how], Some(TOKEN)).with_status(2);
        assert!(ran.err.contains("127.0.0.1:9"), "{}", ran.err);
        assert!(!ran.out.contains(TOKEN) && !ran.err.contains(TOKEN), "{how}");
    };
    std::thread::scope(|scope| {
        for how in ["--verbose", "--json"] {
            scope.spawn(move || check(how));
        }
    });
}

#[test]
fn a_token_that_is_none_is_not_shown_either() {
    let secret = "with spaces and\nlines";
    let ran = upload(&[], Some(secret)).with_status(2);
    assert!(!ran.err.contains("with spaces"), "{}", ran.err);
}

#[test]
fn no_token_says_where_to_put_one() {
    let ran = upload(&[], None).with_status(2);
    assert!(ran.err.contains("ALLROUND_TOKEN") && ran.err.contains("--token-file"), "{}", ran.err);
    let ran = upload(&["--token-file", "/nowhere/token"], None).with_status(2);
    assert!(ran.err.contains("/nowhere/token"), "{}", ran.err);
    assert_eq!(ran.complaints().len(), 1, "{}", ran.err);
}
