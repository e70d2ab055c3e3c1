//! At most 255 colours for pictures of thousands: median cut, deterministic.

use vmao_sim::Picture;

/// Bits of each component that colours are told apart by.
const BITS: u32 = 6;
const BINS: usize = 1 << (3 * BITS);

/// Colours, and which of them stands for each coarse colour.
#[derive(Debug)]
pub(super) struct Palette {
    pub(super) colors: Vec<[u8; 3]>,
    nearest: Vec<u8>,
}

fn bin([red, green, blue]: [u8; 3]) -> usize {
    let coarse = |value: u8| usize::from(value >> (8 - BITS));
    coarse(red) << (2 * BITS) | coarse(green) << BITS | coarse(blue)
}

/// Pixels of one coarse colour: sums of their components, and how many.
#[derive(Clone, Copy, Default)]
struct Bin {
    sums: [u64; 3],
    count: u64,
}

impl Bin {
    fn mean(&self) -> [f64; 3] {
        self.sums.map(|sum| sum as f64 / self.count.max(1) as f64)
    }
}

impl Palette {
    /// Colours for these pictures, at most `most` (1 to 255).
    pub(super) fn of<'p>(pictures: impl Iterator<Item = &'p Picture>, most: usize) -> Self {
        let mut bins = vec![Bin::default(); BINS];
        for pixel in pictures.flat_map(|picture| &picture.pixels) {
            let bin = &mut bins[bin(*pixel)];
            bin.count += 1;
            for (sum, value) in bin.sums.iter_mut().zip(pixel) {
                *sum += u64::from(*value);
            }
        }
        let used: Vec<Bin> = bins.into_iter().filter(|bin| bin.count > 0).collect();
        let mut boxes = vec![used];
        while boxes.len() < most {
            let Some((at, axis, _)) =
                boxes.iter().enumerate().filter_map(|(at, inside)| widest(at, inside)).max_by(|a, b| a.2.total_cmp(&b.2))
            else {
                break;
            };
            let mut inside = boxes.swap_remove(at);
            inside.sort_by(|a, b| a.mean()[axis].total_cmp(&b.mean()[axis]));
            let half = inside.iter().map(|bin| bin.count).sum::<u64>() / 2;
            let mut below = 0;
            let cut = inside.iter().position(|bin| {
                below += bin.count;
                below > half
            });
            let cut = cut.unwrap_or(0).clamp(1, inside.len() - 1);
            let upper = inside.split_off(cut);
            boxes.extend([inside, upper]);
        }
        let mean = |inside: &Vec<Bin>| {
            let sum = inside.iter().fold(Bin::default(), |sum, bin| Bin {
                sums: [0, 1, 2].map(|k| sum.sums[k] + bin.sums[k]),
                count: sum.count + bin.count,
            });
            sum.mean().map(|value| value.round() as u8)
        };
        let mut colors: Vec<[u8; 3]> = boxes.iter().map(mean).collect();
        colors.sort_unstable();
        colors.dedup();
        let nearest = (0..BINS).map(|bin| nearest(&colors, bin)).collect();
        Self { colors, nearest }
    }

    /// A picture's pixels as numbers of colours.
    pub(super) fn indices(&self, picture: &Picture) -> Vec<u8> {
        picture.pixels.iter().map(|pixel| self.nearest[bin(*pixel)]).collect()
    }
}

/// The axis along which a box that can be cut is to be cut, and how much there is to win.
fn widest(at: usize, inside: &[Bin]) -> Option<(usize, usize, f64)> {
    if inside.len() < 2 {
        return None;
    }
    let count: u64 = inside.iter().map(|bin| bin.count).sum();
    let spread = |axis: usize| {
        let values = || inside.iter().map(|bin| bin.mean()[axis]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let axis = (0..3).max_by(|a, b| spread(*a).total_cmp(&spread(*b)))?;
    // Large areas count, but not so much that small bright things lose their colour.
    Some((at, axis, spread(axis) * (count as f64).powf(0.4)))
}

fn nearest(colors: &[[u8; 3]], bin: usize) -> u8 {
    let middle = |shift: u32| (((bin >> shift) & ((1 << BITS) - 1)) << (8 - BITS) | 1 << (7 - BITS)) as i32;
    let wanted = [middle(2 * BITS), middle(BITS), middle(0)];
    let distance = |color: &[u8; 3]| color.iter().zip(wanted).map(|(a, b)| (i32::from(*a) - b).pow(2)).sum::<i32>();
    colors.iter().enumerate().min_by_key(|(_, color)| distance(color)).map_or(0, |(index, _)| index as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_are_kept_and_many_become_near_ones() {
        let colors = [[0, 0, 0], [255, 255, 255], [200, 30, 40]];
        let pixels = (0..600).map(|i| colors[if i < 590 { i % 2 } else { 2 }]).collect();
        let picture = Picture { width: 30, height: 20, pixels };
        let palette = Palette::of([&picture].into_iter(), 16);
        let back: Vec<[u8; 3]> = palette.indices(&picture).into_iter().map(|index| palette.colors[usize::from(index)]).collect();
        assert_eq!(back, picture.pixels);

        let smooth = (0..4096_usize).map(|i| [(i % 64 * 4) as u8, (i / 64 * 4) as u8, 128]).collect();
        let picture = Picture { width: 64, height: 64, pixels: smooth };
        let palette = Palette::of([&picture].into_iter(), 255);
        assert!(palette.colors.len() <= 255 && palette.colors.len() > 150, "{}", palette.colors.len());
        for (pixel, index) in picture.pixels.iter().zip(palette.indices(&picture)) {
            let found = palette.colors[usize::from(index)];
            assert!(pixel.iter().zip(found).all(|(a, b)| a.abs_diff(b) < 40), "{pixel:?} became {found:?}");
        }
    }

    #[test]
    fn nothing_has_no_colours_and_no_panic() {
        let empty = Picture { width: 0, height: 0, pixels: Vec::new() };
        assert!(Palette::of([&empty].into_iter(), 255).indices(&empty).is_empty());
    }
}
