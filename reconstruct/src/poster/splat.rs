//! Points as discs: a first pass finds the front, a second blends the discs that lie there.

use super::Dot;
use super::camera::Camera;
use super::canvas::{Band, Canvas};

/// Least cosine between disc and view: discs on edge would tear or reach far in depth.
const LEAST_SLANT: f32 = 0.3;
/// Least radius in pixels, so that no disc falls between pixels.
const LEAST_PIXELS: f32 = 0.8;

/// One disc on the canvas.
struct Disc<'a> {
    dot: &'a Dot,
    x: f32,
    y: f32,
    /// Metres.
    radius: f32,
    /// Metres a pixel at this depth.
    pixel: f32,
}

impl Disc<'_> {
    /// Calls `paint` with each covered pixel, the depth there, and the squared distance from the centre in radii.
    fn cover(&self, band: &mut Band<'_>, mut paint: impl FnMut(&mut Band<'_>, usize, f32, f32)) {
        let (columns, rows) = band.around(self.x, self.y, self.radius / self.pixel);
        let [nx, ny, nz] = self.dot.normal;
        // The plane's slope in depth, limited.
        let (slope_x, slope_y) = if nz == 0.0 && nx == 0.0 && ny == 0.0 {
            (0.0, 0.0)
        } else {
            let nz = nz.abs().max(LEAST_SLANT) * if nz > 0.0 { 1.0 } else { -1.0 };
            (-nx / nz, -ny / nz)
        };
        for y in rows {
            let oy = (y as f32 - self.y) * self.pixel;
            for x in columns.clone() {
                let ox = (x as f32 - self.x) * self.pixel;
                let oz = slope_x * ox + slope_y * oy;
                let distance = (ox * ox + oy * oy + oz * oz) / (self.radius * self.radius);
                if distance <= 1.0 {
                    paint(band, band.at(x, y), self.dot.place[2] + oz, distance);
                }
            }
        }
    }
}

/// Draws all points; `radii` are their discs' radii in metres.
pub(super) fn draw(dots: &[Dot], radii: &[f32], camera: &Camera, canvas: &mut Canvas) {
    let disc = |i: usize| {
        let dot = &dots[i];
        let [x, y] = camera.project(dot.place)?;
        let pixel = dot.place[2] / camera.focal;
        Some(Disc { dot, x, y, radius: radii[i].max(LEAST_PIXELS * pixel), pixel })
    };
    let rows = |i: usize| disc(i).map(|d| (d.y - d.radius / d.pixel, d.y + d.radius / d.pixel));
    let lists = canvas.sort_into_bands(dots.len(), rows);
    canvas.draw_bands(&lists, |band, list| {
        let discs = || list.iter().filter_map(|&i| disc(i as usize));
        for disc in discs() {
            disc.cover(band, |band, at, depth, _| band.depth[at] = band.depth[at].min(depth));
        }
        for disc in discs() {
            let behind = 1.5 * disc.radius;
            disc.cover(band, |band, at, depth, distance| {
                if depth <= band.depth[at] + behind {
                    let weight = (1.0 - distance).powi(2) + 1e-4;
                    let light = &mut band.light[at];
                    for (sum, value) in light.iter_mut().zip(disc.dot.light) {
                        *sum += value * weight;
                    }
                    light[3] += weight;
                }
            });
        }
    });
}
