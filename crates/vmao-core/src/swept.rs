//! Collision checks of whole straight motions in joint space, without gaps between samples.
//!
//! A pair of solids that is d apart at one moment stays clear for as long as the two cannot have moved d towards each
//! other; a joint's turn moves a point by at most its greatest distance from the axis times the angle. Intervals of the
//! motion are halved, breadth first, until that settles every pair (after Schwarzer, Saha & Latombe 2005).

use crate::{
    collision::CollisionPair,
    collision_checker::{Bunch, CollisionChecker, FLOOR, Pair},
    distance::{Convex, Nearness},
};
use nalgebra::{Matrix3, Vector3};

/// Intervals in which no joint turns further than this are not halved again (rad).
///
/// Only a margin under a few millimetres gets that far; between the samples such a motion is not proven clear.
const FINEST: f64 = 0.002;

/// How far the solids of one arm can be from its joints' axes.
#[derive(Debug, Clone)]
pub(crate) struct Reaches {
    first_joint: usize,
    first_slot: usize,
    /// For each solid the greatest distance of its points from the axis of each joint that moves it (m), base first.
    of_solids: Vec<Vec<f64>>,
}

impl Reaches {
    /// `solids`: the link that each rides on and the solid in that link's frame.
    pub(crate) fn new<'s>(
        parent_from_joints: &[(Matrix3<f64>, Vector3<f64>)],
        first_joint: usize,
        first_slot: usize,
        solids: impl Iterator<Item = (usize, &'s Convex)>,
    ) -> Self {
        let reach = |link: usize, solid: &Convex, joint: usize| {
            // Along the chain from the joint's link to the solid; what lies along the axis does not count in the first step.
            let shifts = parent_from_joints[joint + 1..link].iter().map(|(_, shift)| *shift).chain([*solid.center()]);
            shifts.enumerate().map(|(i, v)| if i == 0 { v.xy().norm() } else { v.norm() }).sum::<f64>() + solid.bound()
        };
        let of_solid = |(link, solid): (usize, &Convex)| (0..link).map(|joint| reach(link, solid, joint)).collect();
        Self { first_joint, first_slot, of_solids: solids.map(of_solid).collect() }
    }
}

/// What sweeping needs besides the pairs, kept to spare allocations.
#[derive(Debug, Clone)]
pub(crate) struct Sweep {
    arms: Vec<Reaches>,
    /// For each solid, how far it can move against each link of its arm in the whole motion (m); row-wise.
    moves: Vec<f64>,
    /// For each pair, which two entries of `moves` add up to how far they can come closer.
    entries: Vec<[u32; 2]>,
    /// The bunches of each scope, those that collided lately first: they are the likeliest to collide again.
    orders: Vec<Vec<u32>>,
    undecided: Vec<u32>,
    intervals: Vec<Interval>,
    q: Vec<f64>,
}

/// Which pairs count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    /// Every pair.
    All,
    /// One moving arm with itself and with what does not move.
    Own(usize),
    /// Any two arms that both move.
    Between,
    /// These two arms, the lower index first, if both move.
    Pair(usize, usize),
}

#[derive(Debug, Clone, Copy)]
struct Interval {
    middle: f64,
    half: f64,
    /// Where in `undecided` the pairs are that may collide in it.
    first: usize,
    end: usize,
}

/// Row length of `Sweep::moves`: the base and the links, and one more that is always zero.
fn width(arms: &[Reaches]) -> usize {
    arms.iter().flat_map(|arm| &arm.of_solids).map(Vec::len).max().unwrap_or(0) + 1
}

impl Scope {
    fn index(self, arms: usize) -> usize {
        match self {
            Self::All => 0,
            Self::Between => 1,
            Self::Own(arm) => 2 + arm,
            Self::Pair(one, other) => 2 + arms + one * arms + other,
        }
    }
}

impl Sweep {
    pub(crate) fn new(arms: Vec<Reaches>, solids: usize, pairs: &[Pair], bunches: &[Bunch], frozen: &[usize]) -> Self {
        let (width, zero) = (width(&arms), solids * width(&arms));
        let mut owners = vec![None; solids];
        for (index, arm) in arms.iter().enumerate() {
            for (slot, reaches) in (arm.first_slot..).zip(&arm.of_solids) {
                owners[slot] = Some((index, reaches.len()));
            }
        }
        let owner = |solid: u32| owners.get(solid as usize).copied().flatten();
        let entry = |solid: u32, link: usize| (solid as usize * width + link) as u32;
        let entries = pairs.iter().map(|pair| match (owner(pair.first), owner(pair.second)) {
            // against each other only the joints between them count
            (Some((arm, link)), Some((other, other_link))) if arm == other => {
                let (near, far) = if link <= other_link { (link, pair.second) } else { (other_link, pair.first) };
                [entry(far, near), zero as u32]
            }
            (first, second) => {
                let from_base = |owner: Option<_>, solid| if owner.is_some() { entry(solid, 0) } else { zero as u32 };
                [from_base(first, pair.first), from_base(second, pair.second)]
            }
        });
        debug_assert!(pairs.iter().all(|pair| pair.first != FLOOR), "the floor comes second");
        let entries: Vec<[u32; 2]> = entries.collect();
        let mut orders = vec![Vec::new(); 2 + arms.len() + arms.len() * arms.len()];
        for (index, bunch) in bunches.iter().enumerate() {
            let pair = &pairs[bunch.balls];
            let mover = |solid: u32| owner(solid).map(|(arm, _)| arm).filter(|arm| !frozen.contains(arm));
            let mut list = |scope: Scope| orders[scope.index(arms.len())].push(index as u32);
            list(Scope::All);
            match (mover(pair.first), mover(pair.second)) {
                (Some(one), Some(other)) if one != other => {
                    list(Scope::Between);
                    list(Scope::Pair(one.min(other), one.max(other)));
                }
                (Some(arm), _) | (None, Some(arm)) => list(Scope::Own(arm)),
                (None, None) => {}
            }
        }
        Self { entries, orders, moves: vec![0.0; zero + 1], arms, undecided: Vec::new(), intervals: Vec::new(), q: Vec::new() }
    }

    /// Fills `moves` for the motion from `from` to `to`.
    fn bound_moves(&mut self, from: &[f64], to: &[f64]) {
        let width = width(&self.arms);
        for arm in &self.arms {
            for (index, reaches) in arm.of_solids.iter().enumerate() {
                let row = (arm.first_slot + index) * width;
                let mut sum = 0.0;
                for (joint, reach) in reaches.iter().enumerate().rev() {
                    let turn = (to[arm.first_joint + joint] - from[arm.first_joint + joint]).abs();
                    sum += reach * turn;
                    self.moves[row + joint] = sum;
                }
            }
        }
    }
}

impl CollisionChecker<'_> {
    /// Whether no pair comes closer than `margin` (m) on the straight line, its start excepted.
    ///
    /// True means no sampled pair is closer than `margin`, and none is closer than half of it anywhere on the line, start
    /// included (with a margin too small for that, under about 2 mm: at samples 0.002 rad apart).
    pub fn edge_is_free(&mut self, from: &[f64], to: &[f64], margin: f64) -> bool {
        self.edge_is_free_in(Scope::All, from, to, margin)
    }

    /// The same for some pairs only.
    pub(crate) fn edge_is_free_in(&mut self, scope: Scope, from: &[f64], to: &[f64], margin: f64) -> bool {
        self.edge_hit(scope, from, to, margin).is_none()
    }

    /// A pair that comes closer than `margin` (m) on the straight line, its start excepted, as it is where that was noticed.
    pub fn check_edge(&mut self, from: &[f64], to: &[f64], margin: f64) -> Option<CollisionPair> {
        let pair = self.edge_hit(Scope::All, from, to, margin)?;
        Some(self.describe(pair))
    }

    fn edge_hit(&mut self, scope: Scope, from: &[f64], to: &[f64], margin: f64) -> Option<usize> {
        self.sweep.bound_moves(from, to);
        let scope = scope.index(self.sweep.arms.len());
        let mut order = std::mem::take(&mut self.sweep.orders[scope]);
        // Buffers leave `self` while pairs are judged and come back below; nothing in between can panic.
        let mut undecided = std::mem::take(&mut self.sweep.undecided);
        let mut intervals = std::mem::take(&mut self.sweep.intervals);
        let mut q = std::mem::take(&mut self.sweep.q);
        let hit = self.sweep_intervals(&order, (from, to), margin, (&mut undecided, &mut intervals, &mut q));
        (self.sweep.undecided, self.sweep.intervals, self.sweep.q) = (undecided, intervals, q);
        let holds = |bunch: u32, hit: usize| self.bunches[bunch as usize].members.contains(&hit);
        if let Some(place) = hit.and_then(|hit| order.iter().position(|&bunch| holds(bunch, hit))) {
            order[..=place].rotate_right(1);
        }
        self.sweep.orders[scope] = order;
        hit
    }

    fn place_pair(&mut self, pair: usize) {
        let Pair { first, second, .. } = self.pairs[pair];
        self.place_solid(first as usize);
        if second != FLOOR {
            self.place_solid(second as usize);
        }
    }

    fn sweep_intervals(
        &mut self,
        order: &[u32],
        (from, to): (&[f64], &[f64]),
        margin: f64,
        (undecided, intervals, q): (&mut Vec<u32>, &mut Vec<Interval>, &mut Vec<f64>),
    ) -> Option<usize> {
        let turn = from.iter().zip(to).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let closing = |checker: &Self, pair: usize| {
            let [one, other] = checker.sweep.entries[pair];
            checker.sweep.moves[one as usize] + checker.sweep.moves[other as usize]
        };
        undecided.clear();
        intervals.clear();
        // The end is a sample of its own, and fails soonest.
        self.place(to);
        let bunches = || order.iter().map(|&bunch| bunch as usize);
        if let Some(hit) = bunches().find_map(|bunch| self.hit_in(&self.bunches[bunch], margin)) {
            return Some(hit);
        }
        q.clear();
        q.extend(from.iter().zip(to).map(|(a, b)| a + (b - a) * 0.5));
        self.place(q);
        for bunch in bunches() {
            let bunch = &self.bunches[bunch];
            if !self.is_clear(bunch, margin, margin / 2.0 + closing(self, bunch.balls) * 0.5) {
                undecided.extend(bunch.members.clone().map(|pair| pair as u32));
            }
        }
        intervals.push(Interval { middle: 0.5, half: 0.5, first: 0, end: undecided.len() });
        let mut next = 0;
        while let Some(&Interval { middle, half, first, end }) = intervals.get(next) {
            next += 1;
            if first == end {
                continue;
            }
            q.clear();
            q.extend(from.iter().zip(to).map(|(a, b)| a + (b - a) * middle));
            self.pose(q);
            let kept = undecided.len();
            for index in first..end {
                let pair = undecided[index] as usize;
                self.place_pair(pair);
                match self.nearness(pair, margin, margin / 2.0 + closing(self, pair) * half) {
                    Nearness::Hit => return Some(pair),
                    Nearness::Near => undecided.push(pair as u32),
                    Nearness::Clear => {}
                }
            }
            if undecided.len() > kept && 2.0 * half * turn > FINEST {
                for side in [-0.5, 0.5] {
                    let middle = middle + side * half;
                    intervals.push(Interval { middle, half: half / 2.0, first: kept, end: undecided.len() });
                }
            }
        }
        None
    }
}
