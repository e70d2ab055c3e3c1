//! A rollout in few bytes: as `report.html` carries it and as a run keeps it.

use super::bodies::{Mount, POSE, PackedBody, from_seven, seven};
use super::columns::{Columns, push_column, squeeze, unfold};
use super::mounts::{Motion, displacement};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::io;
use vmao_core::{
    geometry::Pose,
    observation::PointLabel,
    rollout::{PadForce, Rollout, RolloutContact, RolloutEvent},
};

/// What a stored unit is: of positions (m), of a joint's angle (rad), of a quaternion's components, of points and forces of pads (m, N).
const POSITION_STEP: f64 = 2e-4;
const ANGLE_STEP: f64 = 1e-3;
const QUATERNION_STEP: f64 = 1.0 / 2048.0;
const POINT_STEP: f64 = 1e-3;
const FORCE_STEP: f64 = 0.1;
/// Frames that share one force, their mean: what stiff bodies do from frame to frame is noise, which cannot be packed.
const FORCE_FRAMES: usize = 4;
/// Most poses of one rollout: half an hour of six arms has fewer.
const MAX_POSES: usize = 1 << 22;
/// Columns of a pad's force.
const PAD: usize = 6;

/// A rollout whose long lists are packed: joints to half a milliradian, so that hands are where they were to about a millimetre.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedRollout {
    /// What moves, and with what: a packed JSON list, mostly equal for all trials with the same things.
    pub bodies: String,
    /// How many bodies there are.
    pub body_count: usize,
    /// How many arms have forces; none in rollouts that recorded none.
    pub arms: usize,
    /// Frames.
    pub frames: usize,
    /// Simulated time between frames (s).
    pub frame_seconds: f64,
    /// Packed columns over all frames: for each body with a joint its angle (rad) or length (m), for each free one its
    /// position x, y, z and quaternion w, x, y, z in the world.
    pub motion: String,
    /// Packed columns, one value for every four frames: for each arm and pad its point x, y, z and force x, y, z.
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

impl PackedRollout {
    /// Packs a rollout; a frame that lacks a body ends the motion.
    pub fn pack(rollout: &Rollout) -> io::Result<Self> {
        let body_count = rollout.bodies.len();
        let frames = rollout.frames.iter().take_while(|frame| frame.len() == body_count).count();
        let (mut motion, mut bodies) = (Vec::new(), Vec::with_capacity(body_count));
        for (body, described) in rollout.bodies.iter().enumerate() {
            let (mount, values) = Mount::find(rollout, body, frames);
            match mount.motion {
                Motion::Fixed => (),
                Motion::Turns { .. } => push_column(&mut motion, values.into_iter(), ANGLE_STEP),
                Motion::Slides { .. } => push_column(&mut motion, values.into_iter(), POSITION_STEP),
                Motion::Free => push_poses(&mut motion, rollout.frames[..frames].iter().map(|frame| &frame[body])),
            }
            bodies.push(PackedBody::new(described, mount));
        }
        let arms = rollout.forces.first().map_or(0, Vec::len);
        let whole = rollout.forces.len() >= frames && rollout.forces.iter().all(|frame| frame.len() == arms);
        let arms = if whole { arms } else { 0 };
        let mut forces = Vec::new();
        for (arm, pad) in (0..arms).flat_map(|arm| [(arm, 0), (arm, 1)]) {
            let means: Vec<PadForce> = rollout.forces[..frames]
                .chunks(FORCE_FRAMES)
                .map(|frames| mean(frames.iter().map(|frame| &frame[arm][pad])))
                .collect();
            let points = held_points(&means);
            for axis in 0..3 {
                push_column(&mut forces, points.iter().map(|point| point[axis]), POINT_STEP);
            }
            for axis in 0..3 {
                push_column(&mut forces, means.iter().map(|mean| mean.force[axis]), FORCE_STEP);
            }
        }
        Ok(Self {
            bodies: squeeze(&serde_json::to_vec(&bodies)?)?,
            body_count,
            arms,
            frames,
            frame_seconds: rollout.frame_seconds,
            motion: squeeze(&motion)?,
            forces: squeeze(&forces)?,
            goal: rollout.goal.iter().map(|pose| seven(pose).map(short)).collect(),
            events: rollout.events.clone(),
            contacts: rollout.contacts.iter().map(shortened).collect(),
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
        let packed: Vec<PackedBody> = serde_json::from_slice(&bodies).map_err(|error| format!("bodies: {error}"))?;
        if packed.len() != self.body_count {
            return Err(format!("bodies: {}, expected body_count, {}", packed.len(), self.body_count));
        }
        // What rests has no columns whose length would show that this one lies.
        if self.frames.checked_mul(packed.len().max(1)).is_none_or(|poses| poses > MAX_POSES) {
            return Err(format!("frames: {} of {} bodies, expected at most {MAX_POSES} poses", self.frames, packed.len()));
        }
        if self.arms > packed.len() {
            return Err(format!("forces: {} arms of {} bodies", self.arms, packed.len()));
        }
        let frames = self.unpacked_frames(&packed)?;
        let bodies = packed.into_iter().map(PackedBody::body).collect::<Result<Vec<_>, _>>().map_err(named("bodies"))?;
        let parts = bodies.iter().filter(|body| matches!(body.label, PointLabel::Part(_))).count();
        if self.goal.len() != parts || self.goal.iter().flatten().any(|x| !x.is_finite()) {
            return Err(format!("goal: {} poses, expected {parts} finite ones", self.goal.len()));
        }
        Ok(Rollout {
            frame_seconds: self.frame_seconds,
            frames,
            goal: self.goal.iter().map(from_seven).collect(),
            events: self.events.clone(),
            contacts: self.contacts.clone(),
            forces: self.unpacked_forces().map_err(named("forces"))?,
            outcome: self.outcome.clone(),
            bodies,
        })
    }

    /// The world poses of all bodies, frame by frame.
    fn unpacked_frames(&self, bodies: &[PackedBody]) -> Result<Vec<Vec<Pose>>, String> {
        let named = |problem: String| format!("motion: {problem}");
        let bytes = unfold(&self.motion).map_err(named)?;
        let mut columns = Columns::new(&bytes);
        let mut poses: Vec<Vec<Pose>> = Vec::with_capacity(bodies.len());
        for (body, PackedBody { mount, .. }) in bodies.iter().enumerate() {
            mount.check(body).map_err(|problem| format!("bodies: {problem}"))?;
            let zero = from_seven(&mount.pose);
            let mut joint = |step| columns.column(self.frames, step).map_err(named);
            let seen: Vec<Pose> = match mount.motion {
                Motion::Fixed => vec![zero; self.frames],
                Motion::Turns { .. } => {
                    joint(ANGLE_STEP)?.into_iter().map(|angle| zero * displacement(&mount.motion, angle)).collect()
                }
                Motion::Slides { .. } => {
                    joint(POSITION_STEP)?.into_iter().map(|length| zero * displacement(&mount.motion, length)).collect()
                }
                Motion::Free => {
                    let step = |column| if column < 3 { POSITION_STEP } else { QUATERNION_STEP };
                    let columns: Vec<Vec<f64>> = (0..POSE).map(|column| joint(step(column))).collect::<Result<_, _>>()?;
                    (0..self.frames).map(|frame| from_seven(&std::array::from_fn(|k| columns[k][frame]))).collect()
                }
            };
            poses.push(match mount.on {
                Some(on) => poses[on].iter().zip(&seen).map(|(carrier, seen)| carrier * seen).collect(),
                None => seen,
            });
        }
        columns.end().map_err(named)?;
        Ok((0..self.frames).map(|frame| poses.iter().map(|poses| poses[frame]).collect()).collect())
    }

    fn unpacked_forces(&self) -> Result<Vec<Vec<[PadForce; 2]>>, String> {
        let bytes = unfold(&self.forces)?;
        let mut columns = Columns::new(&bytes);
        let mut pads = Vec::new();
        for _ in (0..self.arms).flat_map(|_| [0, 1]) {
            let column =
                |column| columns.column(self.frames.div_ceil(FORCE_FRAMES), if column < 3 { POINT_STEP } else { FORCE_STEP });
            pads.push((0..PAD).map(column).collect::<Result<Vec<Vec<f64>>, _>>()?);
        }
        columns.end()?;
        let pad = |arm: usize, pad: usize, frame: usize| {
            let value = |column: usize| pads[2 * arm + pad][column][frame / FORCE_FRAMES];
            PadForce { point: [0, 1, 2].map(value), force: [3, 4, 5].map(value) }
        };
        let frame = |frame| (0..self.arms).map(|arm| [pad(arm, 0, frame), pad(arm, 1, frame)]).collect();
        Ok((0..self.frames).map(frame).collect())
    }
}

/// Columns of poses; of a quaternion's two signs the one nearest to the frame before, as both are one rotation.
fn push_poses<'p>(bytes: &mut Vec<u8>, poses: impl Iterator<Item = &'p Pose>) {
    let mut poses: Vec<[f64; POSE]> = poses.map(seven).collect();
    for frame in 1..poses.len() {
        let (before, now) = (&poses[frame - 1][3..], &poses[frame][3..]);
        if before.iter().zip(now).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
            poses[frame][3..].iter_mut().for_each(|x| *x = -*x);
        }
    }
    for column in 0..POSE {
        push_column(bytes, poses.iter().map(|pose| pose[column]), if column < 3 { POSITION_STEP } else { QUATERNION_STEP });
    }
}

/// The mean of a pad's forces, at the middle of their points weighted by force.
fn mean<'f>(forces: impl ExactSizeIterator<Item = &'f PadForce>) -> PadForce {
    let count = forces.len() as f64;
    let (mut force, mut point, mut weight) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    for each in forces {
        let now = Vector3::from(each.force);
        force += now;
        point += Vector3::from(each.point) * now.norm();
        weight += now.norm();
    }
    if weight == 0.0 {
        return PadForce::default();
    }
    PadForce { point: (point / weight).into(), force: (force / count).into() }
}

/// A number in few digits: a hundredth of a millimetre.
fn short(value: f64) -> f64 {
    (value * 1e5).round() / 1e5
}

fn shortened(contact: &RolloutContact) -> RolloutContact {
    RolloutContact { fingers: contact.fingers.map(|point| point.map(short)), ..contact.clone() }
}

/// A pad's points; without contact it stays where it was, which takes no room.
fn held_points(forces: &[PadForce]) -> Vec<[f64; 3]> {
    let mut last = [0.0; 3];
    let mut point = |force: &PadForce| {
        if force.force != [0.0; 3] {
            last = force.point;
        }
        last
    };
    forces.iter().map(&mut point).collect()
}
