//! Pictures as bytes: PNG and JPEG in, PNG out. Nothing is believed before it is checked: the announced size is
//! compared with what the caller expects before a pixel is allocated.

mod palette;

use std::io::Cursor;

use png::{BitDepth, ColorType, Transformations};
use reconstruct::image::{ColorImage, DepthImage};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Widest or highest picture that is read.
pub const MAX_SIDE: usize = 8192;

/// What is wrong with a picture; each message says what to do, the caller names the file.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
pub enum PictureError {
    /// Another format than PNG or JPEG.
    #[error("it is neither a PNG nor a JPEG picture; convert it to PNG")]
    UnknownFormat,
    /// Not the announced size.
    #[error(
        "it is {found_width}x{found_height} pixels where {width}x{height} are announced; correct the size in the \
         description or record again"
    )]
    WrongSize {
        /// Width of the picture.
        found_width: usize,
        /// Height of the picture.
        found_height: usize,
        /// Expected width.
        width: usize,
        /// Expected height.
        height: usize,
    },
    /// A size no camera has.
    #[error("it announces {width}x{height} pixels; pictures from 1 to {MAX_SIDE} pixels a side are read")]
    Implausible {
        /// Announced width.
        width: usize,
        /// Announced height.
        height: usize,
    },
    /// Depth in 8 bits or in colours.
    #[error(
        "it is not a 16-bit grey PNG ({found}); save depth as 16-bit PNG without loss, as the sensor gave it"
    )]
    NotDepth {
        /// What it is instead.
        found: String,
    },
    /// The file ends too early.
    #[error("it is cut off before its end; copy it again or record this view again")]
    Truncated,
    /// Damaged data.
    #[error("it is damaged ({0}); copy it again or record this view again")]
    Damaged(String),
}

/// What a picture announces of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PictureSize {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

const PNG_SIGNATURE: [u8; 8] = [0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a];

/// The size a PNG or JPEG announces, without decoding it.
pub fn size(bytes: &[u8]) -> Result<PictureSize, PictureError> {
    if bytes.starts_with(&PNG_SIGNATURE) {
        let mut decoder = png::Decoder::new(Cursor::new(bytes));
        let info = decoder.read_header_info().map_err(|e| png_error(&e))?;
        plausible(info.width as usize, info.height as usize)
    } else if is_jpeg(bytes) {
        let mut decoder = jpeg_decoder(bytes);
        decoder.decode_headers().map_err(|e| jpeg_error(&e))?;
        jpeg_size(&decoder)
    } else {
        Err(PictureError::UnknownFormat)
    }
}

/// Decodes a colour picture of exactly `width` x `height` pixels.
pub fn decode_color(bytes: &[u8], width: usize, height: usize) -> Result<ColorImage, PictureError> {
    let data = if bytes.starts_with(&PNG_SIGNATURE) {
        decode_png_color(bytes, width, height)?
    } else if is_jpeg(bytes) {
        decode_jpeg(bytes, width, height)?
    } else {
        return Err(PictureError::UnknownFormat);
    };
    Ok(ColorImage { width, height, data })
}

/// Decodes a colour picture of whatever plausible size it has.
pub fn decode_color_of_any_size(bytes: &[u8]) -> Result<ColorImage, PictureError> {
    let size = size(bytes)?;
    decode_color(bytes, size.width, size.height)
}

/// Decodes a 16-bit grey PNG of exactly `width` x `height` pixels: raw values in device units.
pub fn decode_depth(
    bytes: &[u8],
    width: usize,
    height: usize,
    units_per_metre: f64,
) -> Result<DepthImage, PictureError> {
    if !bytes.starts_with(&PNG_SIGNATURE) {
        let found = if is_jpeg(bytes) { "a JPEG" } else { "another format" };
        return Err(PictureError::NotDepth { found: found.to_owned() });
    }
    let mut reader = png_reader(bytes, Transformations::IDENTITY, width, height)?;
    let (kind, depth) = reader.output_color_type();
    if (kind, depth) != (ColorType::Grayscale, BitDepth::Sixteen) {
        return Err(PictureError::NotDepth { found: format!("{} bits, {}", depth as u8, color_name(kind)) });
    }
    let mut raw = vec![0; width * height * 2];
    reader.next_frame(&mut raw).map_err(|e| png_error(&e))?;
    let data = raw.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
    Ok(DepthImage { width, height, data, units_per_metre })
}

/// A colour picture as PNG.
pub fn encode_color(image: &ColorImage) -> Result<Vec<u8>, png::EncodingError> {
    encode(image.width, image.height, ColorType::Rgb, BitDepth::Eight, image.data.as_flattened())
}

/// A depth picture as 16-bit grey PNG: the raw values.
pub fn encode_depth(image: &DepthImage) -> Result<Vec<u8>, png::EncodingError> {
    let bytes: Vec<u8> = image.data.iter().flat_map(|v| v.to_be_bytes()).collect();
    encode(image.width, image.height, ColorType::Grayscale, BitDepth::Sixteen, &bytes)
}

/// A colour picture as a camera delivers it, 30 a second: PNG, compressed as fast as it goes.
pub fn record_color(image: &ColorImage) -> Result<Vec<u8>, png::EncodingError> {
    let bytes = image.data.as_flattened();
    encode_with(image.width, image.height, ColorType::Rgb, BitDepth::Eight, bytes, png::Compression::Fastest)
}

/// A depth picture as a sensor delivers it, 30 a second: 16-bit grey PNG, compressed as fast as it goes.
pub fn record_depth(image: &DepthImage) -> Result<Vec<u8>, png::EncodingError> {
    let bytes: Vec<u8> = image.data.iter().flat_map(|v| v.to_be_bytes()).collect();
    let (width, height, compression) = (image.width, image.height, png::Compression::Fastest);
    encode_with(width, height, ColorType::Grayscale, BitDepth::Sixteen, &bytes, compression)
}

/// A picture for the web as PNG of at most `most_bytes` where 16 colours can do that: fewer colours until it fits.
pub fn encode_small(image: &ColorImage, most_bytes: usize) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    for colors in [256, 128, 64, 32, 16] {
        bytes = encode_palette(image, colors)?;
        if bytes.len() <= most_bytes {
            break;
        }
    }
    Ok(bytes)
}

fn encode_palette(image: &ColorImage, colors: usize) -> Result<Vec<u8>, png::EncodingError> {
    let (palette, pixels) = palette::reduce(&image.data, colors);
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, image.width as u32, image.height as u32);
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_palette(palette.as_flattened());
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_compression(png::Compression::Balanced);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&pixels)?;
    writer.finish()?;
    Ok(out)
}

fn encode(
    width: usize,
    height: usize,
    kind: ColorType,
    depth: BitDepth,
    bytes: &[u8],
) -> Result<Vec<u8>, png::EncodingError> {
    encode_with(width, height, kind, depth, bytes, png::Compression::Fast)
}

fn encode_with(
    width: usize,
    height: usize,
    kind: ColorType,
    depth: BitDepth,
    bytes: &[u8],
    compression: png::Compression,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut out = Vec::with_capacity(bytes.len());
    let mut encoder = png::Encoder::new(&mut out, width as u32, height as u32);
    encoder.set_color(kind);
    encoder.set_depth(depth);
    encoder.set_compression(compression);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()?;
    Ok(out)
}

fn plausible(width: usize, height: usize) -> Result<PictureSize, PictureError> {
    if (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height) {
        Ok(PictureSize { width, height })
    } else {
        Err(PictureError::Implausible { width, height })
    }
}

fn expect_size(found: PictureSize, width: usize, height: usize) -> Result<(), PictureError> {
    if (found.width, found.height) == (width, height) {
        Ok(())
    } else {
        Err(PictureError::WrongSize { found_width: found.width, found_height: found.height, width, height })
    }
}

type PngReader<'a> = png::Reader<Cursor<&'a [u8]>>;

fn png_reader(
    bytes: &[u8],
    transformations: Transformations,
    width: usize,
    height: usize,
) -> Result<PngReader<'_>, PictureError> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(transformations);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().map_err(|e| png_error(&e))?;
    expect_size(plausible(info.width as usize, info.height as usize)?, width, height)?;
    decoder.read_info().map_err(|e| png_error(&e))
}

fn decode_png_color(bytes: &[u8], width: usize, height: usize) -> Result<Vec<[u8; 3]>, PictureError> {
    let mut reader = png_reader(bytes, Transformations::normalize_to_color8(), width, height)?;
    let (kind, _) = reader.output_color_type();
    let channels = kind.samples();
    let mut raw = vec![0; width * height * channels];
    reader.next_frame(&mut raw).map_err(|e| png_error(&e))?;
    Ok(match channels {
        1 | 2 => raw.chunks_exact(channels).map(|p| [p[0]; 3]).collect(),
        _ => raw.chunks_exact(channels).map(|p| [p[0], p[1], p[2]]).collect(),
    })
}

fn png_error(error: &png::DecodingError) -> PictureError {
    match error {
        png::DecodingError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            PictureError::Truncated
        }
        other => PictureError::Damaged(other.to_string()),
    }
}

fn color_name(kind: ColorType) -> &'static str {
    match kind {
        ColorType::Grayscale => "grey",
        ColorType::Rgb => "colour",
        ColorType::Indexed => "palette",
        ColorType::GrayscaleAlpha => "grey with alpha",
        ColorType::Rgba => "colour with alpha",
    }
}

fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xff, 0xd8, 0xff])
}

fn jpeg_decoder(bytes: &[u8]) -> JpegDecoder<ZCursor<&[u8]>> {
    let options = DecoderOptions::default()
        .set_max_width(MAX_SIDE)
        .set_max_height(MAX_SIDE)
        .set_strict_mode(true)
        .jpeg_set_max_scans(64)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    JpegDecoder::new_with_options(ZCursor::new(bytes), options)
}

fn jpeg_size(decoder: &JpegDecoder<ZCursor<&[u8]>>) -> Result<PictureSize, PictureError> {
    let info = decoder.info().ok_or(PictureError::Truncated)?;
    plausible(info.width as usize, info.height as usize)
}

fn decode_jpeg(bytes: &[u8], width: usize, height: usize) -> Result<Vec<[u8; 3]>, PictureError> {
    let mut decoder = jpeg_decoder(bytes);
    decoder.decode_headers().map_err(|e| jpeg_error(&e))?;
    expect_size(jpeg_size(&decoder)?, width, height)?;
    let raw = decoder.decode().map_err(|e| jpeg_error(&e))?;
    // What follows the end marker is of no interest, but a picture without one was cut off.
    if !bytes.windows(2).rev().any(|pair| pair == [0xff, 0xd9]) {
        return Err(PictureError::Truncated);
    }
    match raw.len() / (width * height) {
        3 => Ok(raw.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()),
        1 => Ok(raw.iter().map(|&v| [v; 3]).collect()),
        _ => Err(PictureError::Damaged("an unusual number of colour channels".to_owned())),
    }
}

fn jpeg_error(error: &zune_jpeg::errors::DecodeErrors) -> PictureError {
    use zune_jpeg::errors::DecodeErrors as E;
    match error {
        E::ExhaustedData | E::IoErrors(_) => PictureError::Truncated,
        other => PictureError::Damaged(format!("{other:?}").chars().take(120).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depth() -> DepthImage {
        let data = (0..12 * 7).map(|i| (i * 771) as u16).collect();
        DepthImage { width: 12, height: 7, data, units_per_metre: 1000.0 }
    }

    fn color() -> ColorImage {
        let data = (0..12 * 7).map(|i| [i as u8, (i * 3) as u8, 200]).collect();
        ColorImage { width: 12, height: 7, data }
    }

    #[test]
    fn pictures_come_back_as_they_were() {
        let bytes = encode_depth(&depth()).unwrap();
        assert_eq!(decode_depth(&bytes, 12, 7, 1000.0).unwrap(), depth());
        let bytes = encode_color(&color()).unwrap();
        assert_eq!(decode_color(&bytes, 12, 7).unwrap(), color());
        assert_eq!(size(&bytes).unwrap(), PictureSize { width: 12, height: 7 });
    }

    #[test]
    fn a_cut_off_picture_says_so() {
        for bytes in [encode_depth(&depth()).unwrap(), encode_color(&color()).unwrap()] {
            for length in 8..bytes.len() - 16 {
                let cut = &bytes[..length];
                let depth_says = decode_depth(cut, 12, 7, 1000.0).map(|_| ());
                let color_says = decode_color(cut, 12, 7).map(|_| ());
                assert!(
                    depth_says.is_err() && color_says == Err(PictureError::Truncated),
                    "{length} {color_says:?}"
                );
            }
        }
    }

    #[test]
    fn another_size_is_refused_before_decoding() {
        let bytes = encode_depth(&depth()).unwrap();
        let error = decode_depth(&bytes, 7, 12, 1000.0).unwrap_err();
        assert_eq!(error, PictureError::WrongSize { found_width: 12, found_height: 7, width: 7, height: 12 });
    }

    #[test]
    fn depth_in_colours_is_refused() {
        let bytes = encode_color(&color()).unwrap();
        let error = decode_depth(&bytes, 12, 7, 1000.0).unwrap_err();
        assert_eq!(error, PictureError::NotDepth { found: "8 bits, colour".to_owned() });
        assert!(matches!(decode_depth(b"text", 1, 1, 1.0), Err(PictureError::NotDepth { .. })));
        assert_eq!(decode_color(b"text", 1, 1), Err(PictureError::UnknownFormat));
    }

    #[test]
    fn small_pictures_keep_their_look() {
        let data = (0..64 * 64).map(|i| [(i % 64 * 4) as u8, (i / 64 * 4) as u8, 128]).collect();
        let image = ColorImage { width: 64, height: 64, data };
        let bytes = encode_small(&image, 100_000).unwrap();
        let back = decode_color(&bytes, 64, 64).unwrap();
        let worst =
            image.data.as_flattened().iter().zip(back.data.as_flattened()).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(16), "{worst:?}");
        assert!(encode_small(&image, bytes.len() - 1).unwrap().len() < bytes.len());
    }

    #[test]
    fn a_flipped_bit_is_noticed() {
        let mut bytes = encode_color(&color()).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 0x10;
        assert!(decode_color(&bytes, 12, 7).is_err());
    }
}
