//! Licences and duplicate versions of every crate and npm package that goes into the product.
//!
//! Reads `cargo metadata` and the npm lock files; needs no network. Fails with the offenders' names.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::{Command, ExitCode};

use serde_json::Value;

/// Licences that may be shipped with a program under MIT OR Apache-2.0.
const ALLOWED: &[&str] = &[
    "IJG",
    "MIT",
    "MIT-0",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-1-Clause",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "Zlib",
    "0BSD",
    "Unicode-3.0",
    "CC0-1.0",
    "CDLA-Permissive-2.0",
    "BSL-1.0",
];

/// Licences of tools that are only used while building and testing.
const ALLOWED_FOR_TOOLS: &[&str] =
    &["MPL-2.0", "BlueOak-1.0.0", "CC-BY-4.0", "Python-2.0", "Unlicense", "WTFPL"];

/// Crates that may be there in more than one version, since well-kept libraries have not yet moved on together.
const MAY_BE_TWICE: &[&str] = &[
    "base64",
    "bitflags",
    "block-buffer",
    "core-foundation",
    "cpufeatures",
    "crypto-common",
    "digest",
    "foldhash",
    "getrandom",
    "glam",
    "hashbrown",
    "heck",
    "itertools",
    "linux-raw-sys",
    "miniz_oxide",
    "r-efi",
    "rand",
    "rand_chacha",
    "rand_core",
    "rustc-hash",
    "rustix",
    "security-framework",
    "sha1",
    "sha2",
    "syn",
    "thiserror",
    "thiserror-impl",
    "toml_datetime",
    "unicode-width",
    "wasi",
    "webpki-roots",
    "winnow",
    "wit-bindgen",
    "zerocopy",
];

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let problems: Vec<String> =
        [crates(root), npm(&root.join("web")), npm(&root.join("tests/e2e"))].into_iter().flatten().collect();
    for problem in &problems {
        eprintln!("{problem}");
    }
    if problems.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Problems of the Rust side.
fn crates(root: &Path) -> Vec<String> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked"])
        .current_dir(root)
        .output();
    let metadata: Value = match output.map_err(|e| e.to_string()).and_then(|o| {
        serde_json::from_slice(&o.stdout).map_err(|e| format!("{e}: {}", String::from_utf8_lossy(&o.stderr)))
    }) {
        Ok(metadata) => metadata,
        Err(error) => return vec![format!("cargo metadata cannot be read: {error}")],
    };
    let mut problems = Vec::new();
    let mut versions: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let packages = metadata["packages"].as_array().cloned().unwrap_or_default();
    for package in packages.iter().filter(|p| !p["source"].is_null()) {
        let (name, version) = (text(&package["name"]), text(&package["version"]));
        let licence = text(&package["license"]);
        if !is_allowed(&licence, ALLOWED) {
            problems.push(format!("crate {name} {version}: licence {licence:?} is not among the allowed"));
        }
        versions.entry(name).or_default().insert(version);
    }
    let twice = versions.iter().filter(|(name, v)| v.len() > 1 && !may_be_twice(name));
    problems.extend(twice.map(|(name, v)| format!("crate {name} is there {} times: {v:?}", v.len())));
    println!("{} crates looked at", packages.len());
    problems
}

/// Bindings of other systems come in many versions and are not linked here.
fn may_be_twice(name: &str) -> bool {
    MAY_BE_TWICE.contains(&name) || name.starts_with("windows")
}

/// Problems of one npm lock file.
fn npm(folder: &Path) -> Vec<String> {
    let lock = folder.join("package-lock.json");
    let read = std::fs::read(&lock).map_err(|e| e.to_string());
    let parsed: Result<Value, String> =
        read.and_then(|bytes| serde_json::from_slice(&bytes).map_err(|e| e.to_string()));
    let packages = match parsed {
        Ok(value) => value["packages"].as_object().cloned().unwrap_or_default(),
        Err(error) => return vec![format!("{}: {error}", lock.display())],
    };
    let mut problems = Vec::new();
    for (name, package) in packages.iter().filter(|(name, _)| !name.is_empty()) {
        let licence = text(&package["license"]);
        let tool =
            package["dev"].as_bool().unwrap_or(false) || package["devOptional"].as_bool().unwrap_or(false);
        let allowed = is_allowed(&licence, ALLOWED)
            || tool && is_allowed(&licence, &[ALLOWED, ALLOWED_FOR_TOOLS].concat());
        if !allowed {
            problems.push(format!("npm {name}: licence {licence:?} is not among the allowed"));
        }
    }
    println!("{} npm packages looked at in {}", packages.len(), folder.display());
    problems
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

/// Whether an SPDX expression can be met with the allowed licences: any of an OR, all of an AND.
fn is_allowed(expression: &str, allowed: &[&str]) -> bool {
    let plain = expression.replace(['(', ')'], " ").replace('/', " OR ");
    let plain = plain.split_whitespace().collect::<Vec<_>>().join(" ");
    // AND binds more tightly; parentheses in real expressions stand around the OR: (MIT OR X) AND Y
    let flat_or = |part: &str| part.split(" OR ").any(|l| allowed.contains(&l.trim()));
    if expression.contains('(') {
        plain.split(" AND ").all(flat_or)
    } else {
        plain.split(" OR ").any(|part| part.split(" AND ").all(|l| allowed.contains(&l.trim())))
    }
}
