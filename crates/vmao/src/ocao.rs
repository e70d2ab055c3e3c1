//! `ocao`: object-centric control as a pure function from a JSON request to a JSON answer (`interfaces`: `ocao`).

use crate::{
    json::{Document, DocumentError, JsonPath, JsonPose, normalized, object, objects},
    wording::{listed, quoted, unknown},
};
use nalgebra::{Point3, Unit, Vector3};
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error, MapAccess, SeqAccess, Visitor, value::SeqAccessDeserializer},
};
use std::{collections::BTreeMap, fmt};
use vmao_core::{
    contact::PartId,
    geometry::Pose,
    object::JointKind,
    object_centric::{WorldJoint, ball_change, goal_part_poses, gripper_goal},
    object_graph::{GraphError, MAX_PARTS, ObjectGraph},
};

/// What is asked: an object where it is, the grippers that hold it, and where it shall be.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The object in its current configuration.
    #[serde(deserialize_with = "object")]
    pub object: ObjectRequest,
    /// Name of the dependency root.
    pub root: String,
    /// The grippers, each rigid with the part it holds.
    #[serde(default, deserialize_with = "objects")]
    pub grippers: Vec<GripperRequest>,
    /// The goal.
    #[serde(deserialize_with = "object")]
    pub goal: GoalRequest,
}

/// Parts and the joints between them, in the world frame.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectRequest {
    /// The parts.
    #[serde(deserialize_with = "objects")]
    pub parts: Vec<PartRequest>,
    /// The joints; a tree over the parts.
    #[serde(default, deserialize_with = "objects")]
    pub joints: Vec<JointRequest>,
}

/// A part and where it is.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PartRequest {
    /// Its name.
    pub name: String,
    /// Its world pose.
    #[serde(deserialize_with = "object")]
    pub pose: JsonPose,
}

/// A joint in the current configuration. A fixed one needs its name and its two parts only.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointRequest {
    /// Its name.
    pub name: String,
    /// Revolute, prismatic, ball or fixed.
    #[serde(rename = "type", deserialize_with = "kind")]
    pub kind: JointKind,
    /// The part that the motion is relative to.
    pub parent: String,
    /// The part that moves for a positive position.
    pub child: String,
    /// A point on the axis or the centre of a ball, world frame (m); asked of revolute and ball joints.
    pub anchor: Option<[f64; 3]>,
    /// The axis, world frame, of any length but zero; asked of revolute and prismatic joints.
    pub axis: Option<[f64; 3]>,
    /// Current position; asked of all joints that move.
    pub position: Option<Position>,
    /// Lowest and highest goal position; of a ball joint, zero and the largest angle from zero.
    pub limits: Option<[f64; 2]>,
}

/// A gripper that holds a part.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct GripperRequest {
    /// Its name.
    pub name: String,
    /// The part it holds.
    pub part: String,
    /// Its world pose.
    #[serde(deserialize_with = "object")]
    pub pose: JsonPose,
}

/// Where the object shall be.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalRequest {
    /// World pose of the dependency root.
    #[serde(deserialize_with = "object")]
    pub root_pose: JsonPose,
    /// Goal position of every joint that moves, in document order.
    #[serde(default, deserialize_with = "entries")]
    pub joint_positions: Vec<(String, Position)>,
}

/// Position of a joint: a number (rad or m), or for a ball joint a rotation vector of three in its parent's frame (rad).
#[derive(Debug, Clone, PartialEq)]
pub struct Position(Vec<f64>);

impl<'de> Deserialize<'de> for Position {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Coordinates;
        impl<'de> Visitor<'de> for Coordinates {
            type Value = Position;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("a number, or a rotation vector [x, y, z]")
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<Position, E> {
                Ok(Position(vec![number]))
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<Position, E> {
                Ok(Position(vec![number as f64]))
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<Position, E> {
                Ok(Position(vec![number as f64]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<Position, A::Error> {
                let vector = <[f64; 3]>::deserialize(SeqAccessDeserializer::new(sequence))?;
                Ok(Position(vector.to_vec()))
            }
        }
        deserializer.deserialize_any(Coordinates)
    }
}

impl fmt::Display for Position {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0[..] {
            [number] => write!(formatter, "{number}"),
            numbers => write!(formatter, "{numbers:?}"),
        }
    }
}

/// Where every part and gripper is at the goal, in the order of the request.
#[derive(Debug, Clone, Serialize)]
pub struct Answer {
    /// The parts.
    pub parts: Vec<PartRequest>,
    /// The grippers.
    pub grippers: Vec<GripperRequest>,
}

/// A JSON object's entries in order; a repeated key is kept, for [`answer`] to refuse by name.
fn entries<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<(String, Position)>, D::Error> {
    struct Entries;
    impl<'de> Visitor<'de> for Entries {
        type Value = Vec<(String, Position)>;

        fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            formatter.write_str("an object of joint names and positions")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut entries = Vec::new();
            while let Some(entry) = map.next_entry()? {
                entries.push(entry);
            }
            Ok(entries)
        }
    }
    deserializer.deserialize_map(Entries)
}

/// A joint type as a string, and nothing else that serde takes for an enum.
fn kind<'de, D: Deserializer<'de>>(deserializer: D) -> Result<JointKind, D::Error> {
    let name = String::deserialize(deserializer)?;
    let missing = || D::Error::custom(unknown("a joint", "type", &name, JointKind::ALL.map(JointKind::name)));
    JointKind::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(missing)
}

/// The goal pose of every part and gripper (Eq. 1 and 2), or the first thing that is wrong with the request.
pub fn answer(document: &Document) -> Result<Answer, DocumentError> {
    let request: Request = document.parse()?;
    let refuse = |path: JsonPath, message: String| Err(document.refuse(&path, message));
    let parts = PartNames::new(document, &request.object.parts)?;
    unique(document, "joint", &JsonPath::key("object").then("joints"), request.object.joints.iter().map(|j| &*j.name))?;
    unique(document, "gripper", &JsonPath::key("grippers"), request.grippers.iter().map(|gripper| &*gripper.name))?;
    let graph = graph(document, &request.object, &parts)?;
    let root = parts.find(document, &JsonPath::key("root"), &request.root)?;

    let joints = world_joints(document, &request.object, &parts)?;
    let mut world_from_parts = Vec::with_capacity(request.object.parts.len());
    for (index, part) in request.object.parts.iter().enumerate() {
        world_from_parts.push(document.pose(&part.pose, &JsonPath::key("object").then("parts").at(index).then("pose"))?);
    }
    let deltas = joint_deltas(document, &request, &joints, &world_from_parts)?;
    let goal_world_from_root = document.pose(&request.goal.root_pose, &JsonPath::key("goal").then("root_pose"))?;
    let goals = goal_part_poses(&graph, &joints, &world_from_parts, &deltas, root, &goal_world_from_root);

    let mut answer = Answer { parts: Vec::with_capacity(goals.len()), grippers: Vec::with_capacity(request.grippers.len()) };
    for (index, (part, goal)) in request.object.parts.iter().zip(&goals).enumerate() {
        if !finite(goal) {
            return refuse(JsonPath::key("object").then("parts").at(index), overflow("part", &part.name));
        }
        answer.parts.push(PartRequest { name: part.name.clone(), pose: JsonPose::from(goal) });
    }
    for (index, gripper) in request.grippers.iter().enumerate() {
        let path = JsonPath::key("grippers").at(index);
        let part = usize::from(parts.find(document, &path.clone().then("part"), &gripper.part)?.0);
        let world_from_gripper = document.pose(&gripper.pose, &path.clone().then("pose"))?;
        let goal = gripper_goal(&world_from_parts[part], &goals[part], &world_from_gripper);
        if !finite(&goal) {
            return refuse(path, overflow("gripper", &gripper.name));
        }
        answer.grippers.push(GripperRequest { pose: JsonPose::from(&goal), ..gripper.clone() });
    }
    Ok(answer)
}

fn finite(pose: &Pose) -> bool {
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|x| x.is_finite())
}

fn overflow(kind: &str, name: &str) -> String {
    format!("the goal pose of {kind} {} overflows, expected numbers whose sums and products are finite doubles", quoted(name))
}

/// The parts by name.
struct PartNames<'a> {
    ids: BTreeMap<&'a str, PartId>,
    parts: &'a [PartRequest],
}

impl<'a> PartNames<'a> {
    fn new(document: &Document, parts: &'a [PartRequest]) -> Result<Self, DocumentError> {
        let path = JsonPath::key("object").then("parts");
        if parts.is_empty() || parts.len() > MAX_PARTS {
            return Err(document.refuse(&path, format!("{} parts, expected 1 to {MAX_PARTS}", parts.len())));
        }
        unique(document, "part", &path, parts.iter().map(|part| &*part.name))?;
        let ids = parts.iter().enumerate().map(|(index, part)| (&*part.name, PartId(index as u16))).collect();
        Ok(Self { ids, parts })
    }

    fn find(&self, document: &Document, path: &JsonPath, name: &str) -> Result<PartId, DocumentError> {
        let missing = || document.refuse(path, unknown("object", "part", name, self.parts.iter().map(|part| &*part.name)));
        self.ids.get(name).copied().ok_or_else(missing)
    }

    fn listed(&self, ids: &[PartId]) -> String {
        listed(ids.iter().map(|id| &*self.parts[usize::from(id.0)].name))
    }
}

fn unique<'a>(
    document: &Document,
    kind: &str,
    list: &JsonPath,
    names: impl Iterator<Item = &'a str>,
) -> Result<(), DocumentError> {
    let mut first = BTreeMap::new();
    for (index, name) in names.enumerate() {
        if let Some(before) = first.insert(name, index) {
            let message = format!("a second {kind} {}, expected unique names; the first is {list}[{before}]", quoted(name));
            return Err(document.refuse(&list.clone().at(index).then("name"), message));
        }
    }
    Ok(())
}

fn graph(document: &Document, object: &ObjectRequest, parts: &PartNames<'_>) -> Result<ObjectGraph, DocumentError> {
    let list = JsonPath::key("object").then("joints");
    let mut edges = Vec::with_capacity(object.joints.len());
    for (index, joint) in object.joints.iter().enumerate() {
        let path = list.clone().at(index);
        let parent = parts.find(document, &path.clone().then("parent"), &joint.parent)?;
        edges.push((parent, parts.find(document, &path.then("child"), &joint.child)?));
    }
    ObjectGraph::new(object.parts.len(), &edges).map_err(|error| match &error {
        GraphError::SelfJoint { joint, .. } => {
            let name = &object.joints[*joint];
            let message = format!(
                "joint {} connects part {} to itself (a cycle), expected two parts",
                quoted(&name.name),
                quoted(&name.child)
            );
            document.refuse(&list.at(*joint), message)
        }
        GraphError::Cycle { joints, parts: ids } => {
            let names = listed(joints.iter().map(|&joint| &*object.joints[joint].name));
            let message = format!("joints {names} form a cycle through parts {}, expected a tree", parts.listed(ids));
            document.refuse(&list.at(joints[joints.len() - 1]), message)
        }
        GraphError::Disconnected { unreached } => {
            let message = format!(
                "no chain of joints connects part {} to: {}; expected one tree over all parts",
                quoted(&object.parts[0].name),
                parts.listed(unreached)
            );
            document.refuse(&JsonPath::key("object").then("parts").at(usize::from(unreached[0].0)), message)
        }
        _ => document.refuse(&list, error.to_string()),
    })
}

fn world_joints(document: &Document, object: &ObjectRequest, parts: &PartNames<'_>) -> Result<Vec<WorldJoint>, DocumentError> {
    let mut joints = Vec::with_capacity(object.joints.len());
    for (index, joint) in object.joints.iter().enumerate() {
        let path = JsonPath::key("object").then("joints").at(index);
        let missing =
            |field: &str| document.refuse(&path, format!("{} joint {} has no `{field}`", joint.kind.name(), quoted(&joint.name)));
        let anchor = match (joint.anchor, joint.kind) {
            (None, JointKind::Revolute | JointKind::Ball) => return Err(missing("anchor")),
            (anchor, _) => anchor.unwrap_or_default(),
        };
        let axis = match (joint.axis, joint.kind) {
            (None, JointKind::Fixed | JointKind::Ball) => [0.0, 0.0, 1.0],
            (None, JointKind::Revolute | JointKind::Prismatic) => return Err(missing("axis")),
            (Some(axis), _) => normalized(axis).ok_or_else(|| {
                document.refuse(&path.clone().then("axis"), "a zero axis, expected a direction [x, y, z]".to_owned())
            })?,
        };
        match &joint.position {
            None if joint.kind != JointKind::Fixed => return Err(missing("position")),
            Some(position) => {
                check_coordinates(joint, position).map_err(|cause| document.refuse(&path.then("position"), cause))?;
            }
            None => {}
        }
        joints.push(WorldJoint {
            kind: joint.kind,
            parent: parts.ids[&*joint.parent],
            child: parts.ids[&*joint.child],
            anchor: Point3::from(anchor),
            axis: Unit::new_unchecked(Vector3::from(axis)),
        });
    }
    Ok(joints)
}

/// Whether the position of a joint has as many coordinates as its type asks for.
fn check_coordinates(joint: &JointRequest, position: &Position) -> Result<(), String> {
    if position.0.len() == joint.kind.coordinates() {
        return Ok(());
    }
    let expected = if joint.kind == JointKind::Ball { "a rotation vector [x, y, z]" } else { "a number" };
    Err(format!("{position} for {} joint {}, expected {expected}", joint.kind.name(), quoted(&joint.name)))
}

/// The change of every joint from its current position to its goal, each goal checked against the joint's limits.
fn joint_deltas(
    document: &Document,
    request: &Request,
    world_joints: &[WorldJoint],
    world_from_parts: &[Pose],
) -> Result<Vec<f64>, DocumentError> {
    let list = JsonPath::key("goal").then("joint_positions");
    let joints = &request.object.joints;
    let mut goals = BTreeMap::new();
    let names: BTreeMap<&str, ()> = joints.iter().map(|joint| (&*joint.name, ())).collect();
    for (name, goal) in &request.goal.joint_positions {
        let path = list.clone().then(name);
        if !names.contains_key(&**name) {
            return Err(document.refuse(&path, unknown("object", "joint", name, joints.iter().map(|joint| &*joint.name))));
        }
        if goals.insert(&**name, goal).is_some() {
            return Err(document.refuse(&path, format!("a second goal for joint {}, expected one", quoted(name))));
        }
    }
    let mut deltas = Vec::with_capacity(joints.len());
    for (index, joint) in joints.iter().enumerate() {
        let (name, goal) = (quoted(&joint.name), goals.get(&*joint.name).copied());
        let path = list.clone().then(&joint.name);
        if let Some(goal) = goal {
            check_coordinates(joint, goal).map_err(|cause| document.refuse(&path, cause))?;
        }
        if let Some(limits) = joint.limits {
            check_ordered(joint, limits)
                .map_err(|cause| document.refuse(&JsonPath::key("object").then("joints").at(index).then("limits"), cause))?;
            if let Some(goal) = goal.filter(|goal| !within(joint.kind, goal, limits)) {
                let [lower, upper] = limits;
                let message = format!("goal {goal} of joint {name} is outside its limits [{lower}, {upper}]");
                return Err(document.refuse(&path, message));
            }
        }
        let zero = Position(vec![0.0; joint.kind.coordinates()]);
        let position = joint.position.as_ref().unwrap_or(&zero);
        match (goal, joint.kind) {
            (None, JointKind::Fixed) => deltas.push(0.0),
            (None, _) => return Err(document.refuse(&list, format!("no goal for joint {name}, expected one for each joint"))),
            (Some(goal), JointKind::Fixed) if goal != position => {
                let message = format!("goal {goal} of fixed joint {name}, which stays at {position}");
                return Err(document.refuse(&path, message));
            }
            (Some(goal), JointKind::Ball) => {
                let world_from_parent = world_from_parts[usize::from(world_joints[index].parent.0)].rotation;
                deltas.extend((world_from_parent * ball_change(&position.0, &goal.0)).iter());
            }
            (Some(goal), _) => deltas.push(goal.0[0] - position.0[0]),
        }
    }
    Ok(deltas)
}

/// Whether the limits are in order, and those of a ball joint begin at zero.
fn check_ordered(joint: &JointRequest, [lower, upper]: [f64; 2]) -> Result<(), String> {
    let name = quoted(&joint.name);
    if lower > upper {
        return Err(format!("limits of joint {name} are [{lower}, {upper}], expected the lower one first"));
    }
    if joint.kind == JointKind::Ball && lower != 0.0 {
        return Err(format!("limits of ball joint {name} are [{lower}, {upper}], expected [0, largest angle]"));
    }
    Ok(())
}

/// Whether a goal lies within limits: its number, or the angle of its rotation vector.
fn within(kind: JointKind, goal: &Position, [lower, upper]: [f64; 2]) -> bool {
    let size = if kind == JointKind::Ball { Vector3::from_column_slice(&goal.0).norm() } else { goal.0[0] };
    lower <= size && size <= upper
}
