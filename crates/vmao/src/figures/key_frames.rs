//! Figure 3: a manipulation in key frames, seen from the front and from the side.

use crate::picture::{Framing, Layer, Studio, sheet};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;
use vmao_core::rollout::Rollout;
use vmao_sim::Picture;

/// Of one key frame (pixels).
const TILE: [usize; 2] = [240, 180];
/// Turn and elevation of the front and of the side view (rad); from the side over the arm that stands there.
const VIEWS: [[f64; 2]; 2] = [[0.0, 0.3], [FRAC_PI_2, 0.75]];

/// When something has come about: the start, each hold, each place that the object was brought to, the end (s).
fn key_times(rollout: &Rollout) -> Vec<f64> {
    let end = rollout.frames.len().saturating_sub(1) as f64 * rollout.frame_seconds;
    // An arm whose way is planned again reaches for its part a second time.
    let mut reached = BTreeSet::new();
    let mut begins =
        |label: &str| label.starts_with("move the object") || label.contains(" reaches for ") && reached.insert(label.to_owned());
    let events = rollout.events.iter().filter(|event| begins(&event.label)).map(|event| event.time);
    let mut times: Vec<f64> = [0.0].into_iter().chain(events).chain([end]).map(|time| time.clamp(0.0, end)).collect();
    // Arms that grasp together begin at one time.
    times.sort_by(f64::total_cmp);
    times.dedup_by(|a, b| (*a - *b).abs() < rollout.frame_seconds);
    times
}

/// Two rows of pictures, a column for each key time; the rollout must have a frame.
pub(crate) fn key_frames(rollout: &Rollout) -> Picture {
    let studio = Studio::new(rollout);
    let frame = |time: &f64| ((time / rollout.frame_seconds).round() as usize).min(rollout.frames.len() - 1);
    let frames: Vec<usize> = key_times(rollout).iter().map(frame).collect();
    let row = |view: [f64; 2]| {
        let eye = studio.eye(view, TILE[0] as f64 / TILE[1] as f64, Framing::Work);
        frames.par_iter().map(|&frame| studio.picture(frame, &eye, TILE, Layer::Plain)).collect()
    };
    sheet(&VIEWS.map(row))
}
