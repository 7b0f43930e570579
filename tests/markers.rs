//! Markers on shared recordings and photographs.
