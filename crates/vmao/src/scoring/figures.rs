//! Pictures of a learned distribution, as SVG: contacts on the cloud, coverage against K, reliability.

use super::calibration::{Rank, STEPS, reliability};
use super::grips::{compare, grip_distance};
use super::measure::Scored;
use super::samplers::Sampler;
use super::summary::Row;
use nalgebra::{Point3, Vector3};
use vmao_core::contact_model::FingerPoints;
use vmao_core::observation::PointLabel;

/// Modes, and curves.
const COLORS: [&str; 7] = ["#1f5fa8", "#d9730d", "#2e7d32", "#7b3fa0", "#00838f", "#6d4c41", "#c2185b"];
const GOOD: &str = "#2e7d32";
const BAD: &str = "#c62828";
const WIDTH: f64 = 300.0;
const TOP: f64 = 40.0;

/// Where pictures are taken from: in front, above and a little to the right of the part's frame.
const TOWARDS_EYE: [f64; 3] = [0.30, -0.75, 0.60];

fn page(width: f64, height: f64, body: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{body}</svg>\n"
    )
}

fn text(body: &mut String, [x, y]: [f64; 2], words: &str) {
    let safe = words.replace('&', "&amp;").replace('<', "&lt;");
    *body += &format!("<text x=\"{x:.1}\" y=\"{y:.1}\">{safe}</text>\n");
}

/// Dots of one colour as a single path of strokes without length.
fn dots(body: &mut String, points: impl Iterator<Item = [f64; 2]>, size: f64, color: &str) {
    let path: String = points.map(|[x, y]| format!("M{x:.1} {y:.1}h0")).collect();
    if !path.is_empty() {
        *body += &format!("<path d=\"{path}\" stroke=\"{color}\" stroke-width=\"{size}\" stroke-linecap=\"round\"/>\n");
    }
}

fn curve(body: &mut String, points: &[[f64; 2]], color: &str, style: &str) {
    let path: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    *body += &format!("<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" {style}/>\n", path.join(" "));
}

/// From the part's frame to one panel of the page.
struct View {
    right: Vector3<f64>,
    up: Vector3<f64>,
    low: [f64; 2],
    scale: f64,
    height: f64,
}

impl View {
    fn of<'a>(points: impl Iterator<Item = &'a Point3<f64>>) -> Self {
        let eye = Vector3::from(TOWARDS_EYE).normalize();
        let right = Vector3::z().cross(&eye).normalize();
        let up = eye.cross(&right);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            for (axis, direction) in [&right, &up].into_iter().enumerate() {
                low[axis] = low[axis].min(point.coords.dot(direction));
                high[axis] = high[axis].max(point.coords.dot(direction));
            }
        }
        let scale = (WIDTH - 30.0) / (high[0] - low[0]).max(high[1] - low[1]).max(1e-3);
        Self { right, up, low, scale, height: (high[1] - low[1]) * scale + 30.0 }
    }

    /// Whether a point is within the picture, a margin included.
    fn holds(&self, point: &Point3<f64>) -> bool {
        let [x, y] = self.place(point, 0.0);
        (5.0..=WIDTH - 5.0).contains(&x) && (TOP + 5.0..=TOP + self.height).contains(&y)
    }

    fn place(&self, point: &Point3<f64>, left: f64) -> [f64; 2] {
        let along = |axis: &Vector3<f64>, low: f64| (point.coords.dot(axis) - low) * self.scale + 15.0;
        [left + along(&self.right, self.low[0]), TOP + self.height - along(&self.up, self.low[1])]
    }
}

/// One scene before one grasp: the explored successes by mode, and the first `count` samples of each sampler.
///
/// A sample is green if it is within `distance` (m) of an explored success, red otherwise.
pub fn scene_figure(scene: &Scored, title: &str, count: usize, distance: f64) -> String {
    let on_object = || {
        scene.cloud.iter().zip(&scene.labels).filter_map(|(point, label)| match label {
            PointLabel::Part(part) => Some((point, usize::from(*part) == scene.score.part)),
            PointLabel::Arm(_) | PointLabel::Table => None,
        })
    };
    let shown = [Sampler::VmaoPeak, Sampler::VmaoDraw, Sampler::Top1Peaks, Sampler::Top1Draw];
    let shown: Vec<Sampler> = shown.into_iter().filter(|sampler| scene.samples.contains_key(sampler)).collect();
    let samples = |sampler: &Sampler| &scene.samples[sampler][..count.min(scene.samples[sampler].len())];
    let grips = || scene.references.iter().chain(shown.iter().flat_map(samples)).flatten();
    let view = View::of(on_object().filter(|(_, own)| *own).map(|(point, _)| point).chain(grips()));
    let mut body = String::new();
    text(&mut body, [15.0, 18.0], title);
    let panel = |body: &mut String, column: usize, heading: &str, grips: &[(FingerPoints, &str)]| {
        let left = column as f64 * WIDTH;
        text(body, [left + 15.0, 36.0], heading);
        for (own, size, color) in [(false, 2.5, "#dddddd"), (true, 3.0, "#b4b4b4")] {
            let points = on_object().filter(|(point, of_part)| *of_part == own && view.holds(point));
            dots(body, points.map(|(point, _)| view.place(point, left)), size, color);
        }
        for (fingers, color) in grips {
            let ends = fingers.map(|finger| view.place(&finger, left));
            curve(body, &ends, color, "stroke-width=\"1.2\" stroke-opacity=\"0.55\"");
            dots(body, ends.into_iter(), 4.5, color);
        }
    };
    let modes = scene.score.modes;
    let explored: Vec<(FingerPoints, &str)> =
        scene.references.iter().zip(&scene.modes).map(|(grip, mode)| (*grip, COLORS[mode % COLORS.len()])).collect();
    panel(&mut body, 0, &format!("{} explored successes, {modes} modes", explored.len()), &explored);
    for (column, sampler) in shown.iter().enumerate() {
        let judged = |grip: &FingerPoints| {
            let near = scene.references.iter().any(|success| grip_distance(success, grip) <= distance);
            (*grip, if near { GOOD } else { BAD })
        };
        let samples = samples(sampler);
        let grips: Vec<(FingerPoints, &str)> = samples.iter().map(judged).collect();
        let reached = compare(samples, &scene.references, &scene.modes, distance).coverage * modes as f64;
        panel(&mut body, column + 1, &format!("{}: {}, {reached:.0} modes", sampler.title(), grips.len()), &grips);
    }
    page(WIDTH * (shown.len() + 1) as f64, TOP + view.height + 10.0, &body)
}

/// A square of the page with axes from 0 to 1.
struct Axes {
    left: f64,
}

impl Axes {
    const SIZE: f64 = 260.0;

    fn at(&self, x: f64, y: f64) -> [f64; 2] {
        [self.left + 40.0 + x * Self::SIZE, TOP + 10.0 + (1.0 - y) * Self::SIZE]
    }

    fn frame(&self, body: &mut String, heading: &str, horizontal: &str) {
        text(body, [self.left + 40.0, 30.0], heading);
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]].map(|[x, y]| self.at(x, y));
        curve(body, &corners, "#999999", "stroke-width=\"1\"");
        for mark in [0.0, 0.5, 1.0] {
            let [x, y] = self.at(0.0, mark);
            text(body, [x - 28.0, y + 4.0], &format!("{mark:.1}"));
        }
        let [x, y] = self.at(0.0, 0.0);
        text(body, [x, y + 32.0], horizontal);
    }
}

/// Mode coverage against K, one panel for each grasp of `sizes`, with intervals.
pub fn coverage_figure(rows: &[Row], sizes: &str, samples: &[usize]) -> String {
    let grasps = rows.iter().map(|row| row.grasp).max().unwrap_or(0);
    let mut body = String::new();
    let across = |k: usize| k as f64 / (samples.len().max(2) - 1) as f64;
    for grasp in 1..=grasps {
        let axes = Axes { left: (grasp - 1) as f64 * 340.0 };
        axes.frame(&mut body, &format!("grasp {grasp}: share of modes reached"), "K samples");
        for (k, count) in samples.iter().enumerate() {
            let [x, y] = axes.at(across(k), 0.0);
            text(&mut body, [x - 5.0, y + 15.0], &count.to_string());
        }
        for (sampler, color) in Sampler::ALL.into_iter().zip(COLORS) {
            let of = |row: &&Row| {
                row.sizes == sizes && row.grasp == grasp && row.measure == "mode coverage" && row.method == sampler.title()
            };
            let found: Vec<&Row> = rows.iter().filter(of).collect();
            let line: Vec<[f64; 2]> = found.iter().enumerate().map(|(k, row)| axes.at(across(k), row.estimate.value)).collect();
            curve(&mut body, &line, color, "stroke-width=\"2\"");
            for (k, row) in found.iter().enumerate() {
                let ends = row.estimate.interval95.map(|bound| axes.at(across(k), bound));
                curve(&mut body, &ends, color, "stroke-width=\"1\"");
            }
        }
    }
    legend(&mut body, &Sampler::ALL.map(Sampler::title), grasps)
}

fn legend(body: &mut String, names: &[&str], panels: usize) -> String {
    let left = panels as f64 * 340.0 + 10.0;
    for (row, (name, color)) in names.iter().zip(COLORS).enumerate() {
        let y = TOP + 20.0 + 20.0 * row as f64;
        curve(body, &[[left, y - 4.0], [left + 24.0, y - 4.0]], color, "stroke-width=\"3\"");
        text(body, [left + 32.0, y], name);
    }
    page(left + 200.0, TOP + Axes::SIZE + 50.0, body)
}

/// Observed against predicted mass, one panel for each grasp; `ranks` gives those of a model by name and of a part.
pub fn reliability_figure(models: &[(&str, &str)], parts: usize, ranks: &dyn Fn(&str, usize) -> Vec<Rank>) -> String {
    let mut body = String::new();
    for part in 0..parts {
        let axes = Axes { left: part as f64 * 340.0 };
        let heading = format!("grasp {}: contacts within", part + 1);
        axes.frame(&mut body, &heading, "mass of the most probable region");
        curve(&mut body, &[axes.at(0.0, 0.0), axes.at(1.0, 1.0)], "#999999", "stroke-dasharray=\"4 4\"");
        for ((name, _), color) in models.iter().zip(COLORS) {
            let own = ranks(name, part);
            if own.is_empty() {
                continue;
            }
            let shares = reliability(&own);
            let mut line = vec![axes.at(0.0, 0.0)];
            line.extend((0..STEPS).map(|step| axes.at((step + 1) as f64 / STEPS as f64, shares[step])));
            curve(&mut body, &line, color, "stroke-width=\"2\"");
        }
    }
    legend(&mut body, &models.iter().map(|(_, title)| *title).collect::<Vec<&str>>(), parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_higher_or_farther_right_is_so_in_the_picture() {
        let points = [Point3::origin(), Point3::new(0.1, 0.0, 0.0), Point3::new(0.0, 0.0, 0.1)];
        let view = View::of(points.iter());
        let [origin, right, high] = [0, 1, 2].map(|i| view.place(&points[i], 0.0));
        assert!(right[0] > origin[0] && high[1] < origin[1] && (high[0] - origin[0]).abs() < 1e-9);
        assert!(points.iter().all(|point| view.holds(point)) && !view.holds(&Point3::new(0.2, 0.0, 0.0)));
    }

    #[test]
    fn titles_become_text_and_not_markup() {
        let mut body = String::new();
        text(&mut body, [0.0, 0.0], "a < b & c");
        assert!(body.contains("a &lt; b &amp; c"));
    }
}
