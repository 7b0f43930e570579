//! Images as plain row-major pixels; geometry is in [`crate::camera::Intrinsics`].

/// 8-bit sRGB picture, row-major.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ColorImage {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` pixels, sRGB.
    pub data: Vec<[u8; 3]>,
}

/// 8-bit grey picture, row-major.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct GrayImage {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` luma values.
    pub data: Vec<u8>,
}

/// Raw depth as sensed, row-major; 0 = no value.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DepthImage {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` values in device units.
    pub data: Vec<u16>,
    /// Device units in a metre: 1000 for millimetres.
    pub units_per_metre: f64,
}

impl ColorImage {
    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, color: [u8; 3]) -> Self {
        Self { width, height, data: vec![color; width * height] }
    }

    /// Luma (Rec. 601, integer arithmetic).
    pub fn to_gray(&self) -> GrayImage {
        let luma = |&[r, g, b]: &[u8; 3]| {
            ((77 * u32::from(r) + 150 * u32::from(g) + 29 * u32::from(b) + 128) >> 8) as u8
        };
        GrayImage { width: self.width, height: self.height, data: self.data.iter().map(luma).collect() }
    }

    /// The picture flipped left-right.
    pub fn mirrored(mut self) -> Self {
        self.data.chunks_exact_mut(self.width.max(1)).for_each(<[[u8; 3]]>::reverse);
        self
    }
}

impl DepthImage {
    /// Depth in metres at a pixel; `None` where nothing was measured.
    pub fn metres(&self, u: usize, v: usize) -> Option<f32> {
        match self.data[v * self.width + u] {
            0 => None,
            raw => Some((f64::from(raw) / self.units_per_metre) as f32),
        }
    }

    /// The picture flipped left-right.
    pub fn mirrored(mut self) -> Self {
        self.data.chunks_exact_mut(self.width.max(1)).for_each(<[u16]>::reverse);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirroring_twice_changes_nothing() {
        let image = ColorImage { width: 3, height: 1, data: vec![[1, 0, 0], [2, 0, 0], [3, 0, 0]] };
        assert_eq!(image.clone().mirrored().data[0], [3, 0, 0]);
        assert_eq!(image.clone().mirrored().mirrored(), image);
    }

    #[test]
    fn white_is_white_and_zero_depth_is_nothing() {
        assert_eq!(ColorImage::filled(1, 1, [255; 3]).to_gray().data, [255]);
        let depth = DepthImage { width: 2, height: 1, data: vec![0, 1500], units_per_metre: 1000.0 };
        assert_eq!((depth.metres(0, 0), depth.metres(1, 0)), (None, Some(1.5)));
    }
}
