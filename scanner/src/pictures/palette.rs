//! Fewer colours by median cut (Heckbert 1982) over the picture's exact colours.

/// One colour and how many pixels have it.
#[derive(Clone, Copy)]
struct Shade {
    color: [u8; 3],
    count: u64,
    /// Place in the sorted list of all colours.
    number: usize,
}

/// Colours that become one, and how urgent it is to cut them in two.
struct Group {
    shades: Vec<Shade>,
    channel: usize,
    urgency: f64,
}

/// At most `colors` colours (up to 256) and for every pixel the number of its own.
pub(super) fn reduce(pixels: &[[u8; 3]], colors: usize) -> (Vec<[u8; 3]>, Vec<u8>) {
    let shades = shades(pixels);
    let sorted: Vec<[u8; 3]> = shades.iter().map(|shade| shade.color).collect();
    let mut entry = vec![0u8; shades.len()];
    let mut palette = Vec::new();
    for group in cut(shades, colors.clamp(1, 256)) {
        for shade in &group.shades {
            entry[shade.number] = palette.len() as u8;
        }
        palette.push(mean(&group.shades));
    }
    let number = |pixel: &[u8; 3]| sorted.binary_search(pixel).map_or(0, |i| entry[i]);
    (palette, pixels.iter().map(number).collect())
}

fn shades(pixels: &[[u8; 3]]) -> Vec<Shade> {
    let mut sorted = pixels.to_vec();
    sorted.sort_unstable();
    let runs = sorted.chunk_by(|a, b| a == b).enumerate();
    runs.map(|(number, run)| Shade { color: run[0], count: run.len() as u64, number }).collect()
}

fn mean(shades: &[Shade]) -> [u8; 3] {
    let count: u64 = shades.iter().map(|shade| shade.count).sum();
    std::array::from_fn(|k| {
        let sum: u64 = shades.iter().map(|shade| shade.count * u64::from(shade.color[k])).sum();
        ((sum + count / 2) / count.max(1)) as u8
    })
}

impl Group {
    fn new(shades: Vec<Shade>) -> Self {
        let count: u64 = shades.iter().map(|shade| shade.count).sum();
        let spread = |k: usize| {
            let values = || shades.iter().map(|shade| shade.color[k]);
            values().max().unwrap_or(0) - values().min().unwrap_or(0)
        };
        let (channel, spread) =
            (0..3).map(|k| (k, spread(k))).max_by_key(|(_, spread)| *spread).unwrap_or((0, 0));
        // Wide steps in large even areas, as in a shadow, are seen first.
        let urgency = if shades.len() < 2 { 0.0 } else { f64::from(spread).powi(2) * count as f64 };
        Self { shades, channel, urgency }
    }
}

/// Cuts the most urgent group at its median until there are enough.
fn cut(shades: Vec<Shade>, colors: usize) -> Vec<Group> {
    let mut groups = vec![Group::new(shades)];
    while groups.len() < colors {
        let most =
            groups.iter().enumerate().max_by(|a, b| a.1.urgency.total_cmp(&b.1.urgency)).map(|(i, _)| i);
        let Some(i) = most.filter(|&i| groups[i].urgency > 0.0) else { break };
        let Group { mut shades, channel, .. } = groups.swap_remove(i);
        shades.sort_unstable_by_key(|shade| (shade.color[channel], shade.number));
        let half = shades.iter().map(|shade| shade.count).sum::<u64>() / 2;
        let mut passed = 0;
        let middle = shades.iter().position(|shade| {
            passed += shade.count;
            passed > half
        });
        let upper = shades.split_off(middle.unwrap_or(1).clamp(1, shades.len() - 1));
        groups.extend([Group::new(shades), Group::new(upper)]);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_stay_as_they_are() {
        let pixels = [[10, 20, 30], [200, 100, 50], [10, 20, 30], [0, 0, 0]];
        let (palette, numbers) = reduce(&pixels, 256);
        let back: Vec<[u8; 3]> = numbers.iter().map(|&n| palette[usize::from(n)]).collect();
        assert_eq!(back, pixels);
    }

    #[test]
    fn the_number_of_colours_holds() {
        let pixels: Vec<[u8; 3]> =
            (0..5000u32).map(|i| [(i * 7) as u8, (i * 13) as u8, (i / 20) as u8]).collect();
        assert!(reduce(&pixels, 16).0.len() <= 16);
        assert_eq!(reduce(&pixels, 1).0.len(), 1);
        assert_eq!(reduce(&[], 4).1, [0u8; 0]);
    }
}
