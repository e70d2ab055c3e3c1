//! The study as two pictures: success and motion by root, and predicted beside measured ways.

use crate::cells::CELLS;
use crate::study::{Study, paired_ratio};
use crate::tables::{MEASURES, wilson};
use std::error::Error;
use std::fs;
use vmao_core::catalogue::InstanceSet;

const ROW: f64 = 17.0;
const LABELS: f64 = 250.0;
const PANEL: f64 = 170.0;
const GAP: f64 = 26.0;
const TOP: f64 = 46.0;
const COLORS: [&str; 4] = ["#b3261e", "#1f5fa8", "#2e7d32", "#7b3fa0"];

/// A panel of dots with whiskers: heading, least and greatest value, marks on its axis.
type Panel = (&'static str, [f64; 2], [f64; 3]);

const PANELS: [Panel; 4] = [
    ("success (%)", [0.0, 100.0], [0.0, 50.0, 100.0]),
    ("hands' ways, ratio to first", [0.75, 1.5], [0.75, 1.0, 1.5]),
    ("part error, ratio to first", [0.6, 1.6], [0.6, 1.0, 1.6]),
    ("peak internal force, ratio", [0.6, 1.6], [0.6, 1.0, 1.6]),
];

fn page(width: f64, height: f64, body: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{body}</svg>\n"
    )
}

fn text(body: &mut String, x: f64, y: f64, anchor: &str, words: &str) {
    *body += &format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{words}</text>\n");
}

fn line(body: &mut String, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], color: &str) {
    *body += &format!("<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{color}\"/>\n");
}

fn dot(body: &mut String, x: f64, y: f64, radius: f64, color: &str) {
    *body += &format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{color}\"/>\n");
}

/// Writes `dependency-root.svg` and `dependency-root-prediction.svg`.
pub(crate) fn write(directory: &str, set: InstanceSet, folder: &str) -> Result<(), Box<dyn Error>> {
    let mut studies = Vec::new();
    for cell in &CELLS {
        if let Some(study) = Study::read(directory, cell, set, 0)? {
            studies.push((cell.name(), study));
        }
    }
    fs::write(format!("{folder}/dependency-root.svg"), by_root(&studies))?;
    fs::write(format!("{folder}/dependency-root-prediction.svg"), prediction(&studies))?;
    Ok(())
}

fn by_root(studies: &[(String, Study)]) -> String {
    let mut body = String::new();
    let left = |panel: usize| LABELS + panel as f64 * (PANEL + GAP);
    let place = |panel: usize, value: f64| {
        let [low, high] = PANELS[panel].1;
        left(panel) + PANEL * ((value.clamp(low, high) - low) / (high - low))
    };
    let rows: usize = studies.iter().map(|(_, study)| study.choices.len() + 1).sum();
    let bottom = TOP + rows as f64 * ROW;
    for (panel, (heading, _, marks)) in PANELS.iter().enumerate() {
        text(&mut body, left(panel) + PANEL / 2.0, 16.0, "middle", heading);
        for &mark in marks {
            text(&mut body, place(panel, mark), 32.0, "middle", &mark.to_string());
            line(&mut body, [place(panel, mark), TOP - 8.0], [place(panel, mark), bottom], "#d0d0d0");
        }
    }
    let mut y = TOP;
    for (name, study) in studies {
        text(&mut body, 6.0, y + 10.0, "start", &format!("{name}, {} trials", study.trials()));
        y += ROW;
        for (root, choice) in study.choices.iter().enumerate() {
            let color = if choice.name == "auto" { "#111111" } else { COLORS[root % COLORS.len()] };
            text(&mut body, LABELS - 14.0, y + 10.0, "end", &choice.name);
            let rate = 100.0 * choice.successes() as f64 / study.trials() as f64;
            let [low, high] = wilson(choice.successes(), study.trials());
            let mut values = vec![Some([low, rate, high])];
            for measure in [0, 3, 5] {
                values.push(paired_ratio(choice, &study.choices[0], &study.common, MEASURES[measure].1));
            }
            for (panel, value) in values.iter().enumerate() {
                if let Some([low, middle, high]) = value {
                    line(&mut body, [place(panel, *low), y + 6.0], [place(panel, *high), y + 6.0], color);
                    dot(&mut body, place(panel, *middle), y + 6.0, 3.5, color);
                }
            }
            y += ROW;
        }
    }
    page(left(PANELS.len()), bottom + 8.0, &body)
}

/// Predicted against measured length of the hands' ways, a square for each cell.
fn prediction(studies: &[(String, Study)]) -> String {
    const MOST: f64 = 1.0; // m
    const SIDE: f64 = 190.0;
    let columns = studies.len().clamp(1, 3);
    let mut body = String::new();
    for (index, (name, study)) in studies.iter().enumerate() {
        let (x, y) = ((index % columns) as f64 * (SIDE + 50.0) + 40.0, (index / columns) as f64 * (SIDE + 60.0) + 30.0);
        text(&mut body, x + SIDE / 2.0, y - 8.0, "middle", name);
        line(&mut body, [x, y + SIDE], [x + SIDE, y], "#bbbbbb");
        line(&mut body, [x, y + SIDE], [x + SIDE, y + SIDE], "#444444");
        line(&mut body, [x, y], [x, y + SIDE], "#444444");
        text(&mut body, x + SIDE / 2.0, y + SIDE + 14.0, "middle", "predicted, 0 to 1 m");
        text(&mut body, x - 4.0, y + 8.0, "end", "1 m");
        for &(root, predicted, measured) in &study.predicted {
            let at = |value: f64| SIDE * value.min(MOST) / MOST;
            dot(&mut body, x + at(predicted), y + SIDE - at(measured), 1.3, COLORS[root % COLORS.len()]);
        }
    }
    let rows = studies.len().div_ceil(columns);
    page(columns as f64 * (SIDE + 50.0) + 20.0, rows as f64 * (SIDE + 60.0) + 10.0, &body)
}
