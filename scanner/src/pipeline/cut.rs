//! Fourth stage: every view becomes geometry, and the background is cut away.

use rayon::prelude::*;
use reconstruct::report::LeftOut;
use reconstruct::segment;
use reconstruct::view::DepthView;

use super::load::{View, Work};
use crate::config::Config;

/// A view that sees fewer pixels of the product is of no use.
const MIN_PRODUCT_PIXELS: usize = 400;

/// Makes points of the corrected depth and keeps the product's.
pub fn cut_background(scan: &mut Work, config: &Config) {
    let (camera, rays, region) = (scan.rig.color, &scan.rays, scan.region.as_ref());
    scan.views.par_iter_mut().filter(|v| v.is_used()).for_each(|view| {
        let depth: Vec<f32> =
            (0..view.disparity.disparity_px.len()).map(|i| view.disparity.metres(i)).collect();
        let mut geometry = DepthView::new(camera, rays, &depth);
        if let (Some(region), Some(world_from_camera)) = (region, view.world_from_camera) {
            let cut = segment::cut(&geometry, &world_from_camera, region, &config.segment);
            if cut.product_pixels < MIN_PRODUCT_PIXELS {
                let outside =
                    cut.outside_pixels > cut.product_pixels && cut.outside_pixels > MIN_PRODUCT_PIXELS;
                view.leave_out(if outside { LeftOut::OutsideRegion } else { LeftOut::NoProduct });
            }
            geometry.set_product(cut.mask);
        }
        view.geometry = Some(geometry);
    });
    if scan.failure.is_none() && !scan.views.iter().any(View::is_used) {
        let reason = scan.views.iter().filter_map(|v| v.left_out.as_ref());
        let reason = reason.into_iter().find(|r| matches!(r, LeftOut::OutsideRegion | LeftOut::NoProduct));
        scan.failure = reason.map(ToString::to_string);
    }
}
