//! The listing's picture: decoded under limits, made small, and written anew as JPEG, so that nothing of the sent file but
//! its pixels reaches a buyer (no place where it was taken, no hidden content).

use std::io::Cursor;
use std::path::Path;

use axum::http::StatusCode;
use reconstruct::image::ColorImage;
use reconstruct::mesh::Mesh;
use reconstruct::poster::{self, PosterConfig};
use reconstruct::stream;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::error::{Error, Result};

/// Longest side in pixels and most bytes of the product page's picture.
const POSTER: (usize, usize) = (1024, 60_000);
/// The same of the gallery's picture.
const THUMB: (usize, usize) = (360, 15_000);
/// Qualities tried before the picture is made smaller.
const QUALITIES: [u8; 5] = [85, 75, 65, 55, 45];
/// Longest side of what is decoded at all.
const MAX_SIDE: usize = 20_000;

/// The two pictures of a listing, as JPEG.
pub(super) struct Pictures {
    pub(super) poster: Vec<u8>,
    pub(super) thumb: Vec<u8>,
}

/// Reads a PNG or JPEG file.
pub(super) fn read(path: &Path, most_pixels: usize) -> Result<Pictures> {
    let bytes = std::fs::read(path)?;
    let image = if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        decode_png(&bytes, most_pixels)?
    } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        decode_jpeg(&bytes, most_pixels)?
    } else {
        let detail = "The picture is neither PNG nor JPEG; convert it.";
        return Err(Error::refuse(StatusCode::UNSUPPORTED_MEDIA_TYPE, "not_a_picture", detail));
    };
    encode_both(&image)
}

/// Both sizes of one picture.
pub(super) fn encode_both(image: &ColorImage) -> Result<Pictures> {
    Ok(Pictures { poster: encode(image, POSTER)?, thumb: encode(image, THUMB)? })
}

fn bad(what: impl std::fmt::Display) -> Error {
    Error::unprocessable(
        "bad_picture",
        format!("The picture cannot be read: {what}. Save it again as PNG or JPEG."),
    )
}

fn check_size(width: usize, height: usize, most_pixels: usize) -> Result<()> {
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE || width * height > most_pixels {
        let detail = format!(
            "The picture has {width} x {height} pixels; make it smaller (at most {most_pixels} pixels)."
        );
        return Err(Error::unprocessable("picture_too_large", detail));
    }
    Ok(())
}

fn decode_png(bytes: &[u8], most_pixels: usize) -> Result<ColorImage> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().map_err(bad)?;
    check_size(info.width as usize, info.height as usize, most_pixels)?;
    let mut reader = decoder.read_info().map_err(bad)?;
    let mut pixels = vec![0; reader.output_buffer_size().ok_or_else(|| bad("it is too large"))?];
    let frame = reader.next_frame(&mut pixels).map_err(bad)?;
    let channels = frame.color_type.samples();
    let on_white = |value: u8, alpha: u8| {
        ((u32::from(value) * u32::from(alpha) + 255 * (255 - u32::from(alpha)) + 127) / 255) as u8
    };
    let data = pixels[..frame.buffer_size()].chunks_exact(channels).map(|p| match *p {
        [grey] => [grey; 3],
        [grey, alpha] => [on_white(grey, alpha); 3],
        [r, g, b, alpha] => [on_white(r, alpha), on_white(g, alpha), on_white(b, alpha)],
        _ => [p[0], p[1], p[2]],
    });
    Ok(ColorImage { width: frame.width as usize, height: frame.height as usize, data: data.collect() })
}

fn decode_jpeg(bytes: &[u8], most_pixels: usize) -> Result<ColorImage> {
    let options = DecoderOptions::default()
        .set_max_width(MAX_SIDE)
        .set_max_height(MAX_SIDE)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| bad(format!("{e:?}")))?;
    let (width, height) = decoder.dimensions().ok_or_else(|| bad("it has no size"))?;
    check_size(width, height, most_pixels)?;
    let pixels = decoder.decode().map_err(|e| bad(format!("{e:?}")))?;
    let data: Vec<[u8; 3]> = pixels.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    if data.len() != width * height {
        return Err(bad("its pixels are incomplete"));
    }
    Ok(ColorImage { width, height, data })
}

/// JPEG of at most that side and that many bytes: first worse, then smaller.
fn encode(image: &ColorImage, (mut side, most_bytes): (usize, usize)) -> Result<Vec<u8>> {
    loop {
        let small = shrunk(image, side);
        for quality in QUALITIES {
            let jpeg = jpeg(&small, quality)?;
            if jpeg.len() <= most_bytes || side < 64 {
                return Ok(jpeg);
            }
        }
        side = side * 3 / 4;
    }
}

fn jpeg(image: &ColorImage, quality: u8) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    let side = |n: usize| u16::try_from(n).map_err(Error::internal);
    let (width, height) = (side(image.width)?, side(image.height)?);
    jpeg_encoder::Encoder::new(&mut out, quality)
        .encode(image.data.as_flattened(), width, height, jpeg_encoder::ColorType::Rgb)
        .map_err(Error::internal)?;
    Ok(out)
}

/// The picture with its longest side at most `side`: every new pixel is the mean of the old ones it covers.
fn shrunk(image: &ColorImage, side: usize) -> ColorImage {
    let longest = image.width.max(image.height);
    if longest <= side {
        return image.clone();
    }
    let scaled = |n: usize| (n * side / longest).max(1);
    let (width, height) = (scaled(image.width), scaled(image.height));
    let mut data = Vec::with_capacity(width * height);
    for y in 0..height {
        let rows =
            y * image.height / height..((y + 1) * image.height / height).max(y * image.height / height + 1);
        for x in 0..width {
            let columns =
                x * image.width / width..((x + 1) * image.width / width).max(x * image.width / width + 1);
            let mut sums = [0u64; 3];
            for row in rows.clone() {
                for pixel in &image.data[row * image.width + columns.start..row * image.width + columns.end] {
                    (0..3).for_each(|k| sums[k] += u64::from(pixel[k]));
                }
            }
            let count = (rows.len() * columns.len()) as u64;
            data.push(sums.map(|sum| ((sum + count / 2) / count) as u8));
        }
    }
    ColorImage { width, height, data }
}

/// Most points that are drawn; more add nothing at this size.
const DRAWN_POINTS: usize = 300_000;
/// How often the triangles may cover a face of the model's bounding cube in all: drawing takes as long as they are large,
/// and a file can hold millions that each cover everything.
const DRAWN_COVERS: f64 = 200.0;

/// Pictures of a model that came without one.
pub(super) fn of_model(mesh: &Mesh) -> Result<Pictures> {
    let config = PosterConfig::default();
    if !mesh.triangles.is_empty() && covers(mesh) <= DRAWN_COVERS {
        return encode_both(&poster::draw(mesh, &config));
    }
    let mut order = stream::even_order(&mesh.vertices.points);
    order.truncate(DRAWN_POINTS);
    let indices: Vec<usize> = order.into_iter().map(|i| i as usize).collect();
    let points = Mesh::of_points(mesh.vertices.select(&indices));
    encode_both(&poster::draw(&points, &config))
}

/// Area of all triangles' bounding boxes, in faces of the model's bounding cube.
fn covers(mesh: &Mesh) -> f64 {
    let longest = |lo: [f32; 3], hi: [f32; 3]| (0..3).map(|k| f64::from(hi[k] - lo[k])).fold(0.0, f64::max);
    let Some((lo, hi)) = mesh.vertices.bounds() else { return 0.0 };
    let side = longest(lo, hi).max(f64::MIN_POSITIVE);
    let share = |triangle: &[u32; 3]| {
        let corners = triangle.map(|i| mesh.vertices.points[i as usize]);
        let lo = std::array::from_fn(|k| corners.iter().map(|c| c[k]).fold(f32::MAX, f32::min));
        let hi = std::array::from_fn(|k| corners.iter().map(|c| c[k]).fold(f32::MIN, f32::max));
        (longest(lo, hi) / side).powi(2)
    };
    mesh.triangles.iter().map(share).sum()
}

#[cfg(test)]
mod tests {
    use reconstruct::cloud::PointCloud;

    use super::*;

    fn noise(width: usize, height: usize) -> ColorImage {
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        ColorImage { width, height, data: (0..width * height).map(|_| [next(), next(), next()]).collect() }
    }

    #[test]
    fn even_noise_is_made_small_enough() {
        let pictures = encode_both(&noise(1500, 900)).unwrap();
        assert!(pictures.poster.len() <= POSTER.1, "{}", pictures.poster.len());
        assert!(pictures.thumb.len() <= THUMB.1, "{}", pictures.thumb.len());
        let back = decode_jpeg(&pictures.thumb, 1_000_000).unwrap();
        assert!(back.width > back.height);
    }

    #[test]
    fn models_made_to_keep_us_busy_are_drawn_all_the_same() {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]];
        let same = PointCloud { points: [vec![[0.5; 3]; 5000], corners].concat(), ..PointCloud::default() };
        of_model(&Mesh {
            vertices: same.clone(),
            triangles: vec![[5000, 5001, 5002]; 200_000],
            ..Mesh::default()
        })
        .unwrap();
        of_model(&Mesh::of_points(same)).unwrap();
        let one_place = PointCloud { points: vec![[0.5; 3]; 5000], ..PointCloud::default() };
        of_model(&Mesh::of_points(one_place)).unwrap();
    }

    #[test]
    fn shrinking_keeps_the_mean() {
        let image = ColorImage { width: 4, height: 2, data: [[0; 3], [200; 3]].repeat(4) };
        assert_eq!(shrunk(&image, 2).data, [[100; 3]; 2]);
    }

    #[test]
    fn a_picture_that_announces_too_many_pixels_is_refused() {
        let mut png = Vec::new();
        let mut encoder = png::Encoder::new(&mut png, 19_000, 19_000);
        encoder.set_color(png::ColorType::Grayscale);
        drop(encoder.write_header().unwrap());
        let refused = decode_png(&png, 40_000_000).unwrap_err().told();
        assert_eq!(refused.1.code, "picture_too_large");
    }
}
