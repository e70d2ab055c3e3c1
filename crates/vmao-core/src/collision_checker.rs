//! A [`CollisionWorld`] prepared for many queries: single configurations here, whole motions in `swept`.

use crate::{
    collision::{ArmCollisionModel, Collider, CollisionPair, CollisionWorld, LinkSolid},
    distance::{Convex, Nearness},
    geometry::Pose,
    swept::{Reaches, Sweep},
};
use nalgebra::{Matrix3, Vector3};

/// Stands for the floor where a pair names its second solid.
pub(crate) const FLOOR: u32 = u32::MAX;

/// A [`CollisionWorld`] prepared for many queries: solids as convex sets, the pairs to compare listed once.
#[derive(Debug, Clone)]
pub struct CollisionChecker<'a> {
    world: &'a CollisionWorld,
    arms: Vec<Arm>,
    /// Solids in their link's frame, then the obstacles in the world.
    local: Vec<(Collider, Convex)>,
    /// The same solids in the world at the last query.
    placed: Vec<Convex>,
    /// Their centres, close together for the first rejection.
    centers: Vec<Vector3<f64>>,
    pub(crate) pairs: Vec<Pair>,
    /// Everything below is solid (m).
    floor: f64,
    /// The angles of the last query: arms that have not moved since are not placed again.
    posed: Vec<f64>,
    /// Rotation and origin in the world of the base and of every link of the arm placed last.
    links: Vec<(Matrix3<f64>, Vector3<f64>)>,
    pub(crate) sweep: Sweep,
}

/// Two solids to compare, by index, and the sum of the radii of the balls around them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pair {
    pub(crate) first: u32,
    /// Another solid, or [`FLOOR`].
    pub(crate) second: u32,
    reach: f64,
}

/// The fixed transforms of an arm's kinematics and where its joints and solids are in the flat lists.
#[derive(Debug, Clone)]
struct Arm {
    base: (Matrix3<f64>, Vector3<f64>),
    parent_from_joints: Vec<(Matrix3<f64>, Vector3<f64>)>,
    first_joint: usize,
    first_slot: usize,
    /// The link that each of its solids rides on.
    carriers: Vec<usize>,
}

impl<'a> CollisionChecker<'a> {
    /// Prepares `world` with every arm able to move.
    pub fn new(world: &'a CollisionWorld) -> Self {
        Self::with_frozen(world, &[])
    }

    /// Prepares `world` with the arms `frozen` at rest: pairs of which neither side can move are not compared.
    ///
    /// So arms at rest may stay in the contact they have, such as two grippers on one object.
    pub fn with_frozen(world: &'a CollisionWorld, frozen: &[usize]) -> Self {
        let (mut local, mut arms, mut first_joint) = (Vec::new(), Vec::new(), 0);
        for (index, model) in world.arms.iter().enumerate() {
            let first_slot = local.len();
            for LinkSolid { link, solid } in &model.solids {
                local.push((Collider::Link { arm: index, link: *link }, Convex::new(&solid.shape, &solid.carrier_from_solid)));
            }
            for solid in world.attached.get(index).into_iter().flatten() {
                local.push((Collider::Held { arm: index }, Convex::new(&solid.shape, &solid.carrier_from_solid)));
            }
            let carrier = |&(collider, _): &(Collider, Convex)| match collider {
                Collider::Link { link, .. } => link.min(model.chain.len()),
                _ => model.chain.len(),
            };
            let carriers = local[first_slot..].iter().map(carrier).collect();
            arms.push(Arm::new(model, first_joint, first_slot, carriers));
            first_joint += model.chain.len();
        }
        for (index, obstacle) in world.obstacles.iter().enumerate() {
            let convex = Convex::new(&obstacle.solid.shape, &obstacle.solid.carrier_from_solid);
            local.push((Collider::Obstacle(index), convex));
        }
        let pairs = pairs(world, &local, frozen);
        let placed = local.iter().map(|&(_, convex)| convex).collect();
        let centers = local.iter().map(|(_, convex)| *convex.center()).collect();
        let reaches = arms.iter().map(|arm| {
            let solids = local[arm.first_slot..].iter().zip(&arm.carriers).map(|(&(_, convex), &link)| (link, convex));
            Reaches::new(&arm.parent_from_joints, arm.first_joint, arm.first_slot, solids)
        });
        let sweep = Sweep::new(reaches.collect(), local.len(), &pairs, frozen);
        let floor = world.floor_height.unwrap_or(f64::NEG_INFINITY);
        let posed = vec![f64::NAN; world.joint_count()];
        Self { world, arms, local, placed, centers, pairs, floor, posed, links: Vec::new(), sweep }
    }

    /// The first pair closer than `margin` (m) at the angles `q` (flat, arm after arm), `None` if all are clear.
    pub fn check(&mut self, q: &[f64], margin: f64) -> Option<CollisionPair> {
        self.place(q);
        let pair = (0..self.pairs.len()).find(|&pair| self.nearness(pair, margin, margin) == Nearness::Hit)?;
        Some(self.describe(pair))
    }

    /// Whether no pair is closer than `margin` (m) at the angles `q`.
    pub fn is_free(&mut self, q: &[f64], margin: f64) -> bool {
        self.place(q);
        (0..self.pairs.len()).all(|pair| self.nearness(pair, margin, margin) != Nearness::Hit)
    }

    /// The least signed distance over all compared pairs (m) at the angles `q`, +∞ if there is no pair.
    pub fn clearance(&mut self, q: &[f64]) -> f64 {
        self.place(q);
        let mut least = f64::INFINITY;
        for pair in &self.pairs {
            if self.gap_of_balls(pair) < least {
                least = least.min(self.distance(pair));
            }
        }
        least
    }

    /// The pair with its names and its signed distance as placed now.
    pub(crate) fn describe(&self, pair: usize) -> CollisionPair {
        let Pair { first, second, .. } = self.pairs[pair];
        let of = |solid: u32| if solid == FLOOR { Collider::Floor } else { self.local[solid as usize].0 };
        let (first, second) = (of(first), of(second));
        let names = [self.world.name(first), self.world.name(second)];
        CollisionPair { first, second, names, distance: self.distance(&self.pairs[pair]) }
    }

    /// Whether a pair, as placed now, is closer than `margin`, and if not, whether it is at least `enough` apart (m).
    pub(crate) fn nearness(&self, pair: usize, margin: f64, enough: f64) -> Nearness {
        let pair = &self.pairs[pair];
        let (i, j, enough) = (pair.first as usize, pair.second as usize, enough.max(margin));
        if pair.second == FLOOR {
            if self.centers[i].z - pair.reach - self.floor >= enough {
                return Nearness::Clear;
            }
            return match self.placed[i].height_above(self.floor) {
                height if height >= enough => Nearness::Clear,
                height if height < margin => Nearness::Hit,
                _ => Nearness::Near,
            };
        }
        let far = pair.reach + enough;
        if far <= 0.0 || (self.centers[i] - self.centers[j]).norm_squared() >= far * far {
            return Nearness::Clear;
        }
        let (a, b) = (&self.placed[i], &self.placed[j]);
        if margin <= 0.0 {
            // the depth decides, which a gap does not tell
            return match () {
                () if a.closer_than(b, margin) => Nearness::Hit,
                () if a.closer_than(b, enough) => Nearness::Near,
                () => Nearness::Clear,
            };
        }
        a.nearness(b, margin, enough)
    }

    fn gap_of_balls(&self, pair: &Pair) -> f64 {
        let center = &self.centers[pair.first as usize];
        if pair.second == FLOOR {
            return center.z - self.floor - pair.reach;
        }
        (center - self.centers[pair.second as usize]).norm() - pair.reach
    }

    fn distance(&self, pair: &Pair) -> f64 {
        let first = &self.placed[pair.first as usize];
        if pair.second == FLOOR {
            return first.height_above(self.floor);
        }
        first.signed_distance(&self.placed[pair.second as usize])
    }

    /// Puts every solid of every arm where `q` has it.
    pub(crate) fn place(&mut self, q: &[f64]) {
        assert_eq!(q.len(), self.posed.len(), "one angle per joint of all arms");
        for arm in &self.arms {
            let joints = arm.first_joint..arm.first_joint + arm.parent_from_joints.len();
            if !joints.is_empty() && q[joints.clone()] == self.posed[joints.clone()] {
                continue;
            }
            arm.links(&q[joints], &mut self.links);
            for (slot, &link) in (arm.first_slot..).zip(&arm.carriers) {
                let (rotation, origin) = &self.links[link];
                self.placed[slot].place(&self.local[slot].1, rotation, origin);
                self.centers[slot] = *self.placed[slot].center();
            }
        }
        self.posed.copy_from_slice(q);
    }
}

impl Arm {
    fn new(model: &ArmCollisionModel, first_joint: usize, first_slot: usize, carriers: Vec<usize>) -> Self {
        let split = |pose: &Pose| (*pose.rotation.to_rotation_matrix().matrix(), pose.translation.vector);
        let parent_from_joints = model.chain.joints.iter().map(|joint| split(&joint.parent_from_joint)).collect();
        Self { base: split(&model.world_from_base), parent_from_joints, first_joint, first_slot, carriers }
    }

    /// Rotation and origin in the world of the base and of every link.
    fn links(&self, q: &[f64], links: &mut Vec<(Matrix3<f64>, Vector3<f64>)>) {
        links.clear();
        let (mut rotation, mut origin) = self.base;
        links.push((rotation, origin));
        for ((turn, shift), angle) in self.parent_from_joints.iter().zip(q) {
            origin += rotation * shift;
            let before = rotation * turn;
            let (sine, cosine) = angle.sin_cos();
            let (x, y) = (before.column(0), before.column(1));
            rotation = Matrix3::from_columns(&[x * cosine + y * sine, y * cosine - x * sine, before.column(2).into_owned()]);
            links.push((rotation, origin));
        }
    }
}

/// All pairs that can collide, at least one side of which moves.
fn pairs(world: &CollisionWorld, local: &[(Collider, Convex)], frozen: &[usize]) -> Vec<Pair> {
    let moves = |collider: Collider| match collider {
        Collider::Link { arm, link } => link > 0 && !frozen.contains(&arm),
        Collider::Held { arm } => !frozen.contains(&arm),
        Collider::Obstacle(_) | Collider::Floor => false,
    };
    let mut pairs = Vec::new();
    for (i, &(first, convex)) in local.iter().enumerate() {
        if world.floor_height.is_some() && world.compares(first, Collider::Floor) && moves(first) {
            pairs.push(Pair { first: i as u32, second: FLOOR, reach: convex.bound() });
        }
        for (j, &(second, other)) in local.iter().enumerate().skip(i + 1) {
            if world.compares(first, second) && (moves(first) || moves(second)) {
                pairs.push(Pair { first: i as u32, second: j as u32, reach: convex.bound() + other.bound() });
            }
        }
    }
    pairs
}
