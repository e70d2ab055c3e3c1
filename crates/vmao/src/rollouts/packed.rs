//! A rollout in few bytes: as `report.html` carries it and as a run keeps it.

use super::columns::{Columns, push_column, squeeze, unfold};
use serde::{Deserialize, Serialize};
use std::io;
use vmao_core::{
    geometry::{Pose, pose, position_quaternion},
    observation::PointLabel,
    rollout::{PadForce, Rollout, RolloutBody, RolloutContact, RolloutEvent},
    shape::{Shape, Solid},
};

/// What a stored unit is: of positions (m), of a quaternion's components, of forces (N).
const POSITION_STEP: f64 = 1e-4;
const QUATERNION_STEP: f64 = 1.0 / 16384.0;
const FORCE_STEP: f64 = 0.01;
/// Columns of a pose and of a pad's force.
const POSE: usize = 7;
const PAD: usize = 6;

/// A rollout whose long lists are packed: poses to 0.05 mm and 0.006°, forces to 5 mN.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedRollout {
    /// What moves: a packed JSON list.
    pub bodies: String,
    /// How many bodies there are.
    pub body_count: usize,
    /// How many arms have forces; none in rollouts that recorded none.
    pub arms: usize,
    /// Frames.
    pub frames: usize,
    /// Simulated time between frames (s).
    pub frame_seconds: f64,
    /// Packed columns: for each body its position x, y, z and quaternion w, x, y, z over all frames.
    pub motion: String,
    /// Packed columns: for each arm and pad its point x, y, z and force x, y, z over all frames.
    pub forces: String,
    /// Goal of each part: position (m), then the quaternion w, x, y, z.
    pub goal: Vec<[f64; POSE]>,
    /// The stages, in time order.
    pub events: Vec<RolloutEvent>,
    /// Where fingers were asked to touch.
    pub contacts: Vec<RolloutContact>,
    /// The outcome in words.
    pub outcome: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PackedBody {
    name: String,
    kind: Kind,
    index: u16,
    solids: Vec<PackedSolid>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Table,
    Arm,
    Part,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PackedSolid {
    shape: Shape,
    pose: [f64; POSE],
    color: [f32; 3],
}

impl PackedRollout {
    /// Packs a rollout; a frame that lacks a body ends the motion.
    pub fn pack(rollout: &Rollout) -> io::Result<Self> {
        let body_count = rollout.bodies.len();
        let frames: Vec<Vec<[f64; POSE]>> = rollout
            .frames
            .iter()
            .take_while(|frame| frame.len() == body_count)
            .map(|frame| frame.iter().map(seven).collect())
            .collect();
        let mut motion = Vec::new();
        for body in 0..body_count {
            let signs = continuous(&frames, body);
            for column in 0..POSE {
                let (step, turned) = if column < 3 { (POSITION_STEP, false) } else { (QUATERNION_STEP, true) };
                let value = |(frame, sign): (&Vec<[f64; POSE]>, &f64)| frame[body][column] * if turned { *sign } else { 1.0 };
                push_column(&mut motion, frames.iter().zip(&signs).map(value), step);
            }
        }
        let arms = rollout.forces.first().map_or(0, Vec::len);
        let whole = rollout.forces.len() >= frames.len() && rollout.forces.iter().all(|frame| frame.len() == arms);
        let arms = if whole { arms } else { 0 };
        let mut forces = Vec::new();
        for (arm, pad) in (0..arms).flat_map(|arm| [(arm, 0), (arm, 1)]) {
            let points = held_points(rollout.forces[..frames.len()].iter().map(|frame| &frame[arm][pad]));
            for axis in 0..3 {
                push_column(&mut forces, points.iter().map(|point| point[axis]), POSITION_STEP);
            }
            for axis in 0..3 {
                let force = |frame: &Vec<[PadForce; 2]>| frame[arm][pad].force[axis];
                push_column(&mut forces, rollout.forces[..frames.len()].iter().map(force), FORCE_STEP);
            }
        }
        let bodies: Vec<PackedBody> = rollout.bodies.iter().map(PackedBody::new).collect();
        Ok(Self {
            bodies: squeeze(&serde_json::to_vec(&bodies)?)?,
            body_count,
            arms,
            frames: frames.len(),
            frame_seconds: rollout.frame_seconds,
            motion: squeeze(&motion)?,
            forces: squeeze(&forces)?,
            goal: rollout.goal.iter().map(seven).collect(),
            events: rollout.events.clone(),
            contacts: rollout.contacts.clone(),
            outcome: rollout.outcome.clone(),
        })
    }

    /// The rollout again; says what is wrong with one that no trial made.
    pub fn unpack(&self) -> Result<Rollout, String> {
        let named = |name: &'static str| move |problem: String| format!("{name}: {problem}");
        if !(self.frame_seconds.is_finite() && self.frame_seconds > 0.0) {
            return Err(format!("frame_seconds: {}, expected a time above zero", self.frame_seconds));
        }
        let bodies = unfold(&self.bodies).map_err(named("bodies"))?;
        let bodies: Vec<PackedBody> = serde_json::from_slice(&bodies).map_err(|error| format!("bodies: {error}"))?;
        if bodies.len() != self.body_count {
            return Err(format!("bodies: {}, expected body_count, {}", bodies.len(), self.body_count));
        }
        let bodies = bodies.into_iter().map(PackedBody::body).collect::<Result<Vec<_>, _>>().map_err(named("bodies"))?;
        let motion = unfold(&self.motion).map_err(named("motion"))?;
        let mut columns = Columns::new(&motion);
        let mut poses: Vec<Vec<Vec<f64>>> = Vec::with_capacity(bodies.len());
        for _ in 0..bodies.len() {
            let column = |column| columns.column(self.frames, if column < 3 { POSITION_STEP } else { QUATERNION_STEP });
            poses.push((0..POSE).map(column).collect::<Result<_, _>>().map_err(named("motion"))?);
        }
        columns.end().map_err(named("motion"))?;
        let at = |frame: usize| poses.iter().map(|columns| from_seven(&std::array::from_fn(|k| columns[k][frame]))).collect();
        let parts = bodies.iter().filter(|body| matches!(body.label, PointLabel::Part(_))).count();
        if self.goal.len() != parts || self.goal.iter().flatten().any(|x| !x.is_finite()) {
            return Err(format!("goal: {} poses, expected {parts} finite ones", self.goal.len()));
        }
        Ok(Rollout {
            frame_seconds: self.frame_seconds,
            frames: (0..self.frames).map(at).collect(),
            goal: self.goal.iter().map(from_seven).collect(),
            events: self.events.clone(),
            contacts: self.contacts.clone(),
            forces: self.unpacked_forces().map_err(named("forces"))?,
            outcome: self.outcome.clone(),
            bodies,
        })
    }

    fn unpacked_forces(&self) -> Result<Vec<Vec<[PadForce; 2]>>, String> {
        let bytes = unfold(&self.forces)?;
        let mut columns = Columns::new(&bytes);
        let mut pads = Vec::new();
        for _ in (0..self.arms).flat_map(|_| [0, 1]) {
            let column = |column| columns.column(self.frames, if column < 3 { POSITION_STEP } else { FORCE_STEP });
            pads.push((0..PAD).map(column).collect::<Result<Vec<Vec<f64>>, _>>()?);
        }
        columns.end()?;
        let pad = |arm: usize, pad: usize, frame: usize| {
            let value = |column: usize| pads[2 * arm + pad][column][frame];
            PadForce { point: [0, 1, 2].map(value), force: [3, 4, 5].map(value) }
        };
        let frame = |frame| (0..self.arms).map(|arm| [pad(arm, 0, frame), pad(arm, 1, frame)]).collect();
        Ok((0..self.frames).map(frame).collect())
    }
}

impl PackedBody {
    fn new(body: &RolloutBody) -> Self {
        let (kind, index) = match body.label {
            PointLabel::Table => (Kind::Table, 0),
            PointLabel::Arm(index) => (Kind::Arm, index),
            PointLabel::Part(index) => (Kind::Part, index),
        };
        let solid = |solid: &Solid| PackedSolid {
            shape: solid.shape.clone(),
            pose: seven(&solid.carrier_from_solid),
            color: solid.color,
        };
        Self { name: body.name.clone(), kind, index, solids: body.solids.iter().map(solid).collect() }
    }

    fn body(self) -> Result<RolloutBody, String> {
        let label = match self.kind {
            Kind::Table => PointLabel::Table,
            Kind::Arm => PointLabel::Arm(self.index),
            Kind::Part => PointLabel::Part(self.index),
        };
        let solid = |solid: PackedSolid| {
            let size = solid.shape.volume();
            if !(size > 0.0 && size.is_finite() && solid.pose.iter().all(|x| x.is_finite())) {
                return Err(format!("{}: a solid of {size} m³, expected a finite one with a finite pose", self.name));
            }
            Ok(Solid { shape: solid.shape, carrier_from_solid: from_seven(&solid.pose), color: solid.color })
        };
        Ok(RolloutBody { label, solids: self.solids.into_iter().map(solid).collect::<Result<_, _>>()?, name: self.name })
    }
}

/// Position (m), then the quaternion w, x, y, z.
fn seven(pose: &Pose) -> [f64; POSE] {
    let ([x, y, z], [w, i, j, k]) = position_quaternion(pose);
    [x, y, z, w, i, j, k]
}

fn from_seven(&[x, y, z, w, i, j, k]: &[f64; POSE]) -> Pose {
    // A quaternion of zeros stands for no rotation.
    let w = if w * w + i * i + j * j + k * k > 0.0 { w } else { 1.0 };
    pose([x, y, z], [w, i, j, k])
}

/// For each frame the sign of a body's quaternion that is nearest to the frame before: both signs are one rotation.
fn continuous(frames: &[Vec<[f64; POSE]>], body: usize) -> Vec<f64> {
    let mut sign = 1.0;
    let mut signs = vec![sign; frames.len()];
    for frame in 1..frames.len() {
        let (before, now) = (&frames[frame - 1][body][3..], &frames[frame][body][3..]);
        if before.iter().zip(now).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
            sign = -sign;
        }
        signs[frame] = sign;
    }
    signs
}

/// A pad's points; without contact it stays where it was, which takes no room.
fn held_points<'f>(forces: impl Iterator<Item = &'f PadForce>) -> Vec<[f64; 3]> {
    let mut last = [0.0; 3];
    let mut point = |force: &PadForce| {
        if force.force != [0.0; 3] {
            last = force.point;
        }
        last
    };
    forces.map(&mut point).collect()
}
