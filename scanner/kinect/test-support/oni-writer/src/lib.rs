//! Writes OpenNI2's recordings (`.oni`, container version 1.0.1.0) for tests: uncompressed streams, so that what is read
//! can be compared bit by bit.
//!
//! OpenNI2's own recorder is of no use for that: it starts the times of each stream at zero, and its depth codec loses
//! the largest value. The container is little-endian and packed: a file header, then records; each record has a header of
//! 28 bytes, fields, and a payload. Times are microseconds.

mod record;

use std::io::{self, Seek, SeekFrom, Write};

use record::{Record, Type};

/// What a stream shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Two bytes a pixel, millimetres, 0 = nothing measured.
    Depth,
    /// Two bytes a pixel, tenths of a millimetre.
    FineDepth,
    /// Three bytes a pixel: red, green, blue.
    Color,
}

/// One stream with its frames.
#[derive(Debug, Clone)]
pub struct Stream {
    /// What it shows.
    pub kind: Kind,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Frames a second, as the file says.
    pub fps: u32,
    /// Horizontal and vertical field of view, radians.
    pub field_of_view: [f64; 2],
    /// Whether the pictures are flipped left-right, as the file says.
    pub is_mirrored: bool,
    /// Time in microseconds and the bytes of each frame, in order of time.
    pub frames: Vec<(u64, Vec<u8>)>,
}

impl Kind {
    fn bytes_per_pixel(self) -> u32 {
        if self == Self::Color { 3 } else { 2 }
    }

    /// Number of the node type, of the older and of the newer pixel format.
    fn numbers(self) -> (u32, u64, u64) {
        match self {
            Self::Depth => (2, 4, 100),
            Self::FineDepth => (2, 4, 101),
            Self::Color => (3, 1, 200),
        }
    }

    fn name(self) -> &'static str {
        if self == Self::Color { "Image" } else { "Depth" }
    }
}

/// Writes a file of these streams, their frames interleaved by time.
pub fn write(file: &mut (impl Write + Seek), streams: &[Stream]) -> io::Result<()> {
    let last_micros = streams.iter().filter_map(|s| s.frames.last()).map(|f| f.0).max().unwrap_or(0);
    write_file_header(file, last_micros, streams.len() as u32)?;
    let mut added = Vec::new();
    for (node, stream) in nodes(streams) {
        added.push(file.stream_position()?);
        node_added(node, stream, 0).write(file, &[])?;
        write_properties(file, node, stream)?;
        Record::new(Type::NodeStateReady, node, 0).write(file, &[])?;
    }
    for (node, stream) in nodes(streams) {
        let begin = Record::new(Type::NodeDataBegin, node, 0);
        begin.u32(stream.frames.len() as u32).u64(last_micros).write(file, &[])?;
    }
    let places = write_frames(file, streams)?;
    let mut seek_tables = Vec::new();
    for (i, (node, _)) in nodes(streams).enumerate() {
        Record::new(Type::NodeRemoved, node, added[i]).write(file, &[])?;
        seek_tables.push(file.stream_position()?);
        Record::new(Type::SeekTable, node, 0).write(file, &seek_table(&places[i]))?;
    }
    Record::new(Type::End, 0, 0).write(file, &[])?;
    for (i, (node, stream)) in nodes(streams).enumerate() {
        file.seek(SeekFrom::Start(added[i]))?;
        node_added(node, stream, seek_tables[i]).write(file, &[])?;
    }
    file.flush()
}

/// Streams with their node numbers, which count from 1.
fn nodes(streams: &[Stream]) -> impl Iterator<Item = (u32, &Stream)> {
    (1..).zip(streams)
}

fn write_file_header(file: &mut impl Write, last_micros: u64, last_node: u32) -> io::Result<()> {
    file.write_all(b"NI10")?;
    file.write_all(&[1, 0, 1, 0, 0, 0, 0, 0])?;
    file.write_all(&last_micros.to_le_bytes())?;
    file.write_all(&last_node.to_le_bytes())
}

fn node_added(node: u32, stream: &Stream, seek_table: u64) -> Record {
    let last_micros = stream.frames.last().map_or(0, |frame| frame.0);
    Record::new(Type::NodeAdded, node, 0)
        .text(stream.kind.name())
        .u32(stream.kind.numbers().0)
        .bytes(b"NONE")
        .u32(stream.frames.len() as u32)
        .u64(0)
        .u64(last_micros)
        .u64(seek_table)
}

fn write_properties(file: &mut impl Write, node: u32, stream: &Stream) -> io::Result<()> {
    let mut int = |name: &str, value: u64| {
        Record::new(Type::IntProperty, node, 0).text(name).u32(8).u64(value).write(file, &[])
    };
    let (_, old_format, format) = stream.kind.numbers();
    let size = stream.width * stream.height * stream.kind.bytes_per_pixel();
    int("oniRequiredFrameSize", size.into())?;
    int("xnIsGenerating", 1)?;
    if stream.kind != Kind::Color {
        int("xnDeviceMaxDepth", 10_000)?;
    }
    int("xnSupportedMapOutputModesCount", 1)?;
    int("xnPixelFormat", old_format)?;
    int("oniPixelFormat", format)?;
    int("Cropping", 1)?;
    int("Mirror", 1)?;
    int("xnMirror", stream.is_mirrored.into())?;
    let mut general = |name: &str, bytes: &[u8]| {
        let record = Record::new(Type::GeneralProperty, node, 0).text(name);
        record.u32(bytes.len() as u32).bytes(bytes).write(file, &[])
    };
    let mode: Vec<u8> =
        [stream.width, stream.height, stream.fps].iter().flat_map(|v| v.to_le_bytes()).collect();
    general("xnSupportedMapOutputModes", &mode)?;
    general("xnMapOutputMode", &mode)?;
    general("xnFOV", &stream.field_of_view.map(f64::to_le_bytes).concat())?;
    // Switched off, but without it the player delivers no frame at all.
    let (width, height) = (stream.width as u16, stream.height as u16);
    let cropping: Vec<u8> = [0, 0, 0, 0, width, height].iter().flat_map(|v| v.to_le_bytes()).collect();
    general("xnCropping", &cropping)
}

/// Time and place in the file of every frame of a stream.
type Places = Vec<(u64, u64)>;

fn write_frames(file: &mut (impl Write + Seek), streams: &[Stream]) -> io::Result<Vec<Places>> {
    let of_stream = |(s, stream): (usize, &Stream)| -> Vec<(u64, usize, usize)> {
        stream.frames.iter().enumerate().map(|(i, frame)| (frame.0, s, i)).collect()
    };
    let mut order: Vec<(u64, usize, usize)> = streams.iter().enumerate().flat_map(of_stream).collect();
    order.sort_unstable();
    let mut places: Vec<Places> = vec![Vec::new(); streams.len()];
    for (micros, s, i) in order {
        let place = file.stream_position()?;
        let previous = places[s].last().map_or(0, |&(_, place)| place);
        let record = Record::new(Type::NewData, s as u32 + 1, previous);
        record.u64(micros).u32(i as u32 + 1).write(file, &streams[s].frames[i].1)?;
        places[s].push((micros, place));
    }
    Ok(places)
}

/// Entry 0 is empty: frames count from 1.
fn seek_table(places: &Places) -> Vec<u8> {
    let mut table = vec![0; 20];
    for (micros, place) in places {
        table.extend(micros.to_le_bytes());
        table.extend(0u32.to_le_bytes());
        table.extend(place.to_le_bytes());
    }
    table
}
