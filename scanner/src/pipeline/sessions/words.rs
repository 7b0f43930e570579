//! Why recordings could not be joined, and what to do, in words a seller understands.

use reconstruct::register::flip::Apart;

use super::super::load::Work;

/// A side of the product this wide without a view is named, degrees.
const WIDE_GAP: f64 = 100.0;

/// Why `number` could not be joined to those before.
pub(super) fn refusal(apart: &Apart, number: usize, scan: &Work) -> String {
    let missing = missing_side(number, scan);
    match apart {
        Apart::Nothing => format!(
            "recording {number} and those before it could not be joined: there is hardly any surface to compare; {missing}"
        ),
        Apart::TooLittle(e) => format!(
            "recording {number} shares too little surface with those before it ({:.0} %, at least 30 % are needed): is it the same \
             product? If it is, {missing}",
            100.0 * e.overlap
        ),
        Apart::Contradiction(_) => format!(
            "recording {number} does not fit those before it, however it is turned: is it the same product, and did nothing on it \
             move, open or bend when it was turned over? If it is and nothing did, {missing}"
        ),
        Apart::Ambiguous(e) if e.texture < 0.5 => format!(
            "recording {number} fits those before it in more than one way: the product looks the same from several sides and has one \
             colour, so nobody can tell how it was turned; stick a small piece of coloured tape on its side and take all recordings again"
        ),
        Apart::Ambiguous(_) => format!(
            "recording {number} fits those before it in more than one way: {missing}, so that what is special about it is seen in both"
        ),
    }
}

/// Which view to take.
fn missing_side(number: usize, scan: &Work) -> String {
    match widest_gap(scan) {
        Some(gap) if gap > WIDE_GAP => format!(
            "recording {number} shows nothing of a side {gap:.0} degrees wide; add views from there (all round, 45 degrees apart) to it"
        ),
        _ => "take one more recording with the product lying on its other side, and name all of them"
            .to_owned(),
    }
}

/// The widest angle around the board without a view, degrees.
fn widest_gap(scan: &Work) -> Option<f64> {
    let mut around: Vec<f64> = scan
        .placed_views()
        .iter()
        .map(|v| v.world_from_camera.translation.vector)
        .map(|eye| eye.y.atan2(eye.x).to_degrees())
        .collect();
    around.sort_by(f64::total_cmp);
    let first = *around.first()?;
    let next = around.iter().skip(1).copied().chain([first + 360.0]);
    around.iter().zip(next).map(|(a, b)| b - a).max_by(f64::total_cmp)
}

/// Both recordings show it on the same foot.
pub(super) fn same_side(number: usize) -> String {
    format!(
        "in recording {number} the product stands as it does in the first, so its underside is still unseen: take one with the \
         product laid on its side"
    )
}

/// Most views of a recording contradict the others.
pub(super) fn do_not_fit(number: usize) -> String {
    format!(
        "recording {number} does not fit those before it: most of its views contradict theirs; is it the same product, and did \
         nothing on it move, open or bend when it was turned over?"
    )
}
