//! Depth cameras: frames and events of real sensors, whatever their C libraries do.
//!
//! [`source`] has what every sensor offers, real, replayed or simulated: the [`source::Source`] trait.

pub mod source;
