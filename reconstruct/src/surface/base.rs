//! The side a product stands on: its rims near the floor are led on inwards and closed flat, all of it invented.
//!
//! What stands on a plane touches it only here and there; the undersides of everyday things lie up to 4 mm above it. The
//! flat part lies at a height in the middle of that, where a guess is least wrong.

use earcut::Earcut;

use super::fill::add_between;
use crate::mesh::Mesh;

/// Height of the invented underside, metres.
const UNDERSIDE_METRES: f32 = 0.0015;
/// Rounds of smoothing of a rim's outline, and how far inside it the underside begins, metres; tried one after the other:
/// a ragged rim may cross itself seen from above, and a narrow foot has no room.
const OUTLINES: [(usize, f64); 6] =
    [(4, 0.006), (24, 0.006), (4, 0.0015), (24, 0.0015), (200, 0.0015), (200, 0.0)];

/// Closes all rims that face the floor; rims inside another (a ring's inside) stay open inside. Says which it could close:
/// outlines that cross themselves cannot be cut into triangles.
pub(super) fn close(mesh: &mut Mesh, rims: &[Vec<u32>]) -> Vec<bool> {
    let flat: Vec<Vec<[f64; 2]>> = rims.iter().map(|rim| seen_from_above(mesh, rim)).collect();
    let tries = OUTLINES.map(|(rounds, by)| -> Vec<Vec<[f64; 2]>> {
        flat.iter().map(|outline| inset(&smoothed(outline.clone(), rounds), by)).collect()
    });
    let flat = &flat;
    let mut closed = vec![false; rims.len()];
    for outer in 0..rims.len() {
        if is_inside_another(outer, flat) {
            continue;
        }
        let inner: Vec<usize> =
            (0..rims.len()).filter(|&i| i != outer && contains(&flat[outer], &flat[i][0])).collect();
        let members: Vec<usize> = std::iter::once(outer).chain(inner).collect();
        let found = tries.iter().find_map(|tried| {
            let still_turns = |&m: &usize| turns_as(&flat[m], &tried[m]);
            members.iter().all(still_turns).then_some(())?;
            Some((tried, cut(&members, tried)?))
        });
        if let Some((outlines, triangles)) = found {
            close_rims(mesh, &members, rims, outlines, &triangles);
            for &m in &members {
                closed[m] = true;
            }
        }
    }
    closed
}

fn seen_from_above(mesh: &Mesh, rim: &[u32]) -> Vec<[f64; 2]> {
    rim.iter()
        .map(|&v| mesh.vertices.points[v as usize])
        .map(|p| [f64::from(p[0]), f64::from(p[1])])
        .collect()
}

/// Every corner again and again to the middle of itself and its neighbours.
fn smoothed(mut outline: Vec<[f64; 2]>, rounds: usize) -> Vec<[f64; 2]> {
    let n = outline.len();
    for _ in 0..rounds {
        outline = (0..n)
            .map(|i| {
                let (a, b, c) = (outline[(i + n - 1) % n], outline[i], outline[(i + 1) % n]);
                [0, 1].map(|k| 0.25 * a[k] + 0.5 * b[k] + 0.25 * c[k])
            })
            .collect();
    }
    outline
}

/// Every corner moved to the side of the product's inside: the rim runs with it on the left seen from above.
fn inset(outline: &[[f64; 2]], by_metres: f64) -> Vec<[f64; 2]> {
    let n = outline.len();
    (0..n)
        .map(|i| {
            let (a, b) = (outline[(i + n - 2) % n], outline[(i + 2) % n]);
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let by = by_metres / dx.hypot(dy).max(1e-9);
            [outline[i][0] - dy * by, outline[i][1] + dx * by]
        })
        .collect()
}

/// Twice the area, positive counter-clockwise.
fn twice_area(outline: &[[f64; 2]]) -> f64 {
    outline.iter().zip(outline.iter().cycle().skip(1)).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
}

/// Whether an outline still turns the way it did, and has not lost nearly all its area.
fn turns_as(before: &[[f64; 2]], after: &[[f64; 2]]) -> bool {
    let (before, after) = (twice_area(before), twice_area(after));
    before * after > 0.0 && after.abs() > 0.1 * before.abs()
}

fn is_inside_another(rim: usize, flat: &[Vec<[f64; 2]>]) -> bool {
    (0..flat.len()).any(|other| other != rim && contains(&flat[other], &flat[rim][0]))
}

/// Whether a polygon contains a point (even-odd rule).
fn contains(polygon: &[[f64; 2]], p: &[f64; 2]) -> bool {
    let crosses = |a: &[f64; 2], b: &[f64; 2]| {
        (a[1] > p[1]) != (b[1] > p[1]) && p[0] < (b[0] - a[0]) * (p[1] - a[1]) / (b[1] - a[1]) + a[0]
    };
    let ends = polygon.iter().zip(polygon.iter().cycle().skip(1));
    ends.filter(|(a, b)| crosses(a, b)).count() % 2 == 1
}

/// Triangles of a polygon with its inner rims, as indices into all their points one after another. `None` unless they use
/// every edge of the rims just once.
fn cut(members: &[usize], flat: &[Vec<[f64; 2]>]) -> Option<Vec<[usize; 3]>> {
    let points: Vec<[f64; 2]> = members.iter().flat_map(|&m| flat[m].iter().copied()).collect();
    let mut starts: Vec<usize> = Vec::new();
    let mut count = 0;
    for &m in members {
        starts.push(count);
        count += flat[m].len();
    }
    let mut indices: Vec<usize> = Vec::new();
    Earcut::new().earcut(points.iter().copied(), &starts[1..], &mut indices);
    let mut triangles: Vec<[usize; 3]> = indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    // seen from below the outside is on the other side
    for t in &mut triangles {
        let [a, b, c] = t.map(|i| points[i]);
        if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0 {
            t.swap(1, 2);
        }
    }
    let mut directed: Vec<(usize, usize)> =
        triangles.iter().flat_map(|t| (0..3).map(|k| (t[k], t[(k + 1) % 3]))).collect();
    directed.sort_unstable();
    let unique = directed.windows(2).all(|w| w[0] != w[1]);
    let alone = directed.iter().filter(|&&(a, b)| directed.binary_search(&(b, a)).is_err()).count();
    let expected = count + 2 * (members.len() - 1) - 2;
    (unique && triangles.len() == expected && alone == count).then_some(triangles)
}

/// Walls from the rims to the underside's edge, and the underside.
fn close_rims(
    mesh: &mut Mesh,
    members: &[usize],
    rims: &[Vec<u32>],
    flat: &[Vec<[f64; 2]>],
    triangles: &[[usize; 3]],
) {
    let mut floor: Vec<u32> = Vec::new();
    for &m in members {
        let rim = &rims[m];
        let feet: Vec<u32> = rim
            .iter()
            .zip(&flat[m])
            .map(|(&v, at)| {
                add_between(mesh, v as usize, &[at[0] as f32, at[1] as f32, UNDERSIDE_METRES], 1.0)
            })
            .collect();
        for i in 0..rim.len() {
            let next = (i + 1) % rim.len();
            mesh.triangles.push([rim[next], rim[i], feet[i]]);
            mesh.triangles.push([rim[next], feet[i], feet[next]]);
        }
        floor.extend(feet);
    }
    mesh.triangles.extend(triangles.iter().map(|t| t.map(|i| floor[i])));
}
