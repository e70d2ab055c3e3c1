//! MuJoCo's own collision detection as a judge of paths: arms and obstacles alone, nothing shared with the planner's check
//! but the description of the robots.

use crate::{
    convention::{Data, compile},
    error::Error,
    mjcf,
    scene::{SceneConfig, addresses},
};
use mujoco_rs::wrappers::mj_model::{MjModel, MjtObjBase};
use std::sync::Arc;
use vmao_core::{collision::Obstacle, geometry::Pose, robots::RobotModel};

/// Two geoms that overlap.
#[derive(Debug, Clone, PartialEq)]
pub struct Overlap {
    /// Names of the two geoms.
    pub geoms: [String; 2],
    /// How deep (m).
    pub depth: f64,
}

/// Arms, their grippers open by a fixed width, and obstacles in a model of their own.
#[derive(Debug)]
pub struct CollisionJudge {
    model: Arc<MjModel>,
    data: Data,
    /// Address of every arm joint, arm after arm, in the simulator's positions.
    joints: Vec<usize>,
}

impl CollisionJudge {
    /// Compiles the model, the pads `openings` apart (m, one for each arm). Fails if the simulator refuses it.
    pub fn new(
        config: &SceneConfig,
        robots: &[RobotModel],
        world_from_bases: &[Pose],
        openings: &[f64],
        obstacles: &[Obstacle],
    ) -> Result<Self, Error> {
        let mjcf = mjcf::arms_among(config, robots, world_from_bases, obstacles);
        let model = Arc::new(compile(&mjcf).map_err(|cause| Error::Model { cause })?);
        let mut data = Data::new(model.clone());
        let mut joints = Vec::new();
        for (arm, (robot, &opening)) in robots.iter().zip(openings).enumerate() {
            let address = |name: &str| addresses(&model, &mjcf::arm_name(arm, name)).map(|(qpos, _)| qpos);
            for joint in 1..=robot.joints.len() {
                joints.push(address(&format!("joint{joint}"))?);
            }
            for finger in ["finger1", "finger2"] {
                data.qpos_mut()[address(finger)?] = robot.gripper.finger_travel(opening);
            }
        }
        Ok(Self { model, data, joints })
    }

    /// The deepest overlap at the angles `q` of all arms (rad), if anything overlaps. Panics if `q` has another length.
    pub fn overlap(&mut self, q: &[f64]) -> Option<Overlap> {
        assert_eq!(q.len(), self.joints.len(), "one angle per joint of all arms");
        for (&address, &angle) in self.joints.iter().zip(q) {
            self.data.qpos_mut()[address] = angle;
        }
        self.data.forward();
        let deepest = self.data.contact().iter().filter(|contact| contact.dist < 0.0);
        let deepest = deepest.min_by(|a, b| a.dist.total_cmp(&b.dist))?;
        let name = |geom: i32| self.model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom as usize).unwrap_or_default().to_owned();
        Some(Overlap { geoms: deepest.geom.map(name), depth: -deepest.dist })
    }

    /// The first overlap on a path of straight lines, sampled so that no joint turns more than `step` (rad) between samples.
    pub fn first_overlap(&mut self, path: &[Vec<f64>], step: f64) -> Option<Overlap> {
        if let Some(overlap) = path.first().and_then(|start| self.overlap(start)) {
            return Some(overlap);
        }
        path.windows(2).find_map(|edge| {
            let turn = edge[0].iter().zip(&edge[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let count = (turn / step).ceil().max(1.0);
            (1..=count as usize).find_map(|i| {
                let share = i as f64 / count;
                let q: Vec<f64> = edge[0].iter().zip(&edge[1]).map(|(a, b)| a + (b - a) * share).collect();
                self.overlap(&q)
            })
        })
    }
}
