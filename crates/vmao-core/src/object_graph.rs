//! The object graph: parts are nodes, joints are edges, and together they form one tree (supplement, appendix A).

use crate::{contact::PartId, object::ArticulatedObject};
use std::collections::VecDeque;
use thiserror::Error;

/// What keeps a set of joints from being one tree over the parts. Joints and parts are given by index.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GraphError {
    /// There is nothing to move.
    #[error("the object has no parts, expected at least one")]
    NoParts,
    /// More parts than a [`PartId`] can name.
    #[error("the object has {count} parts, expected at most {}", MAX_PARTS)]
    TooManyParts {
        /// Number of parts.
        count: usize,
    },
    /// A joint names a part that is not there.
    #[error("joint {joint} connects part {}, but parts are numbered 0 to {}", part.0, count - 1)]
    UnknownPart {
        /// The joint.
        joint: usize,
        /// The part it names.
        part: PartId,
        /// Number of parts.
        count: usize,
    },
    /// A joint connects a part to itself.
    #[error("joint {joint} connects part {} to itself, expected two parts", part.0)]
    SelfJoint {
        /// The joint.
        joint: usize,
        /// The part.
        part: PartId,
    },
    /// A joint closes a loop.
    #[error("joints {joints:?} form a cycle through parts {parts:?}, expected a tree")]
    Cycle {
        /// The joints of the loop, in walking order; the last one closes it.
        joints: Vec<usize>,
        /// The parts of the loop, in walking order from the closing joint's child to its parent.
        parts: Vec<PartId>,
    },
    /// Some parts cannot be reached from the first one.
    #[error("parts {unreached:?} are not connected to part 0 by joints, expected one tree")]
    Disconnected {
        /// The parts that no chain of joints connects to part 0.
        unreached: Vec<PartId>,
    },
}

/// The largest number of parts an object may have.
pub const MAX_PARTS: usize = u16::MAX as usize;

/// Whether an edge is walked as the joint defines it, or against it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From the joint's parent to its child: the joint's motion applies as it is.
    ParentToChild,
    /// From the joint's child to its parent: the joint's motion applies inverted.
    ChildToParent,
}

impl Direction {
    /// The factor on the joint's displacement: +1 from parent to child, −1 from child to parent.
    pub fn sign(self) -> f64 {
        match self {
            Self::ParentToChild => 1.0,
            Self::ChildToParent => -1.0,
        }
    }
}

/// One edge of the dependency graph: the motion of `to` depends on the motion of `from`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// Index of the joint that is walked.
    pub joint: usize,
    /// The part already placed.
    pub from: PartId,
    /// The part placed by this step.
    pub to: PartId,
    /// How the joint is walked.
    pub direction: Direction,
}

/// A tree of parts and joints.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObjectGraph {
    /// For every part: the steps that leave it, in joint order.
    neighbours: Vec<Vec<Step>>,
}

impl ObjectGraph {
    /// The graph of `part_count` parts and one (parent, child) edge for each joint; fails unless it is one tree.
    pub fn new(part_count: usize, edges: &[(PartId, PartId)]) -> Result<Self, GraphError> {
        if part_count == 0 {
            return Err(GraphError::NoParts);
        }
        if part_count > MAX_PARTS {
            return Err(GraphError::TooManyParts { count: part_count });
        }
        let mut graph = Self { neighbours: vec![Vec::new(); part_count] };
        let mut components = Components((0..part_count).collect());
        for (joint, &(parent, child)) in edges.iter().enumerate() {
            for part in [parent, child] {
                if usize::from(part.0) >= part_count {
                    return Err(GraphError::UnknownPart { joint, part, count: part_count });
                }
            }
            if parent == child {
                return Err(GraphError::SelfJoint { joint, part: parent });
            }
            if !components.join(usize::from(parent.0), usize::from(child.0)) {
                return Err(graph.cycle(joint, parent, child));
            }
            let down = Step { joint, from: parent, to: child, direction: Direction::ParentToChild };
            let up = Step { joint, from: child, to: parent, direction: Direction::ChildToParent };
            graph.neighbours[usize::from(parent.0)].push(down);
            graph.neighbours[usize::from(child.0)].push(up);
        }
        let first = components.find(0);
        let unreached: Vec<PartId> =
            (0..part_count).filter(|&part| components.find(part) != first).map(|part| PartId(part as u16)).collect();
        if unreached.is_empty() { Ok(graph) } else { Err(GraphError::Disconnected { unreached }) }
    }

    /// The graph of an object; fails unless its joints form one tree over its parts.
    pub fn of(object: &ArticulatedObject) -> Result<Self, GraphError> {
        let edges: Vec<_> = object.joints.iter().map(|joint| (joint.parent, joint.child)).collect();
        Self::new(object.parts.len(), &edges)
    }

    /// Number of parts.
    pub fn part_count(&self) -> usize {
        self.neighbours.len()
    }

    /// The dependency order from `root`: each part but the root is reached once, from a part placed before it.
    ///
    /// Breadth first, neighbours in joint order. Panics if the graph has no part `root`.
    pub fn outward(&self, root: PartId) -> Vec<Step> {
        assert!(usize::from(root.0) < self.part_count(), "part {} of {}", root.0, self.part_count());
        let mut reached = vec![false; self.part_count()];
        reached[usize::from(root.0)] = true;
        let mut steps = Vec::with_capacity(self.part_count() - 1);
        let mut queue = VecDeque::from([root]);
        while let Some(part) = queue.pop_front() {
            for &step in &self.neighbours[usize::from(part.0)] {
                let to = usize::from(step.to.0);
                if !reached[to] {
                    reached[to] = true;
                    steps.push(step);
                    queue.push_back(step.to);
                }
            }
        }
        steps
    }

    /// The loop that `joint` would close: the walk from its child to its parent through the joints present, then itself.
    fn cycle(&self, joint: usize, parent: PartId, child: PartId) -> GraphError {
        let mut arrivals: Vec<Option<Step>> = vec![None; self.part_count()];
        for step in self.outward(parent) {
            arrivals[usize::from(step.to.0)] = Some(step);
        }
        let (mut joints, mut parts, mut part) = (Vec::new(), vec![child], child);
        while let Some(step) = arrivals[usize::from(part.0)] {
            joints.push(step.joint);
            parts.push(step.from);
            part = step.from;
        }
        joints.push(joint);
        GraphError::Cycle { joints, parts }
    }
}

/// Disjoint sets of parts, each named by one of its members.
struct Components(Vec<usize>);

impl Components {
    fn find(&mut self, mut part: usize) -> usize {
        while self.0[part] != part {
            self.0[part] = self.0[self.0[part]];
            part = self.0[part];
        }
        part
    }

    /// Unites two sets; false if they were one already.
    fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a] = b;
        a != b
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edges(pairs: &[(u16, u16)]) -> Vec<(PartId, PartId)> {
        pairs.iter().map(|&(parent, child)| (PartId(parent), PartId(child))).collect()
    }

    #[test]
    fn every_root_reaches_every_part_once_from_a_part_placed_before() {
        let joints = edges(&[(1, 0), (1, 2), (4, 2), (2, 3), (5, 3)]);
        let graph = ObjectGraph::new(6, &joints).unwrap();
        for root in 0..6 {
            let steps = graph.outward(PartId(root));
            let mut placed = vec![PartId(root)];
            for step in &steps {
                assert!(placed.contains(&step.from) && !placed.contains(&step.to), "{root}: {steps:?}");
                let walked = match step.direction {
                    Direction::ParentToChild => (step.from, step.to),
                    Direction::ChildToParent => (step.to, step.from),
                };
                assert_eq!(walked, joints[step.joint]);
                placed.push(step.to);
            }
            assert_eq!(placed.len(), 6);
        }
    }

    #[test]
    fn a_lone_part_is_a_tree_without_steps() {
        assert_eq!(ObjectGraph::new(1, &[]).unwrap().outward(PartId(0)), vec![]);
    }

    #[test]
    fn a_loop_is_refused_with_its_joints_and_parts_in_walking_order() {
        let error = ObjectGraph::new(5, &edges(&[(0, 1), (1, 2), (3, 4), (2, 3), (3, 0)])).unwrap_err();
        let parts = [0, 1, 2, 3].map(PartId).to_vec();
        assert_eq!(error, GraphError::Cycle { joints: vec![0, 1, 3, 4], parts });
    }

    #[test]
    fn two_joints_between_the_same_parts_are_a_loop() {
        let error = ObjectGraph::new(2, &edges(&[(0, 1), (1, 0)])).unwrap_err();
        assert_eq!(error, GraphError::Cycle { joints: vec![0, 1], parts: vec![PartId(0), PartId(1)] });
    }

    #[test]
    fn what_is_not_a_tree_is_refused_by_name() {
        let refused = |count, pairs: &[(u16, u16)]| ObjectGraph::new(count, &edges(pairs)).unwrap_err();
        assert_eq!(refused(0, &[]), GraphError::NoParts);
        assert_eq!(refused(70_000, &[]), GraphError::TooManyParts { count: 70_000 });
        assert_eq!(refused(2, &[(0, 2)]), GraphError::UnknownPart { joint: 0, part: PartId(2), count: 2 });
        assert_eq!(refused(2, &[(1, 1)]), GraphError::SelfJoint { joint: 0, part: PartId(1) });
        assert_eq!(refused(4, &[(0, 2)]), GraphError::Disconnected { unreached: vec![PartId(1), PartId(3)] });
    }

    #[test]
    fn the_longest_chain_is_walked_without_recursion() {
        let joints: Vec<_> = (1..MAX_PARTS as u16).map(|child| (PartId(child - 1), PartId(child))).collect();
        assert_eq!(ObjectGraph::new(MAX_PARTS, &joints).unwrap().outward(PartId(0)).len(), MAX_PARTS - 1);
    }
}
