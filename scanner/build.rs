//! Rebuilds when the capture's page was built anew; the folder may be empty, never absent.

use std::path::Path;

fn main() -> std::io::Result<()> {
    let dist = Path::new("../web/dist-capture");
    std::fs::create_dir_all(dist)?;
    println!("cargo:rerun-if-changed={}", dist.display());
    Ok(())
}
