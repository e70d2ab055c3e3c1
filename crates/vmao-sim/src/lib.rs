//! Physics: scenes, cameras, control and the one trial loop, on MuJoCo. Knows nothing of tensors.

// The tests inside and outside this crate share one support module, which names the crate as from outside.
#[cfg(test)]
extern crate self as vmao_sim;

mod approach;
mod assignment;
mod attempt;
mod bodies;
mod cameras;
mod carrying;
mod combinations;
mod convention;
mod dependency_root;
mod elsewhere;
mod error;
mod execution;
mod exploration;
mod failure;
mod grasping;
mod judge;
mod layout;
mod link_meshes;
pub mod looking;
mod measures;
mod mjcf;
mod planning_world;
mod portrait;
pub mod profile;
mod proposals;
mod reachability;
mod recorder;
mod scene;
mod simulation;
pub mod targets;
mod task;
#[cfg(test)]
mod tests;
pub mod throughput;
pub mod tracking;
mod trial;
mod viewpoints;

pub use cameras::CameraConfig;
pub use dependency_root::{PredictedMotion, Root, choose_root, predict};
pub use error::Error;
pub use execution::MotionConfig;
pub use exploration::{LabelSet, Proposals, explore_round, scene_of_trial};
pub use grasping::GraspConfig;
pub use judge::{CollisionJudge, Overlap};
pub use layout::{BasePlacement, Layout, MAX_ARMS};
pub use link_meshes::LinkMesh;
pub use measures::MotionMeasures;
pub use portrait::{Picture, portrait};
pub use scene::{Friction, Scene, SceneConfig};
pub use task::{GoalConfig, GoalReach, StartConfig, Thresholds};
pub use trial::{Recording, Trial, TrialConfig, run_trial};
pub use viewpoints::Viewpoint;
