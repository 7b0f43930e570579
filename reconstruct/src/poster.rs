//! The picture for the listing, drawn in software.
