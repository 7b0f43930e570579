//! Sparse blocks of 8 x 8 x 8 voxel corners with one value each, sorted by place.

/// Corners of a block along an axis.
pub const SIDE: usize = 8;
/// Corners of a block.
pub const CORNERS: usize = SIDE * SIDE * SIDE;
/// Bits of a block's place along an axis.
const BITS: u32 = 21;

/// A scalar field that is known near a surface; negative inside, NaN where it is not known.
#[derive(Debug, Clone, Default)]
pub struct Blocks {
    /// Place of corner (0, 0, 0) of the block at (0, 0, 0), metres.
    pub origin: [f32; 3],
    /// Distance between corners, metres.
    pub voxel_metres: f32,
    /// Places of the blocks, ascending; see [`key`].
    pub keys: Vec<u64>,
    /// Values of each block: x fastest, then y, then z.
    pub values: Vec<[f32; CORNERS]>,
}

/// A block's place as one number: z first, then y, then x.
pub fn key([x, y, z]: [u32; 3]) -> u64 {
    (u64::from(z) << (2 * BITS)) | (u64::from(y) << BITS) | u64::from(x)
}

/// The place behind a number.
pub fn place(key: u64) -> [u32; 3] {
    let mask = (1u64 << BITS) - 1;
    [key & mask, (key >> BITS) & mask, key >> (2 * BITS)].map(|v| v as u32)
}

/// Highest place along an axis.
pub const MAX_PLACE: u32 = (1 << BITS) - 2;

impl Blocks {
    /// Index of the block at a place.
    pub fn find(&self, key: u64) -> Option<usize> {
        self.keys.binary_search(&key).ok()
    }

    /// Coordinates of a block's first corner, metres.
    pub fn corner_of(&self, block: usize) -> [f32; 3] {
        let at = place(self.keys[block]);
        // In double precision: far blocks of a far origin would else lie a voxel off.
        let along = |k: usize| f64::from(at[k] * SIDE as u32) * f64::from(self.voxel_metres);
        std::array::from_fn(|k| (f64::from(self.origin[k]) + along(k)) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_come_back() {
        for at in [[0, 0, 0], [1, 2, 3], [MAX_PLACE, 0, 7], [5, MAX_PLACE, MAX_PLACE]] {
            assert_eq!(place(key(at)), at);
        }
        assert!(key([9, 0, 0]) < key([0, 1, 0]) && key([9, 9, 0]) < key([0, 0, 1]));
    }
}
