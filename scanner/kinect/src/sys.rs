//! The C libraries' own interfaces, generated from their headers (`sys/regen.sh`, `sys/regen-freenect.sh`) and opened at run time.

#[cfg(feature = "freenect")]
pub(crate) mod freenect;
#[cfg(feature = "openni2")]
pub(crate) mod openni2;
