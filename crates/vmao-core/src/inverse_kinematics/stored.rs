//! Stored configurations, found again by where they put the last link: starts that are already near the wanted pose.
//!
//! The first joint turns the whole arm about its axis and the last joint turns the tool about its own, so both are left
//! out of the table and computed for the wanted pose. What is left of a pose is where the last link's origin lies in the
//! half plane through the first axis, and the direction of the last axis: four dimensions, cut into cells.

use crate::{
    damped_least_squares::{Fixed, Goal, Joints, MAX_JOINTS, Solver},
    kinematics::ChainJoint,
    random::Stream,
};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{PI, TAU};

/// Configurations stored: as many as a second-level cache holds.
const ENTRIES: usize = 1 << 15;
/// Cells across distance from the first axis, height along it, and height and azimuth of the last axis's direction.
const CELLS: [usize; 4] = [9, 16, 6, 8];

/// Where the last link is, seen from the first axis and apart from the two angles left out.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// Distance from the first axis and height along it (m), then the last axis: outwards, sideways, along.
    key: [f32; 5],
    /// Of the origin about the first axis (rad).
    azimuth: f64,
    /// The last link's x axis at the last joint's zero: outwards, sideways, along.
    x: [f32; 3],
}

impl Place {
    fn new((first, base): &Fixed, rotation: &Matrix3<f64>, origin: &Vector3<f64>) -> Self {
        let origin = first.transpose() * (origin - base);
        let azimuth = origin.y.atan2(origin.x);
        let (sine, cosine) = azimuth.sin_cos();
        let seen = |column: usize| {
            let v = first.transpose() * rotation.column(column);
            [cosine * v.x + sine * v.y, cosine * v.y - sine * v.x, v.z].map(|x| x as f32)
        };
        let [out, side, along] = seen(2);
        Self { key: [origin.xy().norm() as f32, origin.z as f32, out, side, along], azimuth, x: seen(0) }
    }

    fn gap(&self, other: &Self) -> f32 {
        self.key.iter().zip(&other.key).map(|(a, b)| (a - b) * (a - b)).sum()
    }

    /// The last joint's angle that turns this x axis nearest to the wanted one.
    fn roll_to(&self, wanted: &Self) -> f64 {
        let [.., z0, z1, z2] = self.key;
        let (z, x, goal) = (Vector3::new(z0, z1, z2), Vector3::from(self.x), Vector3::from(wanted.x));
        f64::from(goal.dot(&z.cross(&x)).atan2(goal.dot(&x)))
    }
}

#[derive(Debug, Clone)]
struct Entry {
    place: Place,
    q: [f32; MAX_JOINTS],
}

/// The table of one chain.
#[derive(Debug, Clone)]
pub(super) struct StoredStarts {
    entries: Vec<Entry>,
    /// First entry of each cell, and the end.
    cells: Vec<u32>,
    lower: [f32; 2],
    width: [f32; 2],
}

impl StoredStarts {
    /// Fills the table from a fixed random stream: equal for equal chains. Empty for a chain of less than 3 joints.
    pub(super) fn new(solver: &Solver) -> Self {
        let (count, mut stream) = (solver.count(), Stream::new(0, &[u64::from_le_bytes(*b"ikstarts")]));
        let entry = |_| {
            let mut q = [0.0; MAX_JOINTS];
            for i in 1..count - 1 {
                q[i] = stream.range(solver.joints[i].lower, solver.joints[i].upper);
            }
            let (rotation, origin) = solver.last_link(&q);
            Entry { place: Place::new(&solver.fixed[0], &rotation, &origin), q: q.map(|angle| angle as f32) }
        };
        let mut entries: Vec<Entry> = if count < 3 { Vec::new() } else { (0..ENTRIES).map(entry).collect() };
        let extent = |i: usize| {
            let values = entries.iter().map(|entry| entry.place.key[i]);
            values.fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(x), high.max(x)))
        };
        let extents = [extent(0), extent(1)];
        let mut table = Self {
            entries: Vec::new(),
            cells: vec![0; CELLS.iter().product::<usize>() + 1],
            lower: extents.map(|(low, _)| low),
            width: extents.map(|(low, high)| (high - low).max(1e-6)),
        };
        entries.sort_by_cached_key(|entry| table.index(table.cell(&entry.place)));
        for entry in &entries {
            let index = table.index(table.cell(&entry.place));
            table.cells[index + 1] += 1;
        }
        for i in 1..table.cells.len() {
            table.cells[i] += table.cells[i - 1];
        }
        table.entries = entries;
        table
    }

    fn cell(&self, place: &Place) -> [usize; 4] {
        let [radius, height, out, side, along] = place.key;
        let azimuth = (side.atan2(out) / std::f32::consts::TAU + 0.5).clamp(0.0, 1.0);
        let shares =
            [(radius - self.lower[0]) / self.width[0], (height - self.lower[1]) / self.width[1], (along + 1.0) / 2.0, azimuth];
        // a conversion to an integer saturates, so that a target anywhere has a cell
        [0, 1, 2, 3].map(|i| ((shares[i] * CELLS[i] as f32) as usize).min(CELLS[i] - 1))
    }

    fn index(&self, cell: [usize; 4]) -> usize {
        cell.iter().zip(CELLS).fold(0, |index, (&i, count)| index * count + i)
    }

    /// Calls `visit` with the entries of the goal's cell and of its neighbours up to `rings` away.
    fn visit(&self, wanted: &Place, rings: usize, mut visit: impl FnMut(u32, &Entry)) {
        let middle = self.cell(wanted);
        let side = 2 * rings + 1;
        for step in 0..side.pow(4) {
            let mut cell = [0; 4];
            let mut outside = false;
            for (i, count) in CELLS.into_iter().enumerate() {
                let moved = middle[i] + step / side.pow(i as u32) % side;
                // the last dimension is an azimuth and closes
                cell[i] = if i == 3 { (moved + count - rings) % count } else { moved.wrapping_sub(rings) };
                outside |= cell[i] >= count;
            }
            if !outside {
                let index = self.index(cell);
                for at in self.cells[index]..self.cells[index + 1] {
                    visit(at, &self.entries[at as usize]);
                }
            }
        }
    }

    /// Up to `N` starts for `goal` from its cell, the nearest first, in `starts`; how many there are.
    pub(super) fn nearest<const N: usize>(&self, solver: &Solver, goal: &Goal, starts: &mut [Joints; N]) -> usize {
        let wanted = self.wanted(solver, goal);
        let (mut best, mut count) = ([(f32::INFINITY, 0); N], 0);
        self.visit(&wanted, 0, |at, entry| {
            let gap = entry.place.gap(&wanted);
            if gap < best[N - 1].0 {
                let place = best.partition_point(|&(other, _)| other <= gap);
                best.copy_within(place..N - 1, place + 1);
                best[place] = (gap, at);
                count = (count + 1).min(N);
            }
        });
        let mut used = 0;
        for &(_, at) in &best[..count] {
            if let Some(start) = start(solver, &self.entries[at as usize], &wanted) {
                starts[used] = start;
                used += 1;
            }
        }
        used
    }

    /// All starts for `goal` from its cell and the cells around it, at most `most`, the nearest first.
    pub(super) fn around(&self, solver: &Solver, goal: &Goal, most: usize) -> Vec<Joints> {
        let wanted = self.wanted(solver, goal);
        let mut found = Vec::new();
        self.visit(&wanted, 1, |at, entry| found.push((entry.place.gap(&wanted), at)));
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let starts = found.iter().filter_map(|&(_, at)| start(solver, &self.entries[at as usize], &wanted));
        starts.take(most).collect()
    }

    fn wanted(&self, solver: &Solver, goal: &Goal) -> Place {
        let (turn, offset) = &solver.fixed[solver.count()];
        let rotation = goal.rotation * turn.transpose();
        Place::new(&solver.fixed[0], &rotation, &(goal.position - rotation * offset))
    }
}

/// The entry with its first and last joints turned to the wanted place; none if their limits forbid that.
fn start(solver: &Solver, entry: &Entry, wanted: &Place) -> Option<Joints> {
    let last = solver.count() - 1;
    let mut q = entry.q.map(f64::from);
    q[0] = within(&solver.joints[0], wanted.azimuth - entry.place.azimuth)?;
    q[last] = within(&solver.joints[last], entry.place.roll_to(wanted))?;
    Some(q)
}

/// The angle inside the limits that differs from `angle` by whole turns and is nearest to the middle, if there is one.
fn within(joint: &ChainJoint, angle: f64) -> Option<f64> {
    let middle = (joint.lower + joint.upper) / 2.0;
    let turned = middle + (angle - middle + PI).rem_euclid(TAU) - PI;
    (joint.lower..=joint.upper).contains(&turned).then_some(turned)
}
