//! The mathematics of multi-arm manipulation of articulated objects (V-MAO, Liu & Kitani, CoRL 2021).
//!
//! Geometry, the object graph, object-centric control, operational space control, kinematics, planning,
//! contacts, grasp orders and outcomes. This crate knows nothing of the simulator, of tensors, of files,
//! of the clock or of threads.

pub mod antipodal;
pub mod catalogue;
pub mod collision;
mod collision_checker;
pub mod contact;
pub mod contact_model;
pub mod convex_hull;
mod coordination;
pub mod coverage;
mod damped_least_squares;
pub mod depth_noise;
pub mod depth_picture;
pub mod distance;
pub mod geometry;
pub mod gripper_pose;
pub mod inverse_kinematics;
mod joint_path;
pub mod json_pose;
pub mod kinematics;
pub mod object;
pub mod object_centric;
pub mod object_file;
pub mod object_graph;
pub mod observation;
pub mod order;
pub mod osc;
pub mod outcome;
pub mod passage;
pub mod planning;
pub mod planning_problems;
pub mod random;
pub mod rays;
pub mod record;
pub mod robots;
pub mod rollout;
pub mod shape;
mod small_systems;
mod swept;
pub mod time_parameterization;
pub mod wording;

/// The code in the README, compiled and run with the documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
pub struct Readme;
