//! To come.
use crate::clock::Bench;
pub(crate) fn run(_bench: &Bench) -> anyhow::Result<()> {
    Ok(())
}
