//! `product-server`: stores, lists and streams 3D product models. Start reading in `routes`, then `ingest`.

pub mod auth;
pub mod body;
pub mod clean;
pub mod cli;
pub mod config;
pub mod db;
pub mod error;
pub mod extract;
pub mod ingest;
pub mod model;
pub mod observe;
pub mod routes;
pub mod serve;
pub mod state;
pub mod storage;
pub mod tokens;
pub mod views;
