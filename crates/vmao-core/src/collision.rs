//! Collisions of any number of arms with each other, themselves, obstacles, the floor and what they hold.
//!
//! [`CollisionWorld`] is the plain description; [`CollisionChecker`] is that description prepared for many queries.
//! Left out on purpose: neighbouring links of an arm, an arm's base with anything fixed, and the first two links with
//! the floor they are mounted on.

use crate::{distance::Convex, geometry::Pose, kinematics::SerialChain, shape::Solid};
use nalgebra::{Matrix3, Vector3};
use std::fmt;

/// A solid that rides on a link of an arm.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkSolid {
    /// 0 is the fixed base, i the link after joint i.
    pub link: usize,
    /// The solid in that link's frame.
    pub solid: Solid,
}

/// One arm as the collision check sees it; the solids of its gripper ride on its last link.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmCollisionModel {
    /// Its kinematics.
    pub chain: SerialChain,
    /// Where its base stands.
    pub world_from_base: Pose,
    /// Its solids.
    pub solids: Vec<LinkSolid>,
    /// Pairs of its links that are never compared, besides neighbours.
    pub ignored_links: Vec<(usize, usize)>,
}

/// Something in the way that does not move during a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstacle {
    /// Its name, for messages.
    pub name: String,
    /// The solid; its carrier is the world.
    pub solid: Solid,
}

/// All that can collide.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CollisionWorld {
    /// The arms.
    pub arms: Vec<ArmCollisionModel>,
    /// What stands around.
    pub obstacles: Vec<Obstacle>,
    /// Everything below this height is solid (m), if there is a floor.
    pub floor_height: Option<f64>,
    /// What each arm holds, in the frame of its last link; it may touch that link. May be shorter than `arms`.
    pub attached: Vec<Vec<Solid>>,
    /// (arm, obstacle) pairs that may touch: the last link of that arm and what it holds, with that obstacle.
    pub allowed: Vec<(usize, usize)>,
}

/// One side of a collision.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Collider {
    /// A link of an arm; 0 is its base.
    Link {
        /// Index of the arm.
        arm: usize,
        /// Link number.
        link: usize,
    },
    /// What an arm holds.
    Held {
        /// Index of the arm.
        arm: usize,
    },
    /// An obstacle, by index.
    Obstacle(usize),
    /// The floor.
    Floor,
}

/// Two things that are closer than allowed.
#[derive(Debug, Clone, PartialEq)]
pub struct CollisionPair {
    /// The one.
    pub first: Collider,
    /// The other.
    pub second: Collider,
    /// Readable names of both.
    pub names: [String; 2],
    /// Signed distance between them (m).
    pub distance: f64,
}

impl fmt::Display for CollisionPair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} and {} are {:.4} m apart", self.names[0], self.names[1], self.distance)
    }
}

impl CollisionWorld {
    /// Joints of all arms together.
    pub fn joint_count(&self) -> usize {
        self.arms.iter().map(|arm| arm.chain.len()).sum()
    }

    /// Whether all angles of all arms lie in their limits; `q` is flat, arm after arm.
    pub fn within_limits(&self, q: &[f64]) -> bool {
        let mut rest = q;
        let fits = |arm: &ArmCollisionModel| {
            rest.split_at_checked(arm.chain.len()).is_some_and(|(own, others)| {
                rest = others;
                arm.chain.within_limits(own)
            })
        };
        q.len() == self.joint_count() && self.arms.iter().all(fits)
    }

    /// The first pair closer than `margin` (m) at the angles `q` (flat, arm after arm), `None` if all are clear.
    pub fn check(&self, q: &[f64], margin: f64) -> Option<CollisionPair> {
        CollisionChecker::new(self).check(q, margin)
    }

    /// The least signed distance over all compared pairs (m), +∞ if there is no pair.
    pub fn clearance(&self, q: &[f64]) -> f64 {
        CollisionChecker::new(self).clearance(q)
    }
}

/// A [`CollisionWorld`] prepared for many queries: solids as convex sets, the pairs to compare listed once.
#[derive(Debug, Clone)]
pub struct CollisionChecker<'a> {
    world: &'a CollisionWorld,
    /// Solids in their link's frame, then the obstacles in the world.
    local: Vec<(Collider, Convex)>,
    /// The same solids in the world at the last query.
    placed: Vec<Convex>,
    /// Their centres, close together for the first rejection.
    centers: Vec<Vector3<f64>>,
    pairs: Vec<Pair>,
    over_floor: Vec<u32>,
    /// The angles of the last query: arms that have not moved since are not placed again.
    posed: Vec<f64>,
}

/// Two solids to compare, by index, and the sum of the radii of the balls around them.
#[derive(Debug, Clone, Copy)]
struct Pair {
    first: u32,
    second: u32,
    reach: f64,
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
        let mut local = Vec::new();
        for (index, arm) in world.arms.iter().enumerate() {
            for LinkSolid { link, solid } in &arm.solids {
                assert!(*link <= arm.chain.len(), "arm {index} has no link {link}, only 0..={}", arm.chain.len());
                local.push((Collider::Link { arm: index, link: *link }, Convex::new(&solid.shape, &solid.carrier_from_solid)));
            }
            for solid in world.attached.get(index).into_iter().flatten() {
                local.push((Collider::Held { arm: index }, Convex::new(&solid.shape, &solid.carrier_from_solid)));
            }
        }
        for (index, Obstacle { solid, .. }) in world.obstacles.iter().enumerate() {
            local.push((Collider::Obstacle(index), Convex::new(&solid.shape, &solid.carrier_from_solid)));
        }
        let moves = |collider: Collider| match collider {
            Collider::Link { arm, link } => link > 0 && !frozen.contains(&arm),
            Collider::Held { arm } => !frozen.contains(&arm),
            Collider::Obstacle(_) | Collider::Floor => false,
        };
        let mut pairs = Vec::new();
        for i in 0..local.len() {
            for j in i + 1..local.len() {
                if world.compares(local[i].0, local[j].0) && (moves(local[i].0) || moves(local[j].0)) {
                    pairs.push(Pair { first: i as u32, second: j as u32, reach: local[i].1.bound() + local[j].1.bound() });
                }
            }
        }
        let floors = |collider| world.floor_height.is_some() && world.compares(collider, Collider::Floor) && moves(collider);
        let over_floor = (0..local.len()).filter(|&i| floors(local[i].0)).map(|i| i as u32).collect();
        let placed = local.iter().map(|&(_, convex)| convex).collect();
        let centers = local.iter().map(|(_, convex)| *convex.center()).collect();
        let posed = vec![f64::NAN; world.joint_count()];
        Self { world, local, placed, centers, pairs, over_floor, posed }
    }

    /// The first pair closer than `margin` (m) at the angles `q` (flat, arm after arm), `None` if all are clear.
    pub fn check(&mut self, q: &[f64], margin: f64) -> Option<CollisionPair> {
        self.place(q);
        let (first, second) = self.first_below(margin)?;
        let distance = match second {
            Some(second) => self.placed[first].signed_distance(&self.placed[second]),
            None => self.placed[first].height_above(self.world.floor_height.unwrap_or(f64::NEG_INFINITY)),
        };
        let (first, second) = (self.local[first].0, second.map_or(Collider::Floor, |second| self.local[second].0));
        let names = [self.world.name(first), self.world.name(second)];
        Some(CollisionPair { first, second, names, distance })
    }

    /// Whether no pair is closer than `margin` (m) at the angles `q`.
    pub fn is_free(&mut self, q: &[f64], margin: f64) -> bool {
        self.place(q);
        self.first_below(margin).is_none()
    }

    /// The least signed distance over all compared pairs (m) at the angles `q`, +∞ if there is no pair.
    pub fn clearance(&mut self, q: &[f64]) -> f64 {
        self.place(q);
        let floor = self.world.floor_height.unwrap_or(f64::NEG_INFINITY);
        let heights = self.over_floor.iter().map(|&i| self.placed[i as usize].height_above(floor));
        let mut least = heights.fold(f64::INFINITY, f64::min);
        for pair in &self.pairs {
            let (i, j) = (pair.first as usize, pair.second as usize);
            if (self.centers[i] - self.centers[j]).norm() - pair.reach < least {
                least = least.min(self.placed[i].signed_distance(&self.placed[j]));
            }
        }
        least
    }

    fn first_below(&self, margin: f64) -> Option<(usize, Option<usize>)> {
        let floor = self.world.floor_height.unwrap_or(f64::NEG_INFINITY);
        if let Some(&low) = self.over_floor.iter().find(|&&i| self.placed[i as usize].height_above(floor) < margin) {
            return Some((low as usize, None));
        }
        let touches = |pair: &&Pair| {
            let (i, j) = (pair.first as usize, pair.second as usize);
            let reach = pair.reach + margin;
            reach > 0.0
                && (self.centers[i] - self.centers[j]).norm_squared() < reach * reach
                && self.placed[i].closer_than(&self.placed[j], margin)
        };
        self.pairs.iter().find(touches).map(|pair| (pair.first as usize, Some(pair.second as usize)))
    }

    /// Puts every solid of every arm where `q` has it.
    fn place(&mut self, q: &[f64]) {
        assert_eq!(q.len(), self.world.joint_count(), "one angle per joint of all arms");
        let (mut slot, mut used) = (0, 0);
        for (index, arm) in self.world.arms.iter().enumerate() {
            let own = &q[used..used + arm.chain.len()];
            let moved = own.is_empty() || own != &self.posed[used..used + own.len()];
            used += own.len();
            let links = if moved { world_from_links(arm, own) } else { Vec::new() };
            while let Some((collider, convex)) = self.local.get(slot) {
                let link = match *collider {
                    Collider::Link { arm: owner, link } if owner == index => link,
                    Collider::Held { arm: owner } if owner == index => arm.chain.len(),
                    _ => break,
                };
                if let Some((rotation, origin)) = links.get(link) {
                    self.placed[slot].place(convex, rotation, origin);
                    self.centers[slot] = *self.placed[slot].center();
                }
                slot += 1;
            }
        }
        self.posed.copy_from_slice(q);
    }
}

/// Rotation and origin in the world of the base and of every link.
fn world_from_links(arm: &ArmCollisionModel, q: &[f64]) -> Vec<(Matrix3<f64>, Vector3<f64>)> {
    let matrix = |pose: &Pose| (*pose.rotation.to_rotation_matrix().matrix(), pose.translation.vector);
    let mut links = Vec::with_capacity(q.len() + 1);
    links.push(matrix(&arm.world_from_base));
    links.extend(arm.chain.link_poses(q).iter().map(|base_from_link| matrix(&(arm.world_from_base * base_from_link))));
    links
}

impl CollisionWorld {
    /// Whether this pair can collide at all and is not excused.
    fn compares(&self, a: Collider, b: Collider) -> bool {
        use Collider::{Floor, Held, Link, Obstacle};
        let last = |arm: usize| self.arms[arm].chain.len();
        match (a, b) {
            (Link { arm: x, link: i }, Link { arm: y, link: j }) if x == y => {
                let ignored = &self.arms[x].ignored_links;
                i.abs_diff(j) > 1 && !ignored.contains(&(i, j)) && !ignored.contains(&(j, i))
            }
            (Link { link: 0, .. }, Link { link: 0, .. } | Obstacle(_)) | (Obstacle(_), Link { link: 0, .. }) => false,
            (Link { arm: x, link }, Held { arm: y }) | (Held { arm: y }, Link { arm: x, link }) => x != y || link != last(x),
            (Held { arm: x }, Held { arm: y }) => x != y,
            (Link { arm, link }, Obstacle(index)) | (Obstacle(index), Link { arm, link }) => {
                link != last(arm) || !self.allowed.contains(&(arm, index))
            }
            (Held { arm }, Obstacle(index)) | (Obstacle(index), Held { arm }) => !self.allowed.contains(&(arm, index)),
            (Link { link, .. }, Floor) | (Floor, Link { link, .. }) => link > 1,
            (Held { .. }, Floor) | (Floor, Held { .. }) | (Link { .. }, Link { .. }) => true,
            (Obstacle(_) | Floor, Obstacle(_) | Floor) => false,
        }
    }

    fn name(&self, collider: Collider) -> String {
        match collider {
            Collider::Link { arm, link } => format!("link {link} of arm {arm}"),
            Collider::Held { arm } => format!("what arm {arm} holds"),
            Collider::Obstacle(index) => self.obstacles[index].name.clone(),
            Collider::Floor => "the floor".to_owned(),
        }
    }
}
