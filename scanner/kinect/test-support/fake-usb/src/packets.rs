//! Images as the device sends them: packets with a head of twelve bytes.

use std::collections::VecDeque;

/// Cuts an image into packets. `flag` is the stream's, `size` the pixels' bytes a packet holds.
pub(crate) fn cut(flag: u8, pixels: &[u8], size: usize, ticks: u32, sequence: &mut u8) -> VecDeque<Vec<u8>> {
    let last = pixels.len().div_ceil(size) - 1;
    let packet = |(index, part): (usize, &[u8])| {
        let place = if index == 0 {
            1
        } else if index == last {
            5
        } else {
            2
        };
        let mut packet = vec![b'R', b'B', 0, flag | place, 0, *sequence, 0, 0];
        packet.extend(ticks.to_le_bytes());
        packet.extend(part);
        *sequence = sequence.wrapping_add(1);
        packet
    };
    pixels.chunks(size).enumerate().map(packet).collect()
}

/// Values of 11 bits without gaps, the highest bit first.
pub(crate) fn pack_11_bits(values: &[u16]) -> Vec<u8> {
    pack(values, 11)
}

/// Values of 10 bits without gaps, the highest bit first.
pub(crate) fn pack_10_bits(values: &[u16]) -> Vec<u8> {
    pack(values, 10)
}

fn pack(values: &[u16], bits: u32) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(values.len() * bits as usize / 8);
    let (mut buffer, mut filled) = (0u32, 0);
    for &value in values {
        buffer = (buffer << bits) | u32::from(value) & ((1 << bits) - 1);
        filled += bits;
        while filled >= 8 {
            filled -= 8;
            bytes.push((buffer >> filled) as u8);
            buffer &= (1 << filled) - 1;
        }
    }
    bytes
}
