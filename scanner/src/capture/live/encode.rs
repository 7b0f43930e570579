//! A live picture as bytes: header length, header, colour JPEG, depth JPEG.
//!
//! JPEG by the crate `jpeg-encoder`: pure Rust, maintained, and with its SIMD paths several times as fast as real time needs.

use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use reconstruct::image::ColorImage;

use super::Header;

/// Good enough to judge light and sharpness by.
const QUALITY: u8 = 72;

/// The bytes of one message.
pub type Picture = Vec<u8>;

/// Packs a picture; nothing where it is larger than a JPEG can be.
pub(super) fn picture(color: &ColorImage, depth: &ColorImage, mut header: Header) -> Option<Picture> {
    let (color, depth) = rayon::join(|| jpeg(color), || jpeg(depth));
    let (color, depth) = (color?, depth.unwrap_or_default());
    (header.color_bytes, header.depth_bytes) = (color.len(), depth.len());
    let header = serde_json::to_vec(&header).ok()?;
    let mut message = Vec::with_capacity(4 + header.len() + color.len() + depth.len());
    message.extend(u32::try_from(header.len()).ok()?.to_le_bytes());
    for part in [header, color, depth] {
        message.extend_from_slice(&part);
    }
    Some(message)
}

fn jpeg(image: &ColorImage) -> Option<Vec<u8>> {
    let (width, height) = (u16::try_from(image.width).ok()?, u16::try_from(image.height).ok()?);
    let mut out = Vec::with_capacity(1 << 16);
    let mut encoder = Encoder::new(&mut out, QUALITY);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    encoder.encode(image.data.as_flattened(), width, height, ColorType::Rgb).ok()?;
    Some(out)
}
