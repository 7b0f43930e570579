//! Dictionaries of square binary markers with the published codes and ids.

use std::sync::LazyLock;

use super::tables::{ARUCO_4X4_50, ARUCO_5X5_100, ARUCO_6X6_250, TAG_36H11};
use crate::board::Family;

/// Codes of one family, and how many wrong bits are forgiven when one is read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dictionary {
    /// Which family this is.
    pub family: Family,
    /// Payload cells a side; the tag has one more black cell on every side.
    pub payload_cells: usize,
    /// Wrong bits that are forgiven: far below half of the smallest distance between codes.
    pub max_bit_errors: u32,
    codes: Vec<u64>,
}

/// A code that was recognised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decoded {
    /// Id in the family.
    pub id: u32,
    /// The picture was read turned clockwise by this many quarter turns from upright.
    pub quarter_turns: usize,
    /// Bits that differed from the published code.
    pub bit_errors: u32,
}

static DICTIONARIES: LazyLock<[Dictionary; 5]> = LazyLock::new(|| {
    Family::ALL.map(|family| {
        let (payload_cells, max_bit_errors, codes) = match family {
            Family::Aruco4x4_50 => (4, 0, ARUCO_4X4_50.to_vec()),
            Family::Aruco5x5_100 => (5, 1, ARUCO_5X5_100.to_vec()),
            Family::Aruco6x6_250 => (6, 2, ARUCO_6X6_250.to_vec()),
            Family::ArucoOriginal => (5, 0, (0..1024).map(aruco_original_code).collect()),
            Family::Tag36h11 => (6, 3, TAG_36H11.to_vec()),
        };
        Dictionary { family, payload_cells, max_bit_errors, codes }
    })
});

impl Dictionary {
    /// The dictionary of a family.
    pub fn of(family: Family) -> &'static Self {
        let index = Family::ALL.iter().position(|&f| f == family);
        &DICTIONARIES[index.expect("every family is listed in ALL")]
    }

    /// Number of ids.
    pub fn len(&self) -> usize {
        self.codes.len()
    }

    /// Never true: every family has ids.
    pub fn is_empty(&self) -> bool {
        self.codes.is_empty()
    }

    /// Cells a side with the black border.
    pub fn cells(&self) -> usize {
        self.payload_cells + 2
    }

    /// Payload of an id: row-major bits, first bit highest, 1 = white; `None` where the family has no such id.
    pub fn bits(&self, id: u32) -> Option<u64> {
        self.codes.get(id as usize).copied()
    }

    /// Whether a cell of the upright tag is white, border included; `None` where there is no such id or cell.
    pub fn is_white(&self, id: u32, row: usize, column: usize) -> Option<bool> {
        let (bits, n) = (self.bits(id)?, self.cells());
        if row >= n || column >= n {
            return None;
        }
        let border = row == 0 || column == 0 || row == n - 1 || column == n - 1;
        let index =
            |r: usize, c: usize| self.payload_cells * self.payload_cells - 1 - (r * self.payload_cells + c);
        Some(!border && (bits >> index(row - 1, column - 1)) & 1 == 1)
    }

    /// The code nearest to what was read, in any of four orientations, if it is near enough and no other is as near
    /// (ARUCO_ORIGINAL has a tag that looks the same upside down).
    pub fn decode(&self, read: u64) -> Option<Decoded> {
        let mut turned = read;
        let mut best: Option<Decoded> = None;
        let mut ties = 0;
        for quarter_turns in 0..4 {
            for (id, &code) in self.codes.iter().enumerate() {
                let bit_errors = (code ^ turned).count_ones();
                if bit_errors > self.max_bit_errors {
                    continue;
                }
                match best {
                    Some(b) if bit_errors > b.bit_errors => {}
                    Some(b) if bit_errors == b.bit_errors => ties += 1,
                    _ => {
                        best = Some(Decoded { id: id as u32, quarter_turns, bit_errors });
                        ties = 0;
                    }
                }
            }
            turned = turn_back(turned, self.payload_cells);
        }
        best.filter(|_| ties == 0)
    }
}

/// The payload turned counter-clockwise by a quarter.
fn turn_back(bits: u64, n: usize) -> u64 {
    let at = |r: usize, c: usize| (bits >> (n * n - 1 - (r * n + c))) & 1;
    (0..n * n).fold(0, |out, i| (out << 1) | at(i % n, n - 1 - i / n))
}

/// The first ArUco dictionary (Munoz-Salinas): five rows, each one of four words that carries two bits of the id.
fn aruco_original_code(id: u64) -> u64 {
    const WORDS: [u64; 4] = [0b10000, 0b10111, 0b01001, 0b01110];
    (0..5).fold(0, |code, row| (code << 5) | WORDS[(id >> (8 - 2 * row)) as usize & 3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_codes() {
        let check =
            |family, id, bits| assert_eq!(Dictionary::of(family).bits(id), Some(bits), "{family:?} {id}");
        check(Family::Aruco4x4_50, 0, 0xb532);
        check(Family::Aruco5x5_100, 1, 0x001c_06e6);
        check(Family::Aruco6x6_250, 4, 0x000d_607d_6e15);
        check(Family::ArucoOriginal, 4, 0x0108_42f0);
        check(Family::Tag36h11, 0, 0x0002_1a14_6bab);
        assert_eq!(Family::ALL.map(|f| Dictionary::of(f).len()), [50, 100, 250, 1024, 587]);
        assert_eq!(Dictionary::of(Family::Aruco4x4_50).bits(50), None);
    }

    /// Smallest number of bits in which two tags of a family differ in any orientation.
    fn smallest_distance(dictionary: &Dictionary) -> u32 {
        let mut smallest = u32::MAX;
        for (i, &a) in dictionary.codes.iter().enumerate() {
            let mut turned = a;
            for quarter in 0..4 {
                for (j, &b) in dictionary.codes.iter().enumerate().skip(i) {
                    if i != j || quarter != 0 {
                        smallest = smallest.min((turned ^ b).count_ones());
                    }
                }
                turned = turn_back(turned, dictionary.payload_cells);
            }
        }
        smallest
    }

    #[test]
    fn distances_are_the_published_ones_and_corrections_stay_below_half() {
        let distances = Family::ALL.map(|f| smallest_distance(Dictionary::of(f)));
        assert_eq!(distances[4], 11, "36h11 is named after its distance");
        for (family, distance) in Family::ALL.into_iter().zip(distances) {
            let errors = Dictionary::of(family).max_bit_errors;
            assert!(errors == 0 || 2 * errors < distance, "{family:?} {distance}");
        }
    }

    #[test]
    fn every_id_is_read_back_in_every_orientation() {
        let mut ambiguous = Vec::new();
        for family in Family::ALL {
            let dictionary = Dictionary::of(family);
            for id in 0..dictionary.len() as u32 {
                let mut turned = dictionary.bits(id).unwrap();
                for back in 0..4 {
                    match dictionary.decode(turned) {
                        Some(read) => assert_eq!((read.id, read.quarter_turns), (id, (4 - back) % 4)),
                        None => ambiguous.push((family, id)),
                    }
                    turned = turn_back(turned, dictionary.payload_cells);
                }
            }
        }
        ambiguous.dedup();
        assert_eq!(ambiguous, [(Family::ArucoOriginal, 1023)], "it looks the same upside down");
    }
}
