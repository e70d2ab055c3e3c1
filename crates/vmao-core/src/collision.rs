//! Collisions of any number of arms with each other, themselves, obstacles, the floor and what they hold.
//!
//! [`CollisionWorld`] is the plain description; [`CollisionChecker`] is that description prepared for many queries.
//! Left out on purpose: neighbouring links of an arm, an arm's base with anything fixed, and the first two links with
//! the floor they are mounted on.

pub use crate::collision_checker::CollisionChecker;

use crate::{geometry::Pose, kinematics::SerialChain, shape::Solid};
use std::fmt;

/// A solid that rides on a link of an arm.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkSolid {
    /// 0 is the fixed base, i the link after joint i; the hand and the fingers, which ride on the last link, have the next two.
    pub link: usize,
    /// The solid in that link's frame; in the last link's for hand and fingers.
    pub solid: Solid,
}

/// One arm as the collision check sees it.
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
    /// (arm, obstacle) pairs that may touch: the last link and gripper of that arm and what it holds, with that obstacle.
    pub allowed: Vec<(usize, usize)>,
}

/// One side of a collision.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Collider {
    /// A link of an arm; 0 is its base, the two after its last link are hand and fingers.
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

    /// Whether this pair can collide at all and is not excused.
    pub(crate) fn compares(&self, a: Collider, b: Collider) -> bool {
        use Collider::{Floor, Held, Link, Obstacle};
        let last = |arm: usize| self.arms[arm].chain.len();
        match (a, b) {
            (Link { arm: x, link: i }, Link { arm: y, link: j }) if x == y => {
                let ignored = &self.arms[x].ignored_links;
                i.abs_diff(j) > 1 && !ignored.contains(&(i, j)) && !ignored.contains(&(j, i))
            }
            (Link { link: 0, .. }, Link { link: 0, .. } | Obstacle(_)) | (Obstacle(_), Link { link: 0, .. }) => false,
            (Link { arm: x, link }, Held { arm: y }) | (Held { arm: y }, Link { arm: x, link }) => x != y || link < last(x),
            (Held { arm: x }, Held { arm: y }) => x != y,
            (Link { arm, link }, Obstacle(index)) | (Obstacle(index), Link { arm, link }) => {
                link < last(arm) || !self.allowed.contains(&(arm, index))
            }
            (Held { arm }, Obstacle(index)) | (Obstacle(index), Held { arm }) => !self.allowed.contains(&(arm, index)),
            (Link { link, .. }, Floor) | (Floor, Link { link, .. }) => link > 1,
            (Held { .. }, Floor) | (Floor, Held { .. }) | (Link { .. }, Link { .. }) => true,
            (Obstacle(_) | Floor, Obstacle(_) | Floor) => false,
        }
    }

    pub(crate) fn name(&self, collider: Collider) -> String {
        match collider {
            Collider::Link { arm, link } => match link.checked_sub(self.arms[arm].chain.len()) {
                Some(1) => format!("the hand of arm {arm}"),
                Some(2) => format!("the fingers of arm {arm}"),
                _ => format!("link {link} of arm {arm}"),
            },
            Collider::Held { arm } => format!("what arm {arm} holds"),
            Collider::Obstacle(index) => self.obstacles[index].name.clone(),
            Collider::Floor => "the floor".to_owned(),
        }
    }
}
