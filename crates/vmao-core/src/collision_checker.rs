//! A [`CollisionWorld`] prepared for many queries: single configurations here, whole motions in `swept`.

use crate::{
    collision::{ArmCollisionModel, Collider, CollisionPair, CollisionWorld, LinkSolid},
    distance::{Convex, Nearness},
    geometry::Pose,
    shape::Shape,
    swept::{Reaches, Sweep},
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::ops::Range;

/// Stands where a ball around several solids is no solid itself.
const NO_SOLID: u32 = u32::MAX;
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
    /// The pairs of solids, bunch after bunch, then the pairs of the bunches.
    pub(crate) pairs: Vec<Pair>,
    pub(crate) bunches: Vec<Bunch>,
    /// Everything below is solid (m).
    floor: f64,
    /// The angles of the last query: arms that have not moved since are not placed again.
    posed: Vec<f64>,
    /// The arm and the link that each solid rides on; obstacles have none.
    carriers: Vec<Option<(usize, usize)>>,
    /// For each solid the count of its arm's poses when it was placed.
    placed_at: Vec<u64>,
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

/// Pairs whose solids ride on the same two links: while the balls around the links are apart, so are they.
#[derive(Debug, Clone)]
pub(crate) struct Bunch {
    /// Index of the pair of balls; a link with one solid and an obstacle are their own balls.
    pub(crate) balls: usize,
    /// Indices of the pairs.
    pub(crate) members: Range<usize>,
}

/// The fixed transforms of an arm's kinematics and where its joints and solids are in the flat lists.
#[derive(Debug, Clone)]
struct Arm {
    base: (Matrix3<f64>, Vector3<f64>),
    parent_from_joints: Vec<(Matrix3<f64>, Vector3<f64>)>,
    first_joint: usize,
    /// Rotation and origin in the world of the base and of every link, at the last query.
    links: Vec<(Matrix3<f64>, Vector3<f64>)>,
    /// How many poses it has had.
    poses: u64,
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
        // for every solid the ball of its bunch and what it rides on
        let (mut balls, mut carriers): (Vec<u32>, Vec<Option<(usize, usize)>>) = (Vec::new(), Vec::new());
        let mut reaches = Vec::new();
        for (index, model) in world.arms.iter().enumerate() {
            let first_slot = local.len();
            for LinkSolid { link, solid } in &model.solids {
                local.push((Collider::Link { arm: index, link: *link }, Convex::new(&solid.shape, &solid.carrier_from_solid)));
            }
            for solid in world.attached.get(index).into_iter().flatten() {
                local.push((Collider::Held { arm: index }, Convex::new(&solid.shape, &solid.carrier_from_solid)));
            }
            let solids = local.len();
            balls.extend(first_slot as u32..solids as u32);
            carriers.extend(local[first_slot..].iter().map(|(collider, _)| match *collider {
                Collider::Link { link, .. } => Some((index, link.min(model.chain.len()))),
                _ => Some((index, model.chain.len())),
            }));
            for link in 0..=model.chain.len() {
                let own: Vec<usize> = (first_slot..solids).filter(|&slot| carriers[slot] == Some((index, link))).collect();
                if own.len() > 1 {
                    own.iter().for_each(|&slot| balls[slot] = local.len() as u32);
                    balls.push(NO_SOLID);
                    carriers.push(Some((index, link)));
                    local.push((Collider::Link { arm: index, link }, ball_around(own.iter().map(|&slot| &local[slot].1))));
                }
            }
            let arm = Arm::new(model, first_joint);
            let riders = local[first_slot..].iter().zip(&carriers[first_slot..]);
            let riders = riders.filter_map(|((_, convex), carrier)| Some((carrier.as_ref()?.1, convex)));
            reaches.push(Reaches::new(&arm.parent_from_joints, first_joint, first_slot, riders));
            arms.push(arm);
            first_joint += model.chain.len();
        }
        for (index, obstacle) in world.obstacles.iter().enumerate() {
            let convex = Convex::new(&obstacle.solid.shape, &obstacle.solid.carrier_from_solid);
            balls.push(local.len() as u32);
            carriers.push(None);
            local.push((Collider::Obstacle(index), convex));
        }
        let mut pairs = pairs(world, &local, &balls, frozen);
        let bunches = bunches(&mut pairs, &local, &balls);
        let placed = local.iter().map(|(_, convex)| convex.clone()).collect();
        let centers = local.iter().map(|(_, convex)| *convex.center()).collect();
        let sweep = Sweep::new(reaches, local.len(), &pairs, &bunches, frozen);
        let floor = world.floor_height.unwrap_or(f64::NEG_INFINITY);
        let posed = vec![f64::NAN; world.joint_count()];
        Self {
            world,
            arms,
            local,
            placed,
            centers,
            pairs,
            bunches,
            floor,
            posed,
            placed_at: vec![0; carriers.len()],
            carriers,
            sweep,
        }
    }

    /// The first pair closer than `margin` (m) at the angles `q` (flat, arm after arm), `None` if all are clear.
    pub fn check(&mut self, q: &[f64], margin: f64) -> Option<CollisionPair> {
        self.place(q);
        let pair = self.bunches.iter().find_map(|bunch| self.hit_in(bunch, margin))?;
        Some(self.describe(pair))
    }

    /// Whether no pair is closer than `margin` (m) at the angles `q`.
    pub fn is_free(&mut self, q: &[f64], margin: f64) -> bool {
        self.place(q);
        self.bunches.iter().all(|bunch| self.hit_in(bunch, margin).is_none())
    }

    /// The first pair of a bunch that is closer than `margin` as placed now.
    pub(crate) fn hit_in(&self, bunch: &Bunch, margin: f64) -> Option<usize> {
        if self.is_clear(bunch, margin, margin) {
            return None;
        }
        bunch.members.clone().find(|&pair| self.nearness(pair, margin, margin) == Nearness::Hit)
    }

    /// Whether the balls of a bunch show that all its pairs are at least `enough` apart as placed now.
    pub(crate) fn is_clear(&self, bunch: &Bunch, margin: f64, enough: f64) -> bool {
        bunch.members.len() > 1 && self.nearness(bunch.balls, margin, enough) == Nearness::Clear
    }

    /// The least signed distance over all compared pairs (m) at the angles `q`, +∞ if there is no pair.
    pub fn clearance(&mut self, q: &[f64]) -> f64 {
        self.place(q);
        let mut least = f64::INFINITY;
        for pair in &self.pairs[..self.pairs.len() - self.bunches.len()] {
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
        self.pose(q);
        (0..self.local.len()).for_each(|slot| self.place_solid(slot));
    }

    /// Puts the links where `q` has them; solids follow when they are placed.
    pub(crate) fn pose(&mut self, q: &[f64]) {
        assert_eq!(q.len(), self.posed.len(), "one angle per joint of all arms");
        for arm in &mut self.arms {
            let joints = arm.first_joint..arm.first_joint + arm.parent_from_joints.len();
            if arm.poses == 0 || q[joints.clone()] != self.posed[joints.clone()] {
                arm.pose(&q[joints]);
            }
        }
        self.posed.copy_from_slice(q);
    }

    /// Places a solid where its link is now.
    pub(crate) fn place_solid(&mut self, slot: usize) {
        let Some((arm, link)) = self.carriers[slot] else { return };
        let arm = &self.arms[arm];
        if self.placed_at[slot] != arm.poses {
            let (rotation, origin) = &arm.links[link];
            self.placed[slot].place(&self.local[slot].1, rotation, origin);
            self.centers[slot] = *self.placed[slot].center();
            self.placed_at[slot] = arm.poses;
        }
    }
}

impl Arm {
    fn new(model: &ArmCollisionModel, first_joint: usize) -> Self {
        let split = |pose: &Pose| (*pose.rotation.to_rotation_matrix().matrix(), pose.translation.vector);
        let parent_from_joints = model.chain.joints.iter().map(|joint| split(&joint.parent_from_joint)).collect();
        Self { base: split(&model.world_from_base), parent_from_joints, first_joint, links: Vec::new(), poses: 0 }
    }

    fn pose(&mut self, q: &[f64]) {
        self.poses += 1;
        self.links.clear();
        let (mut rotation, mut origin) = self.base;
        self.links.push((rotation, origin));
        for ((turn, shift), angle) in self.parent_from_joints.iter().zip(q) {
            origin += rotation * shift;
            let before = rotation * turn;
            let (sine, cosine) = angle.sin_cos();
            let (x, y) = (before.column(0), before.column(1));
            rotation = Matrix3::from_columns(&[x * cosine + y * sine, y * cosine - x * sine, before.column(2).into_owned()]);
            self.links.push((rotation, origin));
        }
    }
}

/// A ball that holds all these solids of one link.
fn ball_around<'c>(solids: impl Iterator<Item = &'c Convex> + Clone) -> Convex {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for solid in solids.clone() {
        low = low.inf(&solid.center().add_scalar(-solid.bound()));
        high = high.sup(&solid.center().add_scalar(solid.bound()));
    }
    let center = (low + high) / 2.0;
    let radius = solids.map(|solid| (solid.center() - center).norm() + solid.bound()).fold(0.0, f64::max);
    Convex::new(&Shape::Sphere { radius }, &Pose::from_parts(center.into(), UnitQuaternion::identity()))
}

/// All pairs that can collide, at least one side of which moves.
fn pairs(world: &CollisionWorld, local: &[(Collider, Convex)], balls: &[u32], frozen: &[usize]) -> Vec<Pair> {
    let moves = |collider: Collider| match collider {
        Collider::Link { arm, link } => link > 0 && !frozen.contains(&arm),
        Collider::Held { arm } => !frozen.contains(&arm),
        Collider::Obstacle(_) | Collider::Floor => false,
    };
    let solids: Vec<usize> = (0..local.len()).filter(|&slot| balls[slot] != NO_SOLID).collect();
    let mut pairs = Vec::new();
    for (place, &i) in solids.iter().enumerate() {
        let first = local[i].0;
        if world.floor_height.is_some() && world.compares(first, Collider::Floor) && moves(first) {
            pairs.push(Pair::new(local, i as u32, FLOOR));
        }
        for &j in &solids[place + 1..] {
            let second = local[j].0;
            if world.compares(first, second) && (moves(first) || moves(second)) {
                pairs.push(Pair::new(local, i as u32, j as u32));
            }
        }
    }
    pairs
}

/// Sorts the pairs into bunches and appends the pairs of their balls.
fn bunches(pairs: &mut Vec<Pair>, local: &[(Collider, Convex)], balls: &[u32]) -> Vec<Bunch> {
    let ball = |solid: u32| if solid == FLOOR { FLOOR } else { balls[solid as usize] };
    let key = |pair: &Pair| (ball(pair.first), ball(pair.second));
    pairs.sort_by_key(key);
    let mut bunches: Vec<Bunch> = Vec::new();
    let mut first = 0;
    for bunch in pairs.chunk_by(|a, b| key(a) == key(b)) {
        bunches.push(Bunch { balls: pairs.len() + bunches.len(), members: first..first + bunch.len() });
        first += bunch.len();
    }
    for bunch in &bunches {
        let (first, second) = key(&pairs[bunch.members.start]);
        pairs.push(Pair::new(local, first, second));
    }
    bunches
}

impl Pair {
    fn new(local: &[(Collider, Convex)], first: u32, second: u32) -> Self {
        let bound = |solid: u32| if solid == FLOOR { 0.0 } else { local[solid as usize].1.bound() };
        Self { first, second, reach: bound(first) + bound(second) }
    }
}
