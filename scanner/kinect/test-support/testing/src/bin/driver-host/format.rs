//! Passes images on as libfreenect gives them, in the format that the target names: what the driver's own work is
//! compared with.

use std::time::Duration;

use kinect::freenect::handle::{Parts, Which};
use kinect::freenect::inbox::{self, Stream};
use kinect::freenect::mode::Format;
use kinect::wire::{Message, Stamped};
use kinect::worker::{DriverError, Link, Request};
use reconstruct::image::{ColorImage, DepthImage};

/// Streams one format, each image with a partner of nothing, so that pairs come out.
pub(crate) fn run(request: &Request, link: &mut Link) -> Result<(), DriverError> {
    let format = match request.target.as_str() {
        "raw" => Format::Raw,
        "ten-bits" => Format::RawTenBits,
        "millimetres" => Format::Millimetres,
        "registered" => Format::Registered,
        "color" => Format::Color,
        "large-color" => Format::LargeColor,
        "bayer" => Format::Bayer,
        other => return Err(DriverError::other(format!("no format {other}"))),
    };
    let context = kinect::freenect::context()?;
    let sensor = context.open(&Which::Number(0), Parts::Cameras)?;
    let mut sensor = sensor.ok_or_else(|| DriverError::other("the sensor does not open"))?;
    link.opened(super::info())?;
    sensor.start(format)?;
    let mut index = 0u64;
    while context.process(Duration::from_millis(20)) && !link.is_over() {
        for image in inbox::take_images() {
            let timestamp_nanos = index * 33_333_333;
            index += 1;
            let (color, depth) = images(format, &image.bytes);
            link.send(&Message::Color(Stamped { image: color, timestamp_nanos, lost_packets: 0 }))?;
            link.send(&Message::Depth(Stamped {
                image: depth,
                timestamp_nanos,
                lost_packets: image.lost_packets,
            }))?;
        }
        link.alive()?;
    }
    Ok(())
}

fn images(format: Format, bytes: &[u8]) -> (ColorImage, DepthImage) {
    let (width, height) = if format == Format::LargeColor { (1280, 1024) } else { (640, 480) };
    let mut color = ColorImage::filled(1, 1, [0; 3]);
    let mut depth = DepthImage { width: 1, height: 1, data: vec![0], units_per_metre: 1000.0 };
    match (format.stream(), format) {
        (Stream::Depth, _) => {
            let data = bytes.as_chunks().0.iter().map(|&pair| u16::from_le_bytes(pair)).collect();
            depth = DepthImage { width, height, data, units_per_metre: 1000.0 };
        }
        (Stream::Video, Format::Bayer) => {
            color = ColorImage { width, height, data: bytes.iter().map(|&value| [value; 3]).collect() };
        }
        (Stream::Video, _) => color = ColorImage { width, height, data: bytes.as_chunks().0.to_vec() },
    }
    (color, depth)
}
