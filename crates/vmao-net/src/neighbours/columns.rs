//! Points by coordinate, in groups as wide as the widest vectors, so that distances to a whole group are a few instructions.

/// Points of a group.
pub(crate) const LANES: usize = 16;

/// Queries that one task of a parallel search answers.
pub(super) const TASK: usize = 128;

/// The lanes for which `holds`, in ascending order.
#[inline(always)]
pub(super) fn chosen(holds: impl Fn(usize) -> bool) -> impl Iterator<Item = usize> {
    let mut mask = 0_u32;
    for lane in 0..LANES {
        mask |= u32::from(holds(lane)) << lane;
    }
    std::iter::from_fn(
        #[inline(always)]
        move || {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask.wrapping_sub(1);
            (lane < LANES).then_some(lane)
        },
    )
}

/// Coordinates of points, a group after the other; the last one is filled up with points infinitely far away.
#[derive(Debug, Clone)]
pub(crate) struct Columns {
    x: Vec<[f32; LANES]>,
    y: Vec<[f32; LANES]>,
    z: Vec<[f32; LANES]>,
}

impl Columns {
    /// Takes `points` apart.
    pub(crate) fn new(points: &[[f32; 3]]) -> Self {
        let axis = |axis: usize| {
            let mut groups = vec![[f32::INFINITY; LANES]; points.len().div_ceil(LANES)];
            groups.as_flattened_mut().iter_mut().zip(points).for_each(|(slot, point)| *slot = point[axis]);
            groups
        };
        Self { x: axis(0), y: axis(1), z: axis(2) }
    }

    /// Calls `near` with the first index and the squared distances of every group that has a point closer than the bound.
    ///
    /// The bound (m²) is what `near` returned last; where it becomes negative the scan stops. Rounds as
    /// [`super::squared_distance`] does. Inline, because callers compile it for the vectors that the processor has.
    #[inline(always)]
    pub(crate) fn scan(&self, centre: [f32; 3], mut bound: f32, mut near: impl FnMut(usize, &[f32; LANES]) -> f32) {
        let groups = self.x.iter().zip(&self.y).zip(&self.z);
        for (group, ((x, y), z)) in groups.enumerate() {
            let mut gaps = [0.0; LANES];
            let mut any = false;
            for lane in 0..LANES {
                let (dx, dy, dz) = (x[lane] - centre[0], y[lane] - centre[1], z[lane] - centre[2]);
                gaps[lane] = dx * dx + dy * dy + dz * dz;
                any |= gaps[lane] < bound;
            }
            if any {
                bound = near(group * LANES, &gaps);
                if bound < 0.0 {
                    return;
                }
            }
        }
    }
}
