//! Point clouds as pictures, plain or under a contact map: finger 1 green, finger 2 blue, as in the report.

use super::eye::{Eye, fit};
use super::studio::FINGERS;
use nalgebra::{Point3, Vector3};
use vmao_core::observation::{Observation, PointLabel};
use vmao_sim::Picture;

const RAYS: usize = 3;
const FIELD: f64 = 0.5;
/// Radius of a point (m); of a mark, in points.
const RADIUS: f64 = 0.0036;
const MARK: f64 = 1.7;
/// The curve that lifts a map's faint tail.
const GAMMA: f64 = 0.75;
const PAPER: Vector3<f64> = Vector3::new(0.985, 0.983, 0.976);
/// What colours are drawn towards where a map is to be read over them, and how much of them is left.
const PALE: f64 = 0.86;
const LEFT: f64 = 0.25;

/// A cloud as it is drawn.
pub(crate) struct Cloud<'c> {
    pub(crate) seen: &'c Observation,
    pub(crate) eye: Eye,
    pub(crate) size: [usize; 2],
}

struct Dot {
    depth: f64,
    row: f64,
    column: f64,
    radius: f64,
    color: Vector3<f64>,
}

/// An eye that sees the object of all these clouds.
pub(crate) fn eye_of(clouds: &[&Observation], directions: [f64; 2], aspect: f64) -> Eye {
    let of_object = |seen: &&Observation| {
        let labelled = seen.points.iter().zip(&seen.labels).filter(|(_, label)| matches!(label, PointLabel::Part(_)));
        labelled.map(|(point, _)| (Point3::from(point.map(f64::from)), 0.012)).collect::<Vec<_>>()
    };
    let mut balls: Vec<(Point3<f64>, f64)> = clouds.iter().flat_map(of_object).collect();
    if balls.is_empty() {
        balls.push((Point3::origin(), 0.3));
    }
    fit(&balls, directions, FIELD, aspect)
}

impl Cloud<'_> {
    /// The cloud in its own colours, or pale with the two channels of a map over it and balls at their peaks.
    pub(crate) fn picture(&self, map: Option<[&[f32]; 2]>) -> Picture {
        let [width, height] = self.size.map(|pixels| pixels * RAYS);
        let camera = self.eye.pinhole(width, height);
        let scale = height as f64 / (2.0 * camera.half_tangent);
        let peaks = map.map(|fingers| fingers.map(peak));
        let mut dots = Vec::with_capacity(self.seen.len());
        for (index, point) in self.seen.points.iter().enumerate() {
            let seen = camera.world_from_camera.inverse_transform_point(&Point3::from(point.map(f64::from)));
            if seen.z <= 0.05 {
                continue;
            }
            // Columns of the camera run from right to left, those of a picture from left to right.
            let dot = |color, size: f64, nearer: f64| Dot {
                depth: seen.z - nearer,
                row: height as f64 / 2.0 - seen.y / seen.z * scale,
                column: width as f64 / 2.0 - seen.x / seen.z * scale,
                radius: size * RADIUS / seen.z * scale,
                color,
            };
            let scenery = if matches!(self.seen.labels[index], PointLabel::Part(_)) { 1.0 } else { 0.55 };
            let own = Vector3::from(self.seen.colors[index]).map(f64::from);
            let shares = map.zip(peaks).map(|(fingers, peaks)| [0, 1].map(|finger| share(fingers[finger], index, peaks[finger])));
            dots.push(dot(shares.map_or(own, |shares| tinted(&own, shares)), scenery, 0.0));
            for finger in 0..2 {
                if peaks.is_some_and(|peaks| peaks[finger] == index) {
                    // White about the mark, so that it stands out from its own colour.
                    dots.push(dot(Vector3::repeat(1.0), 1.5 * MARK, 0.01));
                    dots.push(dot(Vector3::from(FINGERS[finger]).map(f64::from), MARK, 0.012));
                }
            }
        }
        dots.sort_by(|a, b| b.depth.total_cmp(&a.depth));
        let mut colors = vec![PAPER; width * height];
        dots.iter().for_each(|dot| draw(&mut colors, [width, height], dot));
        super::studio::average(&colors, self.size, RAYS)
    }
}

fn peak(channel: &[f32]) -> usize {
    (0..channel.len()).max_by(|&a, &b| channel[a].total_cmp(&channel[b]).then(b.cmp(&a))).unwrap_or(0)
}

/// A probability relative to the channel's largest.
fn share(channel: &[f32], index: usize, peak: usize) -> f64 {
    let most = f64::from(channel[peak]);
    if most > 0.0 { f64::from(channel[index]) / most } else { 0.0 }
}

fn tinted(own: &Vector3<f64>, [first, second]: [f64; 2]) -> Vector3<f64> {
    let pale = own * LEFT + Vector3::repeat(PALE) * (1.0 - LEFT);
    let [green, blue] = FINGERS.map(|color| Vector3::from(color).map(f64::from));
    let hue = (green * first + blue * second) / (first + second).max(1e-6);
    pale.lerp(&hue, first.max(second).clamp(0.0, 1.0).powf(GAMMA))
}

fn draw(colors: &mut [Vector3<f64>], [width, height]: [usize; 2], dot: &Dot) {
    let range = |middle: f64, count: usize| {
        let bound = |x: f64| x.clamp(0.0, count as f64) as usize;
        bound(middle - dot.radius)..bound(middle + dot.radius + 1.0)
    };
    for row in range(dot.row, height) {
        for column in range(dot.column, width) {
            let (x, y) = ((column as f64 + 0.5 - dot.column) / dot.radius, (row as f64 + 0.5 - dot.row) / dot.radius);
            let square = x * x + y * y;
            if square <= 1.0 {
                let light = 0.80 + 0.20 * (1.0 - square).sqrt() - 0.07 * (0.7 * y + 0.5 * x);
                colors[row * width + column] = dot.color * light.min(1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_are_marked_in_their_fingers_colours_where_they_are() {
        let mut seen = Observation::default();
        for k in 0..40_u8 {
            seen.points.push([0.01 * f32::from(k), 0.0, 0.0]);
            seen.colors.push([0.7, 0.7, 0.7]);
            seen.labels.push(PointLabel::Part(0));
        }
        let at = |peak: usize| (0..40).map(|k| if k == peak { 0.9 } else { 0.1 / 39.0 }).collect::<Vec<f32>>();
        let (first, second) = (at(5), at(35));
        // From −y, x runs to the right.
        let eye = eye_of(&[&seen], [-std::f64::consts::FRAC_PI_2, 0.2], 2.0);
        let picture = Cloud { seen: &seen, eye, size: [200, 100] }.picture(Some([&first, &second]));
        let middle = |wanted: fn(&[u8; 3]) -> bool| {
            let found: Vec<usize> = (0..picture.pixels.len()).filter(|&at| wanted(&picture.pixels[at])).collect();
            assert!(!found.is_empty());
            found.iter().map(|at| at % picture.width).sum::<usize>() / found.len()
        };
        let green = middle(|[r, g, b]| g > &r.saturating_add(60) && g > &b.saturating_add(40));
        let blue = middle(|[r, _, b]| b > &(r.saturating_add(100)));
        assert!((20..45).contains(&green) && (155..180).contains(&blue), "{green} {blue}");
        let plain = Cloud { seen: &seen, eye, size: [200, 100] }.picture(None);
        assert_ne!(plain, picture);
    }
}
