//! The guided capture as its page meets it: the built program, its HTTP and WebSocket side, and the recording it leaves.
//!
//! As in `cli`, the program is the one that `cargo build --release --bins` left beside these tests.

mod auto;
mod daemon;
mod guard;
mod journey;
mod killed;
mod live;
mod resumed;
