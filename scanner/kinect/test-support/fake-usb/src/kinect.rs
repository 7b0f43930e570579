//! The device behind the bus: its registers, what it says of itself, and the images it sends.

use std::collections::{HashMap, VecDeque};
use std::fs::OpenOptions;
use std::io::Write;
use std::time::Instant;

use kinect_testing::scene;

use crate::packets;
use crate::settings::SETTINGS;

/// Endpoint of the depth stream.
pub(crate) const DEPTH: u8 = 0x82;
/// Endpoint of the colour stream.
pub(crate) const VIDEO: u8 = 0x81;
/// Ticks between two images, 60 MHz.
const FRAME_TICKS: u32 = 2_000_000;
/// How far colour is behind depth: a millisecond and a half.
const SKEW_TICKS: u32 = 90_000;

/// The device's state.
#[derive(Default)]
pub(crate) struct Kinect {
    /// Which of several it is: what it sees depends on that.
    pub(crate) number: u32,
    registers: HashMap<u16, u16>,
    cmos: HashMap<u16, u16>,
    replies: VecDeque<Vec<u8>>,
    streams: HashMap<u8, Stream>,
    tilt: i16,
}

#[derive(Default)]
struct Stream {
    runs: bool,
    packets: VecDeque<Vec<u8>>,
    sent: u32,
    sequence: u8,
    due: Option<Instant>,
}

impl Kinect {
    /// A command to the camera: `GM`, its length, its kind, a tag, and words.
    pub(crate) fn command(&mut self, bytes: &[u8]) {
        let word = |at: usize| bytes.get(at..at + 2).map_or(0, |b| u16::from_le_bytes([b[0], b[1]]));
        let argument = |i: usize| word(8 + 2 * i);
        let body = match word(4) {
            3 => self.write_register(argument(0), argument(1)),
            2 => [0u16.to_le_bytes(), self.registers.get(&argument(0)).copied().unwrap_or(0).to_le_bytes()]
                .concat(),
            4 => fixed_parameters(),
            0x16 => algorithm_parameters(argument(0)),
            0x95 => self.color_chip(argument(1), argument(2)),
            _ => vec![0; 2],
        };
        let mut reply = b"RB".to_vec();
        reply.extend(((body.len() / 2) as u16).to_le_bytes());
        reply.extend(bytes.get(4..8).unwrap_or(&[0; 4]));
        reply.extend(body);
        self.replies.push_back(reply);
    }

    /// The answer to the oldest command.
    pub(crate) fn reply(&mut self) -> Vec<u8> {
        self.replies.pop_front().unwrap_or_default()
    }

    /// A command to the motor; what it answers.
    pub(crate) fn motor(&mut self, request: u8, value: u16) -> Vec<u8> {
        match request {
            // Level and at rest: 819 counts are 1 g.
            0x32 => vec![0, 0, 0, 0, 0x03, 0x33, 0, 0, (self.tilt * 2) as u8, 0],
            0x31 => {
                self.tilt = value as i16 / 2;
                note(&format!("tilt {}", self.tilt));
                vec![]
            }
            6 => {
                note(&format!("lamp {value}"));
                vec![]
            }
            _ => vec![],
        }
    }

    fn write_register(&mut self, register: u16, value: u16) -> Vec<u8> {
        note(&format!("register {register:#x} = {value:#x}"));
        self.registers.insert(register, value);
        let endpoint = match register {
            5 => VIDEO,
            6 => DEPTH,
            _ => return vec![0; 2],
        };
        let stream = self.streams.entry(endpoint).or_default();
        stream.runs = value != 0;
        stream.packets.clear();
        vec![0; 2]
    }

    /// A register of the colour camera's chip: the highest bit means writing.
    fn color_chip(&mut self, register: u16, value: u16) -> Vec<u8> {
        let number = register & 0x7fff;
        if register & 0x8000 != 0 {
            note(&format!("cmos {number:#x} = {value:#x}"));
            self.cmos.insert(number, value);
        }
        let held = *self.cmos.entry(number).or_insert(0x4002);
        [1u16.to_le_bytes(), number.to_le_bytes(), held.to_le_bytes()].concat()
    }

    /// Packets for a transfer of `most`; `None` where the stream has nothing to send now.
    pub(crate) fn take(&mut self, endpoint: u8, most: usize) -> Option<Vec<Vec<u8>>> {
        if self.streams.get(&endpoint).is_none_or(|stream| !stream.runs) {
            return None;
        }
        if self.streams[&endpoint].packets.is_empty() {
            self.next_image(endpoint)?;
        }
        let packets = &mut self.streams.get_mut(&endpoint)?.packets;
        Some(packets.drain(..most.min(packets.len())).collect())
    }

    fn next_image(&mut self, endpoint: u8) -> Option<()> {
        let count =
            |kinect: &Self, endpoint| kinect.streams.get(&endpoint).map_or((false, 0), |s| (s.runs, s.sent));
        let ((_, depths), (_, pictures)) = (count(self, DEPTH), count(self, VIDEO));
        let both = count(self, DEPTH).0 && count(self, VIDEO).0;
        // Where both run, they take turns: depth, colour, depth, colour.
        if both && ((endpoint == VIDEO && depths <= pictures) || (endpoint == DEPTH && pictures < depths)) {
            return None;
        }
        let index = count(self, endpoint).1;
        let waits = self.streams[&endpoint].due.is_some_and(|due| Instant::now() < due);
        if index >= SETTINGS.frames || waits {
            return None;
        }
        let ticks = SETTINGS.start_ticks.wrapping_add(index.wrapping_mul(FRAME_TICKS));
        let seen = index + 1000 * self.number;
        let register = |register| self.registers.get(&register).copied().unwrap_or(0);
        let (flag, size, pixels, ticks) = match endpoint {
            DEPTH if register(0x12) == 2 => {
                (0x70, 1748, packets::pack_10_bits(&scene::raw_depth(seen)), ticks)
            }
            DEPTH => (0x70, 1748, packets::pack_11_bits(&scene::raw_depth(seen)), ticks),
            _ => {
                let (width, height) = if register(0x0d) == 2 { (1280, 1024) } else { (640, 480) };
                (0x80, 1908, scene::bayer(seen, width, height), ticks.wrapping_add(SKEW_TICKS))
            }
        };
        let stream = self.streams.get_mut(&endpoint)?;
        stream.packets = packets::cut(flag, &pixels, size, ticks, &mut stream.sequence);
        if let Some((lossy, frame, lost)) = &SETTINGS.dropped
            && (*lossy, *frame) == (endpoint, index)
        {
            let mut number = 0;
            stream.packets.retain(|_| {
                number += 1;
                !lost.contains(&(number - 1))
            });
        }
        stream.sent = index + 1;
        stream.due = Some(Instant::now() + SETTINGS.pace);
        Some(())
    }
}

/// Projector, colour camera, reference plane: where the library looks for them.
fn fixed_parameters() -> Vec<u8> {
    let mut body = vec![0u8; 322];
    for (i, value) in [7.5f32, 2.3, 120.0, 0.1042].iter().enumerate() {
        body[94 + 4 * i..98 + 4 * i].copy_from_slice(&value.to_le_bytes());
    }
    body
}

fn algorithm_parameters(which: u16) -> Vec<u8> {
    match which {
        0x40 => {
            let mut body = vec![0u8; 2];
            for value in scene::REGISTRATION {
                body.extend(value.to_le_bytes());
            }
            body
        }
        0x41 => vec![0; 8],
        _ => [0u16.to_le_bytes(), 200u16.to_le_bytes()].concat(),
    }
}

/// Writes a change down, where the test wants to know.
pub(crate) fn note(line: &str) {
    if let Some(path) = &SETTINGS.journal
        && let Ok(mut file) = OpenOptions::new().create(true).append(true).open(path)
    {
        // The test fails on what is missing.
        let _ = writeln!(file, "{line}");
    }
}
