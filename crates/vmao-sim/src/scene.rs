//! A scene: arms around a table, one object, the compiled simulator model and who owns which of its geoms.

use crate::convention::{Data, ball_joint_position, compile};
use crate::dependency_root::Root;
use crate::error::Error;
use crate::layout::{BasePlacement, Layout, Spacing, base_poses};
use crate::mjcf;
use crate::reachability;

use mujoco_rs::wrappers::mj_model::{MjModel, MjtObjBase};
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use std::sync::{Arc, OnceLock};
use vmao_core::catalogue::CatalogueItem;
use vmao_core::contact::{ArmId, ContactTuple, PartId};
use vmao_core::geometry::{Pose, rotation_exp};
use vmao_core::inverse_kinematics::InverseKinematics;
use vmao_core::object::{ArticulatedObject, Joint, JointKind};
use vmao_core::object_graph::ObjectGraph;
use vmao_core::osc::{JOINTS, JointLimits, JointVector};
use vmao_core::robots::RobotModel;

/// Coulomb friction coefficients of a surface. In a contact the larger of the two surfaces' values counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// Sliding (–).
    pub sliding: f64,
    /// Torsional (m).
    pub torsional: f64,
    /// Rolling (m).
    pub rolling: f64,
}

impl Friction {
    pub(crate) fn mjcf(&self) -> String {
        format!("{} {} {}", self.sliding, self.torsional, self.rolling)
    }
}

/// Physics and placement of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneConfig {
    /// How the arms stand.
    pub layout: Layout,
    /// Distance of the bases from the table's centre line, or from its centre in a ring (m).
    pub base_distance: f64,
    /// Distance between neighbours on one side (m).
    pub base_spacing: f64,
    /// Where the bases stand in the layout `explicit`; empty in all others.
    pub bases: Vec<BasePlacement>,
    /// Simulated time per step (s).
    pub timestep: f64,
    /// MuJoCo's `impratio`: how much stiffer friction is than the normal direction.
    pub friction_impedance_ratio: f64,
    /// MuJoCo's `noslip_iterations` where a gripper's pad is narrower than `noslip_pad_width`; elsewhere none.
    pub noslip_iterations: u32,
    /// Width of pads below which what they hold turns unless noslip keeps it (m).
    pub noslip_pad_width: f64,
    /// MuJoCo's `noslip_tolerance`: noslip ends when an iteration improves by less.
    pub noslip_tolerance: f64,
    /// MuJoCo's `sleep_tolerance` (m/s): an object at rest is not simulated until something touches it; 0 for never.
    pub sleep_tolerance: f64,
    /// Friction of the gripper pads.
    pub pad_friction: Friction,
    /// Friction of the object.
    pub object_friction: Friction,
    /// Friction of the table.
    pub table_friction: Friction,
    /// Friction of the arms' links.
    pub link_friction: Friction,
}

/// Who owns a geom.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Owner {
    Table,
    Link(ArmId),
    Pad(ArmId, usize),
    Part(PartId),
}

/// Simulator indices of an arm.
#[derive(Debug, Clone)]
pub(crate) struct ArmIndex {
    /// Joint ids of the seven joints.
    pub(crate) joints: Vec<usize>,
    /// Addresses of the first joint and of finger 1 in qpos, qvel and ctrl.
    pub(crate) qpos: usize,
    pub(crate) dof: usize,
    pub(crate) ctrl: usize,
    pub(crate) finger_qpos: usize,
    pub(crate) hand_body: usize,
    pub(crate) bodies: Vec<usize>,
    pub(crate) limits: JointLimits,
}

/// A compiled scene; shared by all trials that run on it.
#[derive(Debug)]
pub struct Scene {
    /// The arms, by [`ArmId`].
    pub robots: Vec<RobotModel>,
    /// Where they stand.
    pub world_from_bases: Vec<Pose>,
    /// The object.
    pub object: ArticulatedObject,
    /// Known ways to hold it (Algorithm 1's D).
    pub demonstrations: Vec<ContactTuple>,
    /// Where the demonstrations hold each part on average, part frame (m).
    pub(crate) hold_centers: Vec<Point3<f64>>,
    /// Where the demonstrations put finger 1 and finger 2 on each part on average, part frame (m).
    pub(crate) hold_fingers: Vec<[Point3<f64>; 2]>,
    /// Its graph.
    pub graph: ObjectGraph,
    /// The dependency root of its motions; part 0 unless chosen by [`Scene::with_root`].
    pub root: Root,
    /// The model as MJCF.
    pub mjcf: String,
    /// Simulated time per step (s).
    pub timestep: f64,
    pub(crate) model: Arc<MjModel>,
    pub(crate) arms: Vec<ArmIndex>,
    pub(crate) part_bodies: Vec<usize>,
    /// Centre of mass of each part, part frame (m).
    pub(crate) mass_centers: Vec<Point3<f64>>,
    pub(crate) object_qpos: usize,
    pub(crate) object_dof: usize,
    /// (qpos address, dof address) of each object joint; none for fixed joints.
    pub(crate) joint_addresses: Vec<Option<(usize, usize)>>,
    pub(crate) owners: Vec<Owner>,
    /// Made when it is first asked for: most uses of a scene never do.
    inverse_kinematics: OnceLock<Vec<Arc<InverseKinematics>>>,
}

impl Scene {
    /// Compiles the scene. Fails if the arms are fewer than the parts or cannot be placed, or the simulator refuses the model.
    pub fn new(config: &SceneConfig, robots: Vec<RobotModel>, item: CatalogueItem) -> Result<Self, Error> {
        if robots.len() < item.object.parts.len() {
            return Err(Error::ArmCount { arms: robots.len(), parts: item.object.parts.len(), object: item.object.name });
        }
        let spacing = Spacing { distance: config.base_distance, between: config.base_spacing };
        let world_from_bases = base_poses(config.layout, spacing, &config.bases, &robots)?;
        let scene = Self::compile(config, robots, world_from_bases, item)?;
        scene.check_placement()?;
        Ok(scene)
    }

    /// Refuses arms that stand in each other or in the table while they are at home.
    fn check_placement(&self) -> Result<(), Error> {
        const DEEP: f64 = 0.005; // m: more than a link that rests on the table
        let mut data = Data::new(self.model.clone());
        for (arm, robot) in self.arms.iter().zip(&self.robots) {
            data.qpos_mut()[arm.qpos..arm.qpos + JOINTS].copy_from_slice(&robot.home);
        }
        data.forward();
        for contact in data.contact().iter().filter(|contact| contact.dist < -DEEP) {
            let [first, second] = contact.geom.map(|geom| match self.owners[geom as usize] {
                Owner::Link(arm) | Owner::Pad(arm, _) => Some(format!("arm {}", arm.0)),
                Owner::Table => Some("the table".to_owned()),
                Owner::Part(_) => None,
            });
            if let (Some(first), Some(second)) = (first, second)
                && first != second
            {
                let depth = -contact.dist * 1e3;
                let cause = format!("{first} and {second} overlap by {depth:.0} mm at home, expected bases that keep them apart");
                return Err(Error::Placement { cause });
            }
        }
        Ok(())
    }

    /// The object alone on the table: for what needs no arms.
    pub(crate) fn without_arms(config: &SceneConfig, item: CatalogueItem) -> Result<Self, Error> {
        Self::compile(config, Vec::new(), Vec::new(), item)
    }

    fn compile(
        config: &SceneConfig,
        robots: Vec<RobotModel>,
        world_from_bases: Vec<Pose>,
        item: CatalogueItem,
    ) -> Result<Self, Error> {
        let hold_fingers = hold_fingers(&item);
        let hold_centers = hold_fingers.iter().map(|[a, b]| nalgebra::center(a, b)).collect();
        let CatalogueItem { object, demonstrations } = item;
        let graph = ObjectGraph::of(&object).map_err(|cause| Error::Object { name: object.name.clone(), cause })?;
        let mjcf = mjcf::scene(config, &robots, &world_from_bases, &object, &[]);
        let model = compile(&mjcf).map_err(|cause| Error::Model { cause })?;
        let arms = robots.iter().enumerate().map(|(arm, robot)| arm_index(&model, arm, robot)).collect::<Result<Vec<_>, _>>()?;
        let part_bodies = object
            .parts
            .iter()
            .map(|part| id(&model, MjtObjBase::mjOBJ_BODY, &mjcf::part_name(&part.name)))
            .collect::<Result<Vec<_>, _>>()?;
        let mass_centers = part_bodies.iter().map(|&body| model.body_ipos()[body].into()).collect();
        let (object_qpos, object_dof) = addresses(&model, "object")?;
        let joint_addresses = object
            .joints
            .iter()
            .map(|joint| match joint.kind {
                JointKind::Fixed => Ok(None),
                _ => addresses(&model, &mjcf::part_name(&joint.name)).map(Some),
            })
            .collect::<Result<Vec<_>, _>>()?;
        let owners = owners(&model, &arms, &part_bodies)?;
        Ok(Self {
            robots,
            world_from_bases,
            object,
            demonstrations,
            hold_centers,
            hold_fingers,
            graph,
            root: Root::Part(PartId(0)),
            mjcf,
            timestep: config.timestep,
            model: Arc::new(model),
            arms,
            part_bodies,
            mass_centers,
            object_qpos,
            object_dof,
            joint_addresses,
            owners,
            inverse_kinematics: OnceLock::new(),
        })
    }
}

impl Scene {
    /// The same scene with another dependency root: `first`, `auto`, or a part's name. Fails on other names.
    pub fn with_root(mut self, name: &str) -> Result<Self, Error> {
        self.root = Root::named(&self.object, name)?;
        Ok(self)
    }

    /// Inverse kinematics of every arm, for many poses.
    pub(crate) fn inverse_kinematics(&self) -> &[Arc<InverseKinematics>] {
        self.inverse_kinematics.get_or_init(|| reachability::prepared(&self.robots))
    }

    /// Writes the object's joint positions (rad or m, flat) into the simulator's coordinates.
    pub(crate) fn set_object_joints(&self, qpos: &mut [f64], joint_positions: &[f64]) {
        let positions: Vec<(&Joint, &[f64])> = self.object.positions_by_joint(joint_positions).collect();
        // The simulator's tree is rooted at part 0, whatever root control uses.
        for step in self.graph.outward(PartId(0)) {
            let (joint, position) = positions[step.joint];
            let Some((address, _)) = self.joint_addresses[step.joint] else { continue };
            if joint.kind == JointKind::Ball {
                let turn = rotation_exp(&(Vector3::from_column_slice(position) * step.direction.sign()));
                qpos[address..address + 4].copy_from_slice(&ball_joint_position(&turn));
            } else {
                qpos[address] = position[0];
            }
        }
    }
}

/// The means of all demonstrated points of finger 1 and of finger 2 on each part; the part's origin where there is none.
fn hold_fingers(item: &CatalogueItem) -> Vec<[Point3<f64>; 2]> {
    let mean = |part: usize, finger: usize| {
        let contacts = item.demonstrations.iter().flatten().filter(|contact| usize::from(contact.part.0) == part);
        let points: Vec<Vector3<f64>> = contacts.map(|contact| contact.fingers[finger].coords).collect();
        Point3::from(points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64)
    };
    (0..item.object.parts.len()).map(|part| [mean(part, 0), mean(part, 1)]).collect()
}

fn id(model: &MjModel, kind: MjtObjBase, name: &str) -> Result<usize, Error> {
    model.name_to_id(kind, name).ok_or_else(|| Error::Model { cause: format!("the compiled model has no `{name}`") })
}

pub(crate) fn addresses(model: &MjModel, joint: &str) -> Result<(usize, usize), Error> {
    let joint = id(model, MjtObjBase::mjOBJ_JOINT, joint)?;
    Ok((model.jnt_qposadr()[joint] as usize, model.jnt_dofadr()[joint] as usize))
}

fn arm_index(model: &MjModel, arm: usize, robot: &RobotModel) -> Result<ArmIndex, Error> {
    let joint_name = |index: usize| mjcf::arm_name(arm, &format!("joint{}", index + 1));
    if robot.joints.len() != JOINTS {
        return Err(Error::Model {
            cause: format!("robot `{}` has {} joints; arms have {JOINTS}", robot.name, robot.joints.len()),
        });
    }
    let joints =
        (0..JOINTS).map(|index| id(model, MjtObjBase::mjOBJ_JOINT, &joint_name(index))).collect::<Result<Vec<_>, _>>()?;
    let (qpos, dof) = addresses(model, &joint_name(0))?;
    let (finger_qpos, _) = addresses(model, &mjcf::arm_name(arm, "finger1"))?;
    let gripper = &robot.gripper;
    let mut names = vec![robot.base.name];
    names.extend(robot.joints.iter().map(|joint| joint.link.name));
    names.push(gripper.hand.name);
    names.extend(gripper.fingers.iter().map(|finger| finger.link.name));
    let bodies =
        names.iter().map(|name| id(model, MjtObjBase::mjOBJ_BODY, &mjcf::arm_name(arm, name))).collect::<Result<Vec<_>, _>>()?;
    Ok(ArmIndex {
        joints,
        qpos,
        dof,
        ctrl: id(model, MjtObjBase::mjOBJ_ACTUATOR, &joint_name(0))?,
        finger_qpos,
        hand_body: id(model, MjtObjBase::mjOBJ_BODY, &mjcf::arm_name(arm, gripper.hand.name))?,
        bodies,
        limits: JointLimits {
            torque: JointVector::from_iterator(robot.joints.iter().map(|joint| joint.max_torque)),
            velocity: JointVector::from_iterator(robot.joints.iter().map(|joint| joint.max_velocity)),
        },
    })
}

fn owners(model: &MjModel, arms: &[ArmIndex], part_bodies: &[usize]) -> Result<Vec<Owner>, Error> {
    let mut owners = Vec::new();
    for (geom, &body) in model.geom_bodyid().iter().enumerate() {
        let body = body as usize;
        let arm = arms.iter().position(|arm| arm.bodies.contains(&body));
        let part = part_bodies.iter().position(|&part| part == body);
        owners.push(match (arm, part) {
            (Some(arm), _) => {
                let pad = |finger: usize| model.name_to_id(MjtObjBase::mjOBJ_GEOM, &mjcf::arm_name(arm, &format!("pad{finger}")));
                match (1..=2).find(|&finger| pad(finger) == Some(geom)) {
                    Some(finger) => Owner::Pad(ArmId(arm as u16), finger - 1),
                    None => Owner::Link(ArmId(arm as u16)),
                }
            }
            (None, Some(part)) => Owner::Part(PartId(part as u16)),
            (None, None) => Owner::Table,
        });
    }
    Ok(owners)
}
