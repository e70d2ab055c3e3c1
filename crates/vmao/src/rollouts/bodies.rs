//! What moves in a packed rollout: names, solids and mounts, mostly the same text for all motions of the same things.

use super::mounts::{FURTHEST, Motion, fit};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use vmao_core::{
    geometry::{Pose, pose, position_quaternion},
    observation::PointLabel,
    rollout::{Rollout, RolloutBody},
    shape::{Shape, Solid},
};

/// Columns of a pose: position x, y, z and quaternion w, x, y, z.
pub(super) const POSE: usize = 7;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PackedBody {
    name: String,
    kind: Kind,
    index: u16,
    pub(super) mount: Mount,
    solids: Vec<PackedSolid>,
}

/// What a body moves with, and how.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mount {
    /// An earlier body; none is the world.
    pub(super) on: Option<usize>,
    /// The body's pose in the frame of what carries it, with the joint at zero; of no meaning where it is free.
    pub(super) pose: [f64; POSE],
    pub(super) motion: Motion,
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

impl PackedBody {
    pub(super) fn new(body: &RolloutBody, mount: Mount) -> Self {
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
        Self { name: body.name.clone(), kind, index, mount, solids: body.solids.iter().map(solid).collect() }
    }

    /// The body again; says what is wrong with one that no trial had.
    pub(super) fn body(self) -> Result<RolloutBody, String> {
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

impl Mount {
    /// Says what is wrong with the mount of a body that no trial had; `body` is its place in the list.
    pub(super) fn check(&self, body: usize) -> Result<(), String> {
        let unit = |axis: [f64; 3]| (Vector3::from(axis).norm() - 1.0).abs() < 1e-6;
        let is_joint = match self.motion {
            Motion::Fixed | Motion::Free => true,
            Motion::Slides { axis } => unit(axis),
            Motion::Turns { axis, anchor } => unit(axis) && Vector3::from(anchor).norm() <= FURTHEST,
        };
        if self.on.is_some_and(|on| on >= body) || !self.pose.iter().all(|x| x.is_finite()) || !is_joint {
            let what = "expected a body before it, a finite pose, an axis of length one and a near anchor";
            return Err(format!("body {body} is mounted on {:?} with {:?}, {what}", self.on, self.motion));
        }
        Ok(())
    }

    /// How a body of `rollout` moves, and its joint over the first `frames` frames; no values where it is free or at rest.
    ///
    /// Links move with the one before them, parts with one before them of the same object, and what moves with nothing in the world.
    pub(super) fn find(rollout: &Rollout, body: usize, frames: usize) -> (Self, Vec<f64>) {
        let label = |body: usize| rollout.bodies[body].label;
        let together = |other: &usize| match (label(*other), label(body)) {
            (PointLabel::Arm(other), PointLabel::Arm(own)) => other == own,
            (PointLabel::Part(_), PointLabel::Part(_)) => true,
            _ => false,
        };
        let carriers = (0..body).rev().filter(together).map(Some).chain([None]);
        for on in carriers {
            let seen = |frame: &Vec<Pose>| on.map_or(frame[body], |carrier| frame[carrier].inv_mul(&frame[body]));
            let poses: Vec<Pose> = rollout.frames[..frames].iter().map(seen).collect();
            if let Some(fit) = fit(&poses) {
                return (Self { on, pose: seven(&fit.pose), motion: fit.motion }, fit.values);
            }
        }
        (Self { on: None, pose: seven(&Pose::identity()), motion: Motion::Free }, Vec::new())
    }
}

/// Position (m), then the quaternion w, x, y, z.
pub(super) fn seven(pose: &Pose) -> [f64; POSE] {
    let ([x, y, z], [w, i, j, k]) = position_quaternion(pose);
    [x, y, z, w, i, j, k]
}

pub(super) fn from_seven(&[x, y, z, w, i, j, k]: &[f64; POSE]) -> Pose {
    // A quaternion of zeros stands for no rotation.
    let w = if w * w + i * i + j * j + k * k > 0.0 { w } else { 1.0 };
    pose([x, y, z], [w, i, j, k])
}
