//! The C libraries' own interfaces, generated from their headers (`sys/regen.sh`).

#[cfg(feature = "openni2")]
pub(crate) mod openni2;
