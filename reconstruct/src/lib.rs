//! From RGB-D views of a product on a marker board to one measurable 3D model.
//!
//! Images and poses in, a model out: no files, no network, no logging, no unsafe code.
//!
//! | what | convention |
//! |---|---|
//! | units | metres, radians, seconds (nanoseconds as integers), pixels |
//! | pixel (0, 0) | centre of the top-left pixel |
//! | camera frame | x right, y down, z forward; depth is +z |
//! | world frame | the board: origin at its centre, z up, right-handed |
//! | transforms | `a_from_b`: `p_in_a = a_from_b * p_in_b`; optimiser steps apply on the left |
//! | bulk arrays | `f32`; poses and normal equations `f64` |
//! | randomness | every random choice takes a seed; sums run in a fixed order |
#![warn(missing_docs)]

pub mod average;
pub mod board;
pub mod calibrate;
pub mod camera;
pub mod cloud;
pub mod consistency;
pub mod depth_to_color;
pub mod fuse;
pub mod image;
pub mod knn;
pub mod marker;
pub mod measure;
pub mod mesh;
pub mod model_file;
pub mod normals;
pub mod pose;
pub mod poster;
mod radix;
pub mod recording;
pub mod refine;
pub mod register;
pub mod report;
pub mod segment;
pub mod segment_free;
mod simd;
pub mod stream;
pub mod surface;
pub mod tsdf;
pub mod view;
pub mod voxel;
mod witness;
