//! Inverse kinematics judged by the simulator: its poses are the targets, its poses and limits judge the answers.

use super::support::mixed_scene;
use crate::convention::{Data, body_pose};
use crate::scene::Scene;
use vmao_core::geometry::{Pose, rotation_distance};
use vmao_core::inverse_kinematics::{IkSettings, InverseKinematics};
use vmao_core::random::Stream;

/// Flange and tool of an arm in its base, as the simulator places them.
fn flange_and_tool(scene: &Scene, data: &mut Data, arm: usize, q: &[f64]) -> [Pose; 2] {
    let (address, robot) = (&scene.arms[arm], &scene.robots[arm]);
    data.qpos_mut()[address.qpos..address.qpos + q.len()].copy_from_slice(q);
    data.forward();
    let base_from_world = scene.world_from_bases[arm].inverse();
    let (last, hand) = (body_pose(data, address.bodies[q.len()]), body_pose(data, address.hand_body));
    [last * robot.last_from_flange, hand * robot.gripper.hand_from_tool]
        .map(|world_from_frame| base_from_world * world_from_frame)
}

#[test]
fn a_thousand_reachable_poses_of_each_robot_are_all_solved_within_its_limits() {
    let scene = mixed_scene();
    let mut data = Data::new(scene.model.clone());
    for (index, (arm, robot)) in scene.arms.iter().zip(&scene.robots).enumerate() {
        let chains = [robot.flange_chain(), robot.tool_chain()];
        let solvers = chains.map(|chain| InverseKinematics::new(chain, &IkSettings::default()));
        let limits: Vec<[f64; 2]> = arm.joints.iter().map(|&joint| scene.model.jnt_range()[joint]).collect();
        let mut stream = Stream::new(31, &[index as u64]);
        for trial in 0..1000 {
            let mut drawn = || -> Vec<f64> { limits.iter().map(|&[low, high]| stream.range(low, high)).collect() };
            let (q, seed) = (drawn(), drawn());
            let goals = flange_and_tool(&scene, &mut data, index, &q);
            for (frame, solver) in solvers.iter().enumerate() {
                let outcome = solver.solve(&goals[frame], &seed);
                let Some(answer) = outcome.solution() else { panic!("{} {trial}: {outcome:?}", robot.name) };
                let inside = answer.iter().zip(&limits).all(|(angle, [low, high])| (low..=high).contains(&angle));
                let reached = flange_and_tool(&scene, &mut data, index, answer)[frame];
                let gap = (reached.translation.vector - goals[frame].translation.vector).norm();
                let turn = rotation_distance(&reached.rotation, &goals[frame].rotation);
                assert!(inside && gap < 1e-3 && turn < 0.01, "{} {trial}: {gap} m, {turn} rad, {answer:?}", robot.name);
            }
        }
    }
}
