//! `ik`: inverse kinematics as a pure function from a JSON request to a JSON answer (`interfaces`: `ik`).

use crate::json::{Document, DocumentError, JsonPath, JsonPose};
use rayon::prelude::*;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error, SeqAccess, Visitor},
};
use std::fmt;
use vmao_core::{
    geometry::Pose,
    inverse_kinematics::{Branch, IkOutcome, InverseKinematics},
};

/// Most targets of a request.
pub const MAX_TARGETS: usize = 100_000;

/// What is asked: poses of the tool or flange in the robot's base frame.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The poses.
    #[serde(deserialize_with = "targets")]
    pub targets: Vec<JsonPose>,
    /// Joint positions (rad): each answer is then the solution nearest to them.
    pub seed_positions: Option<Vec<f64>>,
}

/// Which solutions are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// One for each target.
    One,
    /// One of every branch as well.
    AllBranches,
}

/// What became of one target.
#[derive(Debug, Clone, Serialize)]
pub struct Answer {
    /// Whether `joint_positions` reach the target within the tolerances.
    pub success: bool,
    /// Inside the limits (rad): the solution, otherwise the nearest miss.
    pub joint_positions: Vec<f64>,
    /// Distance left (m).
    pub position_error: f64,
    /// Angle left (rad).
    pub rotation_error: f64,
    /// Of a failure: whether nothing can reach the target, or nothing that does was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<Reason>,
    /// With all branches wanted: one solution of each, the nearest to the seed first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub branches: Option<Vec<Vec<f64>>>,
}

/// Why a target has no solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// Proven from lengths and limits.
    Unreachable,
    /// No start led to one.
    NotFound,
}

/// A list of poses, refused as soon as it is too long.
fn targets<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<JsonPose>, D::Error> {
    #[derive(Deserialize)]
    struct Target(#[serde(deserialize_with = "crate::json::object")] JsonPose);
    struct Targets;
    impl<'de> Visitor<'de> for Targets {
        type Value = Vec<JsonPose>;

        fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(formatter, "a list of at most {MAX_TARGETS} poses")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let mut targets = Vec::new();
            while let Some(Target(target)) = list.next_element()? {
                if targets.len() == MAX_TARGETS {
                    return Err(A::Error::custom(format!("more than {MAX_TARGETS} targets, the most of one request")));
                }
                targets.push(target);
            }
            Ok(targets)
        }
    }
    deserializer.deserialize_seq(Targets)
}

/// One answer for each target, or the first thing that is wrong with the request. `home` is the seed where none is given.
///
/// Works on the threads of the current rayon pool; answers do not depend on their number.
pub fn answer(document: &Document, arm: &InverseKinematics, home: &[f64], wanted: Wanted) -> Result<Vec<Answer>, DocumentError> {
    let request: Request = document.parse()?;
    let expected = arm.chain().len();
    if let Some(seed) = request.seed_positions.as_ref().filter(|seed| seed.len() != expected) {
        let message = format!("{} joint positions, expected {expected}", seed.len());
        return Err(document.refuse(&JsonPath::key("seed_positions"), message));
    }
    let mut poses = Vec::with_capacity(request.targets.len());
    for (index, target) in request.targets.iter().enumerate() {
        poses.push(target.to_pose().ok_or_else(|| {
            let path = JsonPath::key("targets").at(index).then("quaternion");
            document.refuse(&path, "a zero quaternion, expected a rotation [w, x, y, z]".to_owned())
        })?);
    }
    let seed = request.seed_positions.as_deref();
    Ok(poses.par_iter().map(|pose| solved(arm, pose, seed, home, wanted)).collect())
}

fn solved(arm: &InverseKinematics, pose: &Pose, seed: Option<&[f64]>, home: &[f64], wanted: Wanted) -> Answer {
    let branches = match wanted {
        Wanted::One => None,
        Wanted::AllBranches => Some(arm.branches(pose, seed.unwrap_or(home))),
    };
    let outcome = seed.map_or_else(|| arm.solve(pose, home), |seed| arm.nearest(pose, seed));
    let (success, reason) = match outcome {
        IkOutcome::Solved { .. } => (true, None),
        IkOutcome::NoSolution { .. } => (false, Some(Reason::NotFound)),
        IkOutcome::Unreachable { .. } => (false, Some(Reason::Unreachable)),
    };
    let (IkOutcome::Solved { joint_positions: q, position_error, rotation_error }
    | IkOutcome::NoSolution { closest: q, position_error, rotation_error }
    | IkOutcome::Unreachable { closest: q, position_error, rotation_error }) = outcome;
    let branches = branches.map(|all: Vec<Branch>| all.into_iter().map(|branch| branch.joint_positions).collect());
    Answer { success, joint_positions: q, position_error, rotation_error, reason, branches }
}
