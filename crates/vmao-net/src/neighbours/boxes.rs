//! Points in small groups that lie close together, and boxes around them, around sixteen such boxes, and so on up.
//!
//! A search looks into a box only if it may hold what is looked for, and tests sixteen boxes with a few vector instructions.

use super::columns::LANES;

/// Points of one group, in ascending order of their index; what is missing is infinitely far away.
#[derive(Debug, Clone)]
pub(super) struct Group {
    /// x, y and z of each point.
    pub(super) place: [[f32; LANES]; 3],
    /// Which point of the cloud.
    pub(super) index: [u32; LANES],
}

/// Sixteen boxes; a box of nothing is infinitely far away.
#[derive(Debug, Clone)]
pub(super) struct Boxes {
    low: [[f32; LANES]; 3],
    high: [[f32; LANES]; 3],
}

/// A cloud in groups with boxes around them.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    /// All points, one group after the other.
    pub(super) groups: Vec<Group>,
    /// Boxes around groups, then boxes around sixteen of those before, up to a level of at most sixteen.
    pub(super) levels: Vec<Vec<Boxes>>,
}

/// A point and its index in the cloud.
type Entry = ([f32; 3], u32);

impl Tree {
    /// Parts finite `points` at medians of the longest side until a group holds them, as a k-d tree does.
    pub(super) fn new(points: &[[f32; 3]]) -> Self {
        let mut entries: Vec<Entry> = points.iter().zip(0..).map(|(&point, index)| (point, index)).collect();
        part(&mut entries);
        let (groups, corners): (Vec<Group>, Vec<_>) = entries.chunks_mut(LANES).map(Group::new).unzip();
        let (mut levels, mut corners) = (Vec::new(), corners);
        loop {
            levels.push(corners.chunks(LANES).map(Boxes::new).collect::<Vec<_>>());
            if corners.len() <= LANES {
                return Self { groups, levels };
            }
            corners = corners.chunks(LANES).map(|corners| around(corners.iter().copied())).collect();
        }
    }
}

/// Orders entries so that every group is a compact box, and every sixteen groups, from the first on, are one too.
fn part(entries: &mut [Entry]) {
    let mut rest = entries;
    while rest.len() > LANES {
        let (low, high) = around(rest.iter().map(|&(point, _)| (point, point)));
        let side = |axis: usize| high[axis] - low[axis];
        let longest = (1..3).fold(0, |best, axis| if side(axis) > side(best) { axis } else { best });
        // The largest 16 · 2ʲ that leaves something: boxes of every level are full but for the last.
        let middle = LANES << ((rest.len() - 1) / LANES).ilog2();
        rest.select_nth_unstable_by(middle, |(a, _), (b, _)| a[longest].total_cmp(&b[longest]));
        let (near, far) = rest.split_at_mut(middle);
        part(near);
        rest = far;
    }
}

/// The box around boxes, each a lowest and a highest corner.
fn around(corners: impl Iterator<Item = ([f32; 3], [f32; 3])>) -> ([f32; 3], [f32; 3]) {
    corners.fold(([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]), |(low, high), (a, b)| {
        ([0, 1, 2].map(|axis| low[axis].min(a[axis])), [0, 1, 2].map(|axis| high[axis].max(b[axis])))
    })
}

impl Group {
    /// The group of at most sixteen points, and its box.
    fn new(entries: &mut [Entry]) -> (Self, ([f32; 3], [f32; 3])) {
        entries.sort_unstable_by_key(|&(_, index)| index);
        let mut group = Self { place: [[f32::INFINITY; LANES]; 3], index: [u32::MAX; LANES] };
        for (lane, &(point, index)) in entries.iter().enumerate() {
            group.index[lane] = index;
            (0..3).for_each(|axis| group.place[axis][lane] = point[axis]);
        }
        (group, around(entries.iter().map(|&(point, _)| (point, point))))
    }

    /// Squared distances (m²), rounded as [`super::squared_distance`] rounds them.
    #[inline(always)]
    pub(super) fn gaps(&self, centre: [f32; 3]) -> [f32; LANES] {
        let mut gaps = [0.0; LANES];
        for lane in 0..LANES {
            let [dx, dy, dz] = [0, 1, 2].map(|axis| self.place[axis][lane] - centre[axis]);
            gaps[lane] = dx * dx + dy * dy + dz * dz;
        }
        gaps
    }
}

impl Boxes {
    fn new(corners: &[([f32; 3], [f32; 3])]) -> Self {
        let mut boxes = Self { low: [[f32::INFINITY; LANES]; 3], high: [[f32::INFINITY; LANES]; 3] };
        for (lane, (low, high)) in corners.iter().enumerate() {
            for axis in 0..3 {
                (boxes.low[axis][lane], boxes.high[axis][lane]) = (low[axis], high[axis]);
            }
        }
        boxes
    }

    /// Squared distances (m²) from a point to the boxes, zero inside.
    ///
    /// Rounding cannot make one larger than the rounded distance of a point in the box: differences, squares and sums that are
    /// rounded keep their order, and these are the same operations on smaller numbers.
    #[inline(always)]
    pub(super) fn gaps(&self, centre: [f32; 3]) -> [f32; LANES] {
        let mut gaps = [0.0; LANES];
        for lane in 0..LANES {
            let [dx, dy, dz] = [0, 1, 2].map(|axis| {
                let (below, above) = (self.low[axis][lane] - centre[axis], centre[axis] - self.high[axis][lane]);
                let outside = if below > above { below } else { above };
                if outside > 0.0 { outside } else { 0.0 }
            });
            gaps[lane] = dx * dx + dy * dy + dz * dz;
        }
        gaps
    }
}
