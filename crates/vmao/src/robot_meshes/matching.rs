//! Which of a model's bodies are which of our robot's links, and whether their frames are the same.

use super::mjcf::{Body, Joint, MeshGeom};
use nalgebra::Vector3;
use vmao_core::geometry::{Pose, rotation_distance};
use vmao_core::robots::RobotModel;

/// Frames further apart than this are not the same (m).
const SAME_PLACE: f64 = 1e-3;
/// Axes and frames turned by more than this are not the same (rad).
const SAME_TURN: f64 = 1e-3;

/// What packages call the bodies that are not joints' links.
struct Names {
    base: &'static str,
    /// The body that carries a gripper: at our hand (Panda) or our flange (Sawyer).
    mounts: &'static [&'static str],
    fingers: [&'static [&'static str]; 2],
    /// Bodies whose joint we keep still.
    still: &'static [&'static str],
    /// A gripper of its own is in a file named so.
    gripper_file: &'static str,
}

fn names(robot: &str) -> Names {
    let (left, right) = (&["left_finger", "leftfinger", "l_finger"][..], &["right_finger", "rightfinger", "r_finger"][..]);
    let fingers = [left, right];
    match robot {
        "sawyer" => Names { base: "base", mounts: &["right_hand"], fingers, still: &["head"], gripper_file: "rethink" },
        _ => Names { base: "link0", mounts: &["hand", "right_hand"], fingers, still: &[], gripper_file: "panda" },
    }
}

/// One of our frames that a package's bodies are compared with.
struct Anchor {
    /// Of which of our links, and where it is in that link.
    link: &'static str,
    link_from_anchor: Pose,
    bodies: Vec<&'static str>,
    /// The anchor it hangs on, and where.
    parent: Option<(usize, Pose)>,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Base,
    Joint,
    Mount,
    Finger,
}

/// A mesh in the frame of our link.
#[derive(Debug)]
pub(super) struct LinkMesh {
    pub(super) link: &'static str,
    pub(super) link_from_mesh: Pose,
    pub(super) geom: MeshGeom,
}

/// What a model gives to a robot's pictures.
#[derive(Debug, Default)]
pub(super) struct Match {
    pub(super) meshes: Vec<LinkMesh>,
    /// What could not be used, and why.
    pub(super) skipped: Vec<String>,
}

impl Match {
    /// How many links have meshes.
    pub(super) fn links(&self) -> usize {
        let mut links: Vec<&str> = self.meshes.iter().map(|mesh| mesh.link).collect();
        links.sort_unstable();
        links.dedup();
        links.len()
    }
}

/// A robot as seen by [`Matcher::arm`] and [`Matcher::gripper`].
pub(super) struct Matcher {
    names: Names,
    anchors: Vec<Anchor>,
    still: Vec<&'static str>,
}

impl Matcher {
    pub(super) fn new(robot: &RobotModel) -> Self {
        let names = names(robot.name);
        let anchor = |link, bodies, parent, kind| Anchor { link, link_from_anchor: Pose::identity(), bodies, parent, kind };
        let mut anchors = vec![anchor(robot.base.name, vec![names.base], None, Kind::Base)];
        for (index, joint) in robot.joints.iter().enumerate() {
            let parent = Some((index, joint.parent_from_joint));
            anchors.push(anchor(joint.link.name, vec![joint.link.name], parent, Kind::Joint));
        }
        let gripper = &robot.gripper;
        // The Sawyer's gripper has a base of its own, behind the flange that packages mount theirs on.
        let last_from_mount =
            if names.mounts.contains(&gripper.hand.name) { gripper.last_from_hand } else { robot.last_from_flange };
        let hand_from_mount = gripper.last_from_hand.inverse() * last_from_mount;
        let mount = anchors.len();
        anchors.push(Anchor {
            link_from_anchor: hand_from_mount,
            ..anchor(gripper.hand.name, names.mounts.to_vec(), Some((mount - 1, last_from_mount)), Kind::Mount)
        });
        for (finger, bodies) in gripper.fingers.iter().zip(names.fingers) {
            let parent = Some((mount, hand_from_mount.inverse() * finger.hand_from_finger));
            anchors.push(anchor(finger.link.name, bodies.to_vec(), parent, Kind::Finger));
        }
        let still = names.still.to_vec();
        Self { names, anchors, still }
    }

    /// Whether the model has a body for every link from the base to the last joint.
    pub(super) fn is_arm(&self, bodies: &[Body]) -> bool {
        let needed = |kind| matches!(kind, Kind::Base | Kind::Joint);
        let has = |anchor: &Anchor| bodies.iter().any(|body| anchor.bodies.contains(&body.name.as_str()));
        self.anchors.iter().filter(|anchor| needed(anchor.kind)).all(has)
    }

    /// Whether the model is a gripper for this robot: it has both fingers and no arm, and its file is named so.
    pub(super) fn is_gripper(&self, file_name: &str, bodies: &[Body]) -> bool {
        let fingers = self.anchors.iter().filter(|anchor| anchor.kind == Kind::Finger);
        let has = |anchor: &Anchor| bodies.iter().any(|body| anchor.bodies.contains(&body.name.as_str()));
        file_name.contains(self.names.gripper_file) && fingers.into_iter().all(has) && !self.is_arm(bodies)
    }

    /// An arm's meshes. Fails if a link up to the last joint is placed or turns otherwise than ours.
    pub(super) fn arm(&self, bodies: &[Body]) -> Result<Match, String> {
        self.walk(bodies, None)
    }

    /// A gripper's meshes: its world is where grippers are mounted.
    pub(super) fn gripper(&self, bodies: &[Body]) -> Result<Match, String> {
        self.walk(bodies, self.anchors.iter().position(|anchor| anchor.kind == Kind::Mount))
    }

    fn walk(&self, bodies: &[Body], world: Option<usize>) -> Result<Match, String> {
        let mut found = Match::default();
        // For each body: the anchor it moves with, and where it is there.
        let mut places: Vec<Option<(usize, Pose)>> = Vec::new();
        for body in bodies {
            let parent = match body.parent {
                Some(parent) => places[parent],
                None => world.map(|anchor| (anchor, Pose::identity())),
            };
            let here = parent.map(|(anchor, pose)| (anchor, pose * body.parent_from_body));
            let place = match self.anchors.iter().position(|anchor| anchor.bodies.contains(&body.name.as_str())) {
                Some(index) => match (self.anchored(index, here, body), self.anchors[index].kind) {
                    (Ok(anchor_from_body), _) => Some((index, anchor_from_body)),
                    (Err(reason), Kind::Mount | Kind::Finger) => {
                        found.skipped.push(reason);
                        None
                    }
                    (Err(reason), Kind::Base | Kind::Joint) => return Err(reason),
                },
                None if body.joints.is_empty() || self.still.contains(&body.name.as_str()) => here,
                None => None,
            };
            places.push(place);
            let Some((index, anchor_from_body)) = place else { continue };
            let anchor = &self.anchors[index];
            found.meshes.extend(body.meshes.iter().map(|geom| LinkMesh {
                link: anchor.link,
                link_from_mesh: anchor.link_from_anchor * anchor_from_body * geom.body_from_mesh,
                geom: geom.clone(),
            }));
        }
        Ok(found)
    }

    /// The body's frame in that of its anchor: the identity, except for fingers, whose frames may be turned.
    fn anchored(&self, index: usize, here: Option<(usize, Pose)>, body: &Body) -> Result<Pose, String> {
        let anchor = &self.anchors[index];
        let Some((parent, expected)) = &anchor.parent else { return Ok(Pose::identity()) };
        let (name, parent_name) = (&body.name, self.anchors[*parent].link);
        let Some((_, found)) = here.filter(|(owner, _)| owner == parent) else {
            return Err(format!("body `{name}` does not hang on the body of `{parent_name}`"));
        };
        let apart = |found: &Pose| {
            let gap = (found.translation.vector - expected.translation.vector).norm();
            let gap = (gap > SAME_PLACE).then(|| format!("{:.1} mm", gap * 1e3));
            gap.map_or(Ok(()), |gap| {
                Err(format!("body `{name}` is {gap} from where our `{}` is on `{parent_name}`", anchor.link))
            })
        };
        let turned = |angle: f64, what: &str| match angle > SAME_TURN {
            true => Err(format!("{what} of body `{name}` is turned by {angle:.4} rad from that of our `{}`", anchor.link)),
            false => Ok(()),
        };
        match (anchor.kind, body.joints.as_slice()) {
            (Kind::Joint, [Joint::Hinge { axis }]) => {
                apart(&found)?;
                turned(rotation_distance(&found.rotation, &expected.rotation), "the frame")?;
                turned(axis.angle(&Vector3::z()), "the joint's axis")?;
                Ok(Pose::identity())
            }
            (Kind::Base | Kind::Mount, []) => {
                apart(&found)?;
                turned(rotation_distance(&found.rotation, &expected.rotation), "the frame")?;
                Ok(Pose::identity())
            }
            (Kind::Finger, [Joint::Slide { axis, range: Some([low, high]) }]) => {
                // Ours opens along its y. Packages differ in where zero is, in the sense of the axis and in half turns.
                let outward = expected.rotation * Vector3::y();
                let along = found.rotation * axis;
                let opens = along.dot(&outward) > 0.0;
                turned(if opens { along } else { -along }.angle(&outward), "the axis")?;
                let closed = along * if opens { *low } else { *high };
                let mut closed_pose = found;
                closed_pose.translation.vector += closed;
                apart(&closed_pose)?;
                let turn = expected.rotation.inverse() * found.rotation;
                Ok(Pose::from_parts(Vector3::zeros().into(), turn))
            }
            (kind, joints) => {
                let expected = match kind {
                    Kind::Joint => "one hinge",
                    Kind::Finger => "one limited slide",
                    Kind::Base | Kind::Mount => "none",
                };
                Err(format!("body `{name}` has other joints ({}) than ours: {expected}", joints.len()))
            }
        }
    }
}
