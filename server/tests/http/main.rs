//! The server through real HTTP, on port 0 with a database of its own a test.

mod accounts;
mod files;
mod openapi;
mod process;
mod products;
mod refusals;
mod support;
mod uploads;
