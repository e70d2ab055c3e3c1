//! How much of a part's surface contacts have touched: the surface is cut into cubes, and those with a contact are counted.

use crate::{geometry::Pose, object::Part, passage::Passage};
use nalgebra::{Point3, Unit, Vector3};
use std::collections::BTreeSet;

/// Edge of a cell (m).
pub const CELL: f64 = 0.01;
/// Lines are cast so many to a cell's edge.
const LINES: f64 = 2.0;

type Cell = [i32; 3];

/// The cells of one part's surface, and those that were touched.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Coverage {
    surface: BTreeSet<Cell>,
    touched: BTreeSet<Cell>,
}

fn cell(point: &Vector3<f64>) -> Cell {
    <[f64; 3]>::from(*point).map(|x| (x / CELL).floor() as i32)
}

impl Coverage {
    /// The surface of `part`, nothing touched: the ends of what lines along the axes pass through.
    pub fn of(part: &Part) -> Self {
        let mut surface = BTreeSet::new();
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for solid in &part.solids {
            for axis in 0..3 {
                let direction = solid.carrier_from_solid.inverse_transform_vector(&Vector3::ith(axis, 1.0));
                let middle = solid.carrier_from_solid.translation.vector[axis];
                low[axis] = low[axis].min(middle - solid.shape.extent_along(&-direction));
                high[axis] = high[axis].max(middle + solid.shape.extent_along(&direction));
            }
        }
        let step = CELL / LINES;
        for axis in 0..3 {
            let (second, third) = ((axis + 1) % 3, (axis + 2) % 3);
            let lines = |axis: usize| ((high[axis] - low[axis]) / step).ceil().min(MOST_LINES) as usize;
            let direction = Unit::new_unchecked(Vector3::ith(axis, 1.0));
            for (i, j) in (0..lines(second)).flat_map(|i| (0..lines(third)).map(move |j| (i, j))) {
                let mut origin = low;
                origin[second] += (i as f64 + 0.5) * step;
                origin[third] += (j as f64 + 0.5) * step;
                let origin = Point3::from(origin);
                let passages = part.solids.iter().filter_map(|solid| solid.passage(&Pose::identity(), &origin, &direction));
                for along in ends(passages.collect()) {
                    surface.insert(cell(&(origin.coords + direction.as_ref() * along)));
                }
            }
        }
        Self { surface, touched: BTreeSet::new() }
    }

    /// Counts a touch (part frame, m): its cell, or a neighbour's that the surface passes through.
    pub fn touch(&mut self, point: &Point3<f64>) {
        let own = cell(&point.coords);
        let around = (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| [x, y, z])));
        let neighbours = around.map(|[x, y, z]| [own[0] + x, own[1] + y, own[2] + z]);
        let distance = |cell: &Cell| (Vector3::from(cell.map(f64::from)).add_scalar(0.5) * CELL - point.coords).norm();
        // The point's own cell has its middle nearest of all.
        let known = neighbours.filter(|cell| self.surface.contains(cell));
        let nearest = known.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        self.touched.extend(nearest);
    }

    /// Cells of the surface.
    pub fn cells(&self) -> usize {
        self.surface.len()
    }

    /// Cells that were touched.
    pub fn touched(&self) -> usize {
        self.touched.len()
    }
}

/// The most lines along one direction: objects of many metres get a coarser look.
const MOST_LINES: f64 = 400.0;

/// Where a line enters and leaves matter, passages that overlap taken together.
fn ends(mut passages: Vec<Passage>) -> Vec<f64> {
    passages.sort_by(|a, b| a.along[0].total_cmp(&b.along[0]));
    let mut ends: Vec<[f64; 2]> = Vec::new();
    for [from, to] in passages.into_iter().map(|passage| passage.along) {
        match ends.last_mut() {
            Some(last) if from <= last[1] => last[1] = last[1].max(to),
            _ => ends.push([from, to]),
        }
    }
    ends.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{Shape, Solid};

    #[test]
    fn a_block_is_covered_face_by_face_and_seams_inside_do_not_count() {
        // 4 x 4 x 4 cells off the grid by half a cell; two halves that overlap.
        let half = |x: f64| Solid {
            shape: Shape::Box { half_extents: [0.0125, 0.02, 0.02] },
            carrier_from_solid: Pose::translation(x, 0.001, 0.001),
            color: [0.5; 3],
        };
        let part = Part { name: "block".to_owned(), solids: vec![half(-0.0065), half(0.0085)], mass: 1.0 };
        let mut coverage = Coverage::of(&part);
        let inside = (-1..=0).flat_map(|x| (-1..=0).flat_map(move |y| (-1..=0).map(move |z| [x, y, z])));
        assert!(inside.into_iter().all(|cell| !coverage.surface.contains(&cell)), "nothing inside");
        assert_eq!(coverage.touched(), 0);
        let all: Vec<Cell> = coverage.surface.iter().copied().collect();
        coverage.touch(&Point3::new(0.0, 0.021, 0.0));
        assert_eq!(coverage.touched(), 1);
        coverage.touch(&Point3::new(0.0, 0.0209, 0.0005));
        assert_eq!(coverage.touched(), 1, "the same cell");
        coverage.touch(&Point3::new(1.0, 0.0, 0.0));
        assert_eq!(coverage.touched(), 1, "nowhere near");
        for cell in all {
            coverage.touch(&Point3::from((Vector3::from(cell.map(f64::from)).add_scalar(0.5)) * CELL));
        }
        assert_eq!(coverage.touched(), coverage.cells());
    }
}
