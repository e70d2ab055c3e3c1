//! What values of the configuration may be, each refused with its key, what was found and what was expected.

use vmao_core::osc::OscGains;
use vmao_sim::{CameraConfig, GraspConfig, MotionConfig};

pub(crate) fn check_cameras(cameras: &CameraConfig) -> Result<(), String> {
    within("cameras.count", cameras.count as f64, 2.0, 16.0)?;
    ensure(cameras.viewpoints.len() <= 16, "cameras.viewpoints", &cameras.viewpoints.len().to_string(), "at most 16")?;
    for viewpoint in &cameras.viewpoints {
        for value in viewpoint.position.into_iter().chain(viewpoint.target) {
            within("cameras.viewpoints", value, -10.0, 10.0)?;
        }
        let away = viewpoint.position.iter().zip(viewpoint.target).map(|(from, to)| (from - to).powi(2)).sum::<f64>().sqrt();
        ensure(away >= 0.01, "cameras.viewpoints", &format!("a target {away} m from its camera"), "at least 0.01 m")?;
    }
    within("cameras.width", cameras.width as f64, 16.0, 1024.0)?;
    within("cameras.height", cameras.height as f64, 16.0, 1024.0)?;
    within("cameras.field_of_view_deg", cameras.field_of_view_deg, 1.0, 150.0)?;
    within("cameras.distance", cameras.distance, 0.1, 5.0)?;
    ensure(!cameras.elevations.is_empty(), "cameras.elevations", "no heights", "at least one")?;
    for &elevation in &cameras.elevations {
        within("cameras.elevations", elevation, 0.01, 5.0)?;
    }
    within("cameras.workspace_half_width", cameras.workspace_half_width, 0.05, 2.0)?;
    within("cameras.workspace_height", cameras.workspace_height, 0.05, 2.0)?;
    within("cameras.points", cameras.points as f64, 64.0, 65_536.0)?;
    within("cameras.table_share + cameras.robot_share", cameras.table_share + cameras.robot_share, 0.0, 1.0)?;
    within("cameras.table_share", cameras.table_share, 0.0, 1.0)?;
    within("cameras.robot_share", cameras.robot_share, 0.0, 1.0)?;
    within("cameras.noise.deviation", cameras.noise.deviation, 0.0, 0.1)?;
    within("cameras.noise.step", cameras.noise.step, 0.0, 0.1)?;
    within("cameras.noise.dropout", cameras.noise.dropout, 0.0, 1.0)?;
    within("cameras.noise.grazing_deg", cameras.noise.grazing_deg, 0.0, 90.0)?;
    within("cameras.noise.edge_dropout", cameras.noise.edge_dropout, 0.0, 1.0)?;
    within("cameras.noise.edge_step", cameras.noise.edge_step, 1e-4, 1.0)
}

pub(crate) fn check_control(grasp: &GraspConfig, motion: &MotionConfig, osc: &OscGains) -> Result<(), String> {
    within("grasp.approaches", grasp.approaches as f64, 1.0, 360.0)?;
    within("grasp.standoff", grasp.standoff, 0.0, 0.5)?;
    within("grasp.opening_margin", grasp.opening_margin, 0.0, 0.1)?;
    within("grasp.table_clearance", grasp.table_clearance, 0.0, 0.1)?;
    within("grasp.max_retreat", grasp.max_retreat, 0.0, 0.1)?;
    within("grasp.plan_margin", grasp.plan_margin, 0.0, 0.1)?;
    within("grasp.carry_margin", grasp.carry_margin, 0.0, 0.1)?;
    within("grasp.shortlist", grasp.shortlist as f64, 1.0, 1000.0)?;
    within("grasp.ik_candidates", grasp.ik_candidates as f64, 1.0, 100.0)?;
    within("grasp.closing_force", grasp.closing_force, 0.0, 200.0)?;
    within("grasp.closing_seconds", grasp.closing_seconds, 0.0, 10.0)?;
    within("grasp.hold_force", grasp.hold_force, 0.0, 1000.0)?;
    within("motion.velocity_share", motion.velocity_share, 0.01, 1.0)?;
    within("motion.acceleration_share", motion.acceleration_share, 0.01, 1.0)?;
    within("motion.approach_share", motion.approach_share, 0.01, 1.0)?;
    positive("motion.object_speed", motion.object_speed)?;
    positive("motion.object_turning_speed", motion.object_turning_speed)?;
    within("motion.shortest_motion", motion.shortest_motion, 0.1, 60.0)?;
    positive("motion.collision_force", motion.collision_force)?;
    within("motion.waypoints", motion.waypoints as f64, 1.0, 1000.0)?;
    at_least_one("motion.max_steps", motion.max_steps)?;
    within("motion.grip_memory", motion.grip_memory, 0.0, 1e6)?;
    positive("osc.position_stiffness", osc.position_stiffness)?;
    positive("osc.rotation_stiffness", osc.rotation_stiffness)?;
    positive("osc.damping_ratio", osc.damping_ratio)?;
    within("osc.posture_stiffness", osc.posture_stiffness, 0.0, 1e4)?;
    within("osc.singularity_damping", osc.singularity_damping, 0.0, 1.0)?;
    within("osc.singularity_onset", osc.singularity_onset, 0.0, 1.0)?;
    positive("osc.max_position_error", osc.max_position_error)?;
    positive("osc.max_rotation_error", osc.max_rotation_error)
}

pub(crate) fn ensure(holds: bool, key: &str, found: &str, expected: &str) -> Result<(), String> {
    if holds { Ok(()) } else { Err(format!("{key}: {found}, expected {expected}")) }
}

pub(crate) fn positive(key: &str, value: f64) -> Result<(), String> {
    ensure(value > 0.0 && value.is_finite(), key, &value.to_string(), "a positive finite number")
}

pub(crate) fn within(key: &str, value: f64, lowest: f64, highest: f64) -> Result<(), String> {
    ensure(value >= lowest && value <= highest, key, &value.to_string(), &format!("{lowest} to {highest}"))
}

pub(crate) fn range(key: &str, [low, high]: [f64; 2], lowest: f64, highest: f64) -> Result<(), String> {
    let expected = format!("[low, high] with {lowest} ≤ low ≤ high ≤ {highest}");
    ensure(lowest <= low && low <= high && high <= highest, key, &format!("[{low}, {high}]"), &expected)
}

pub(crate) fn at_least_one(key: &str, value: u64) -> Result<(), String> {
    ensure(value >= 1, key, &value.to_string(), "at least 1")
}
