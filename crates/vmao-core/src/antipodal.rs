//! Demonstrations for objects that come without: where a parallel gripper can hold each part, from its shape alone.
//!
//! Pairs of opposite surface points are drawn at random, judged by how flat and how free their surroundings are, and the
//! best, spread over each part, become contact tuples. `docs/demonstrations.md` says how well that works.

use crate::{
    catalogue::widths_held,
    contact::{Contact, ContactTuple, PartId},
    distance::Convex,
    geometry::Pose,
    gripper_pose::gripper_poses,
    object::{ArticulatedObject, JointKind},
    object_centric::part_poses,
    object_graph::ObjectGraph,
    passage::stretch_through,
    random::Stream,
    robots::RobotModel,
    shape::Solid,
};
use nalgebra::{Point3, Unit, Vector3, center};

/// Names the streams of this module: the same object always gets the same demonstrations.
const STREAM: u64 = 0x616e_7469;
/// Point pairs drawn on each part.
const DRAWS: usize = 1500;
/// Best candidates of each part whose hands are looked at.
const LOOKED_AT: usize = 60;
/// Surfaces may lean against the closing axis by this much (rad): well inside the friction cone of pads on anything.
const LEAN: f64 = 0.26;
/// Pads need surface this far around a contact (m), flat to within [`FLAT`] (m).
const PAD: f64 = 0.006;
const FLAT: f64 = 0.0015;
/// Where other parts are at least this far from a contact it is free enough (m).
const FREE: f64 = 0.06;
/// Contacts of one part are this far apart (m), as long as there are others.
const SPREAD: f64 = 0.008;
/// Hands at one time shall be this far apart (m).
const APART: f64 = 0.15;
/// Shares of the joints' ranges at which hands must fit.
const SHARES: [f64; 3] = [0.1, 0.5, 0.9];
/// Approaches looked at, and the steepest lean from straight down of a hand that need not fit (rad).
const APPROACHES: usize = 16;
const STEEPEST: f64 = 1.3;
/// How far open the pads come, over the width (m), and how far they may be raised off the table (m).
const MARGIN: f64 = 0.01;
const RAISED: [f64; 2] = [0.0, 0.006];

/// A way to hold a part.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    contact: Contact,
    /// Higher is better.
    score: f64,
}

/// The object on the table in one configuration.
struct Posed {
    world_from_parts: Vec<Pose>,
    solids: Vec<(usize, Convex)>,
    table: f64,
}

/// At most `count` ways to hold every part of `object` with grippers of `robots`; none if some part cannot be held.
pub fn demonstrations(object: &ArticulatedObject, robots: &[RobotModel], count: usize) -> Vec<ContactTuple> {
    let Ok(graph) = ObjectGraph::of(object) else { return Vec::new() };
    let configurations: Vec<Posed> = SHARES.iter().map(|&share| Posed::new(object, &graph, share)).collect();
    let grips: Vec<Vec<Candidate>> =
        (0..object.parts.len()).map(|part| candidates(object, part, robots, &configurations)).collect();
    if grips.iter().any(Vec::is_empty) {
        return Vec::new();
    }
    (0..count).map(|tuple| combined(&grips, tuple, &configurations)).collect()
}

impl Posed {
    fn new(object: &ArticulatedObject, graph: &ObjectGraph, share: f64) -> Self {
        let position = |kind: JointKind, limits: Option<[f64; 2]>| match kind {
            JointKind::Ball => vec![0.0; 3],
            JointKind::Revolute | JointKind::Prismatic | JointKind::Fixed => {
                vec![limits.map_or(0.0, |[low, high]| low + share * (high - low))]
            }
        };
        let joints: Vec<f64> = object.joints.iter().flat_map(|joint| position(joint.kind, joint.limits)).collect();
        let world_from_parts = part_poses(object, graph, PartId(0), &Pose::identity(), &joints);
        let mut solids = Vec::new();
        let mut table = f64::INFINITY;
        for (part, (description, pose)) in object.parts.iter().zip(&world_from_parts).enumerate() {
            for solid in &description.solids {
                solids.push((part, Convex::new(&solid.shape, &(pose * solid.carrier_from_solid))));
                table = table.min(solid.lowest_point(pose));
            }
        }
        Self { world_from_parts, solids, table }
    }

    /// Distance of a point of `part` from the other parts (m).
    fn clearance(&self, part: usize, point: &Point3<f64>) -> f64 {
        let dot = crate::shape::Shape::Sphere { radius: 0.0 };
        let at = self.world_from_parts[part] * point;
        let dot = Convex::new(&dot, &Pose::translation(at.x, at.y, at.z));
        let others = self.solids.iter().filter(|(owner, _)| *owner != part);
        others.map(|(_, solid)| solid.signed_distance(&dot)).fold(f64::INFINITY, f64::min)
    }

    /// Whether some hand from above fits at the contact without touching the object or the table.
    fn hand_fits(&self, robot: &RobotModel, contact: &Contact) -> bool {
        let world_from_part = &self.world_from_parts[usize::from(contact.part.0)];
        let fingers = contact.fingers.map(|finger| world_from_part * finger);
        let (hand, pads) = robot.gripper_solids(contact.width() + MARGIN);
        let tool_from_last = (robot.gripper.last_from_hand * robot.gripper.hand_from_tool).inverse();
        let free = |world_from_tool: Pose| {
            let world_from_last = world_from_tool * tool_from_last;
            let clear = |solid: &Solid| {
                let solid = Convex::new(&solid.shape, &(world_from_last * solid.carrier_from_solid));
                solid.height_above(self.table) > 0.0 && self.solids.iter().all(|(_, other)| !solid.closer_than(other, 0.0))
            };
            pads.iter().chain(&hand).all(clear)
        };
        let poses = gripper_poses(&fingers, APPROACHES);
        // Both fingerings of a symmetric hand take the same room.
        let steep = poses.iter().step_by(2).filter(|pose| pose.approach_angle.abs() < STEEPEST);
        steep.into_iter().any(|pose| RAISED.iter().any(|&raised| free(pose.backed_off(raised))))
    }
}

/// The best ways to hold one part, spread over it, the best first; none if there is none.
fn candidates(object: &ArticulatedObject, part: usize, robots: &[RobotModel], configurations: &[Posed]) -> Vec<Candidate> {
    let solids = &object.parts[part].solids;
    let widths = robots.iter().map(|robot| widths_held(&robot.gripper));
    let [least, greatest] = widths.fold([0.0_f64, f64::INFINITY], |all, one| [all[0].max(one[0]), all[1].min(one[1])]);
    let mut stream = Stream::new(STREAM, &[part as u64]);
    let mut found: Vec<Candidate> = Vec::new();
    for _ in 0..DRAWS {
        let Some(contact) = drawn(solids, part, &mut stream) else { continue };
        if (least..=greatest).contains(&contact.width()) {
            let score = score(solids, &contact, configurations);
            found.push(Candidate { contact, score });
        }
    }
    // Near the middle of all that can be held, the part turns the least in the pads.
    let middle =
        found.iter().map(|candidate| middle(&candidate.contact).coords).sum::<Vector3<f64>>() / found.len().max(1) as f64;
    let size = found.iter().map(|candidate| (candidate_middle(candidate) - middle).norm()).fold(1e-3, f64::max);
    for candidate in &mut found {
        candidate.score -= 0.5 * (candidate_middle(candidate) - middle).norm() / size;
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    let fits = |candidate: &&Candidate| {
        let fit = |posed: &Posed| robots.iter().all(|robot| posed.hand_fits(robot, &candidate.contact));
        configurations.iter().filter(|posed| fit(posed)).count() * 2 > configurations.len()
    };
    let fitting: Vec<Candidate> = found.iter().take(LOOKED_AT).filter(fits).copied().collect();
    spread(if fitting.is_empty() { &found } else { &fitting })
}

fn candidate_middle(candidate: &Candidate) -> Vector3<f64> {
    middle(&candidate.contact).coords
}

fn middle(contact: &Contact) -> Point3<f64> {
    center(&contact.fingers[0], &contact.fingers[1])
}

/// Opposite points of the part on a random line through a random point of a random solid.
fn drawn(solids: &[Solid], part: usize, stream: &mut Stream) -> Option<Contact> {
    let weights: Vec<f64> = solids.iter().map(|solid| solid.shape.volume().cbrt()).collect();
    let solid = &solids[stream.weighted(&weights)];
    // Lines along the solid's own axes are square to the faces of blocks; others serve all other shapes.
    let own = stream.unit() < 0.6;
    let direction = if own {
        solid.carrier_from_solid.rotation * Vector3::ith(stream.index(3), 1.0)
    } else {
        Vector3::new(stream.normal(), stream.normal(), stream.normal())
    };
    let direction = Unit::try_new(direction, 1e-9)?;
    let extent = |axis: Vector3<f64>| [-solid.shape.extent_along(&-axis), solid.shape.extent_along(&axis)];
    let within = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
        let [low, high] = extent(axis);
        stream.range(low, high)
    });
    let origin = solid.carrier_from_solid * Point3::from(within);
    let stretch = stretch_through(solids, &origin, &direction)?;
    let opposed =
        stretch.normals[0].dot(&-direction.into_inner()) > LEAN.cos() && stretch.normals[1].dot(&direction) > LEAN.cos();
    // One sense for all pairs of a part, so that the fingers' means are apart.
    let sense = direction.x + 0.5 * direction.y + 0.25 * direction.z > 0.0;
    let [near, far] = stretch.along.map(|along| origin + direction.as_ref() * along);
    opposed.then_some(Contact { part: PartId(part as u16), fingers: if sense { [far, near] } else { [near, far] } })
}

/// How good a contact is: flat pads' surroundings, room to other parts, a level closing axis.
fn score(solids: &[Solid], contact: &Contact, configurations: &[Posed]) -> f64 {
    let width = contact.width();
    let middle = middle(contact);
    let closing = Unit::new_normalize(contact.fingers[0] - contact.fingers[1]);
    let aside = closing.cross(&Vector3::ith(closing.iamin(), 1.0)).normalize();
    let up = closing.cross(&aside);
    let flat = |offset: Vector3<f64>| {
        let passage = stretch_through(solids, &(middle + offset), &closing);
        passage.is_some_and(|passage| passage.along.iter().all(|along| (along.abs() - width / 2.0).abs() < FLAT))
    };
    let probes = [aside, -aside, up, -up, (aside + up) * 0.7, (aside - up) * 0.7, (up - aside) * 0.7, -(aside + up) * 0.7];
    let support = probes.iter().filter(|probe| flat(*probe * PAD)).count() as f64 / probes.len() as f64;
    let (mut clear, mut level) = (0.0, 0.0);
    for posed in configurations {
        clear += posed.clearance(usize::from(contact.part.0), &middle).min(FREE) / FREE;
        level += 1.0 - (posed.world_from_parts[usize::from(contact.part.0)].rotation * closing.into_inner()).z.abs();
    }
    let count = configurations.len() as f64;
    2.0 * support + clear / count + 1.5 * level / count
}

/// The best, then the best of those far enough from all before.
fn spread(sorted: &[Candidate]) -> Vec<Candidate> {
    const MOST: usize = 8;
    let mut chosen: Vec<Candidate> = Vec::new();
    for candidate in sorted {
        let near = |other: &Candidate| (candidate_middle(candidate) - candidate_middle(other)).norm() < SPREAD;
        if chosen.len() < MOST && !chosen.iter().any(near) {
            chosen.push(*candidate);
        }
    }
    chosen
}

/// The `tuple`-th combination: each part in turn takes a grip that leaves the hands before it room.
fn combined(grips: &[Vec<Candidate>], tuple: usize, configurations: &[Posed]) -> ContactTuple {
    let mut contacts = ContactTuple::new();
    for (part, choices) in grips.iter().enumerate() {
        let place = |posed: &Posed, contact: &Contact| posed.world_from_parts[usize::from(contact.part.0)] * middle(contact);
        let room = |candidate: &Candidate| {
            let apart = |posed: &Posed| {
                let here = place(posed, &candidate.contact);
                contacts.iter().map(|other| (place(posed, other) - here).norm()).fold(APART, f64::min)
            };
            configurations.iter().map(apart).sum::<f64>() / (APART * configurations.len() as f64)
        };
        // Every grip gets its turn; among the next three the one with the most room.
        let first = 3 * tuple + 5 * part;
        let turn = (0..3.min(choices.len())).map(|step| &choices[(first + step) % choices.len()]);
        let best = turn.max_by(|a, b| (room(a) + 0.2 * a.score).total_cmp(&(room(b) + 0.2 * b.score)));
        contacts.extend(best.map(|candidate| candidate.contact));
    }
    contacts
}
