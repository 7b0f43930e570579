//! Fifth stage: all views are refined together, and those that do not fit are left out.

use reconstruct::consistency::{agreement, misfit};
use reconstruct::refine::refine;
use reconstruct::report::LeftOut;
use reconstruct::view::DepthView;

use super::load::Work;
use crate::config::Config;

/// Refines, looks for the view that fits worst, leaves it out, and starts again until all fit.
pub fn refine_together(scan: &mut Work, config: &Config) {
    loop {
        let used: Vec<usize> = (0..scan.views.len())
            .filter(|&i| {
                scan.views[i].is_used() && scan.views[i].geometry.is_some() && scan.views[i].prior.is_some()
            })
            .collect();
        if used.is_empty() {
            return;
        }
        let geometry: Vec<&DepthView> =
            used.iter().filter_map(|&i| scan.views[i].geometry.as_ref()).collect();
        let priors: Vec<_> = used.iter().filter_map(|&i| scan.views[i].prior.clone()).collect();
        let refined = refine(&geometry, &priors, &config.refine);
        let fits = agreement(&geometry, &refined.world_from_camera, &config.consistency);
        let worst = misfit(&fits, &config.consistency);
        for (k, &i) in used.iter().enumerate() {
            scan.views[i].world_from_camera = Some(refined.world_from_camera[k]);
            scan.views[i].fit = Some(fits[k]);
        }
        let Some(worst) = worst else { return };
        let conflict = fits[worst].conflict.unwrap_or(0.0);
        scan.views[used[worst]].leave_out(LeftOut::DoesNotFit { conflict });
    }
}
