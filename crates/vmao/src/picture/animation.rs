//! A rollout as an animated GIF: one palette for all frames, and of each frame only what changed.

use super::palette::Palette;
use super::studio::{Framing, Layer, Studio};
use crate::failure::Failure;
use gif::{DisposalMethod, Encoder, Frame, Repeat};
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::Write;
use vmao_core::rollout::Rollout;
use vmao_sim::Picture;

/// Frames whose pictures make the palette.
const SAMPLED: usize = 16;
/// The index that shows the frame before.
const UNCHANGED: u8 = 255;
/// How long the last frame stays (1/100 s).
const REST: u16 = 150;
/// Height of the bar that shows the time (pixels), and its colours: of the future, of a success, of a failure.
const BAR: usize = 4;
const BAR_COLORS: [[u8; 3]; 3] = [[217, 214, 205], [29, 122, 68], [168, 68, 59]];

/// How a rollout becomes an animation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Animation {
    /// Pixels across and down.
    pub(crate) size: [usize; 2],
    /// Pictures a second; GIF counts in 1/100 s.
    pub(crate) rate: f64,
    /// Simulated seconds a second.
    pub(crate) speed: f64,
    /// From the front, to the left (rad).
    pub(crate) turn: f64,
    /// Above the level (rad).
    pub(crate) elevation: f64,
    pub(crate) layer: Layer,
}

impl Animation {
    /// 1/100 s between pictures.
    fn delay(&self) -> u16 {
        (100.0 / self.rate).round().clamp(2.0, 1000.0) as u16
    }

    /// The recorded frames that are shown, the last one always.
    pub(crate) fn frames(&self, rollout: &Rollout) -> Vec<usize> {
        let Some(last) = rollout.frames.len().checked_sub(1) else { return Vec::new() };
        let step = f64::from(self.delay()) / 100.0 * self.speed / rollout.frame_seconds;
        let count = (last as f64 / step).ceil() as usize;
        (0..=count).map(|k| ((k as f64 * step).round() as usize).min(last)).collect()
    }
}

/// Draws in the current rayon pool and writes; `drawn` is called after each picture. The rollout must have a frame.
pub(crate) fn encode(
    rollout: &Rollout,
    animation: &Animation,
    out: impl Write,
    drawn: &(dyn Fn() + Sync),
) -> Result<(), Failure> {
    let studio = Studio::new(rollout);
    let [width, height] = animation.size;
    let eye = studio.eye([animation.turn, animation.elevation], width as f64 / height as f64, Framing::Whole);
    let frames = animation.frames(rollout);
    let last = rollout.frames.len() - 1;
    let draw = |&frame: &usize| {
        let mut picture = studio.picture(frame, &eye, animation.size, animation.layer);
        bar(&mut picture, frame as f64 / last.max(1) as f64, rollout.outcome == "success");
        drawn();
        picture
    };
    let pictures: Vec<Picture> = frames.par_iter().map(draw).collect();
    let palette =
        Palette::of(pictures.iter().step_by((pictures.len() / SAMPLED).max(1)).chain(pictures.last()), usize::from(UNCHANGED));
    // A whole table, so that the index of what did not change is in it.
    let mut table = palette.colors.clone();
    table.resize(usize::from(UNCHANGED) + 1, [0; 3]);
    let mut encoder = Encoder::new(out, width as u16, height as u16, table.as_flattened())?;
    encoder.set_repeat(Repeat::Infinite)?;
    let mut before: Option<Vec<u8>> = None;
    for (number, picture) in pictures.iter().enumerate() {
        let now = palette.indices(picture);
        let delay = if number + 1 == pictures.len() { REST } else { animation.delay() };
        encoder.write_frame(&changed(before.as_deref(), &now, width, delay))?;
        before = Some(now);
    }
    Ok(())
}

/// The rectangle of pixels that changed; those in it that did not are see-through.
fn changed(before: Option<&[u8]>, now: &[u8], width: usize, delay: u16) -> Frame<'static> {
    let height = now.len() / width;
    let differs = |at: usize| before.is_none_or(|before| before[at] != now[at]);
    let rows = bounds(height, |row| (0..width).any(|column| differs(row * width + column)));
    let columns = bounds(width, |column| (0..height).any(|row| differs(row * width + column)));
    let places = rows.clone().flat_map(|row| columns.clone().map(move |column| row * width + column));
    let buffer: Vec<u8> = places.map(|at| if differs(at) { now[at] } else { UNCHANGED }).collect();
    Frame {
        delay,
        dispose: DisposalMethod::Keep,
        transparent: before.is_some().then_some(UNCHANGED),
        top: rows.start as u16,
        left: columns.start as u16,
        width: columns.len() as u16,
        height: rows.len() as u16,
        buffer: Cow::Owned(buffer),
        ..Frame::default()
    }
}

/// From the first to the last that `holds`; a single one if none does, because a frame cannot be empty.
fn bounds(count: usize, holds: impl Fn(usize) -> bool) -> std::ops::Range<usize> {
    let first = (0..count).find(|&at| holds(at)).unwrap_or(0);
    let last = (first..count).rev().find(|&at| holds(at)).unwrap_or(first);
    first..last + 1
}

/// The time that has passed, as a bar along the lower edge in the colour of the outcome.
fn bar(picture: &mut Picture, share: f64, success: bool) {
    let (width, done) = (picture.width, (share * picture.width as f64).round() as usize);
    let [future, good, bad] = BAR_COLORS;
    let top = picture.height.saturating_sub(BAR) * width;
    for (at, pixel) in picture.pixels[top..].iter_mut().enumerate() {
        *pixel = if at % width >= done {
            future
        } else if success {
            good
        } else {
            bad
        };
    }
}
