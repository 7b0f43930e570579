//! The server through real HTTP, on port 0 with a database of its own a test.

#![allow(clippy::unwrap_used, clippy::unused_self, reason = "helpers of tests, too")]

mod accounts;
mod files;
mod openapi;
mod process;
mod products;
mod refusals;
mod support;
mod uploads;
