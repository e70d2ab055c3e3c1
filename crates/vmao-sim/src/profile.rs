//! Where a trial's time goes. Off unless asked for; never part of a result.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// What a trial spends its time on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The simulator's own steps.
    Physics,
    /// States, torques, goals and contact checks of each tick.
    Control,
    /// Cameras.
    Observation,
    /// Contact models.
    Proposal,
    /// Gripper poses, inverse kinematics and choices among them.
    Grasping,
    /// Motion planning and timing.
    Planning,
    /// Anything else of a trial.
    Rest,
}

impl Stage {
    /// All stages with their names, in the order of a table.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::Physics, "mj_step"),
        (Self::Control, "control"),
        (Self::Observation, "observation"),
        (Self::Proposal, "contact model"),
        (Self::Grasping, "grasps and IK"),
        (Self::Planning, "planning"),
        (Self::Rest, "rest"),
    ];
}

static ENABLED: AtomicBool = AtomicBool::new(false);
static NANOSECONDS: [AtomicU64; Stage::ALL.len()] = [const { AtomicU64::new(0) }; Stage::ALL.len()];

thread_local! {
    /// The stage this thread is in, and since when it has been counted.
    static CURRENT: Cell<Option<(Stage, Instant)>> = const { Cell::new(None) };
}

/// Begins to measure, in all threads, from zero.
pub fn start() {
    NANOSECONDS.iter().for_each(|sum| sum.store(0, Ordering::Relaxed));
    ENABLED.store(true, Ordering::Relaxed);
}

/// Seconds of all threads spent in each stage since [`start`], in the order of [`Stage::ALL`]; `None` if never started.
pub fn seconds() -> Option<[f64; Stage::ALL.len()]> {
    let enabled = ENABLED.load(Ordering::Relaxed);
    enabled.then(|| NANOSECONDS.each_ref().map(|sum| sum.load(Ordering::Relaxed) as f64 * 1e-9))
}

/// Runs `work`; its time counts for `stage`, except for what it spends in stages inside it.
pub(crate) fn time<R>(stage: Stage, work: impl FnOnce() -> R) -> R {
    if !ENABLED.load(Ordering::Relaxed) {
        return work();
    }
    let outer = switch(None, Some(stage));
    let result = work();
    switch(Some(stage), outer);
    result
}

/// Books the time since the last switch and goes on in `next`; returns the stage that was left.
fn switch(leaving: Option<Stage>, next: Option<Stage>) -> Option<Stage> {
    let now = Instant::now();
    let before = CURRENT.replace(next.map(|stage| (stage, now)));
    if let Some((stage, since)) = before {
        let sum = &NANOSECONDS[leaving.unwrap_or(stage) as usize];
        sum.fetch_add(now.duration_since(since).as_nanos() as u64, Ordering::Relaxed);
    }
    before.map(|(stage, _)| stage)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hint::black_box;

    fn work() -> f64 {
        (0..200_000).fold(0.0, |sum, i| black_box(sum + f64::from(i).sqrt()))
    }

    #[test]
    fn an_inner_stage_is_not_counted_for_the_outer_one() {
        start();
        // Other tests of this process run trials too: only what these two stages add is looked at.
        let before = seconds().unwrap();
        time(Stage::Proposal, || {
            work();
            time(Stage::Rest, || time(Stage::Proposal, work));
        });
        let after = seconds().unwrap();
        let grown = |stage: Stage| after[stage as usize] - before[stage as usize];
        assert!(grown(Stage::Proposal) > 0.0 && CURRENT.get().is_none());
        ENABLED.store(false, Ordering::Relaxed);
        assert!(seconds().is_none());
    }
}
