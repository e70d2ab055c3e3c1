//! Looks at two arms and an object, for the comparison with other renderers: prints camera rates, and what is compared, as JSON.
//!
//! Arguments: object, frames a camera, a folder that scene.xml and depths.bin (64-bit floats, camera after camera) go to.

#[path = "../tests/support/mod.rs"]
mod support;

use std::error::Error;
use std::path::Path;
use vmao_core::catalogue::{InstanceSet, item};
use vmao_core::depth_picture::Pinhole;
use vmao_core::geometry::Pose;
use vmao_core::robots::panda;
use vmao_sim::looking::Still;
use vmao_sim::{CameraConfig, Scene, TrialConfig};

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, object, frames, folder] = arguments.as_slice() else {
        return Err("expected three arguments: object, frames a camera, folder".into());
    };
    let (scene, trial) = support::configuration();
    // Far enough to see both arms whole, and nothing cropped.
    let (distance, elevations, workspace) = (1.7, vec![0.9, 0.4], 2.0);
    let cameras = CameraConfig {
        width: 320,
        height: 240,
        distance,
        elevations,
        workspace_half_width: workspace,
        workspace_height: workspace,
        ..trial.cameras.clone()
    };
    let trial = TrialConfig { cameras, ..trial };
    let item = item(object, InstanceSet::Train, 0).ok_or("no such object in the catalogue")?;
    let middles: Vec<f64> =
        item.object.joints.iter().filter_map(|joint| joint.limits.map(|[a, b]| f64::midpoint(a, b))).collect();
    let scene = Scene::new(&scene, vec![panda(), panda()], item)?;
    let still = Still::new(&scene, &trial, &Pose::translation(0.02, -0.01, 0.15), &middles);
    std::fs::write(Path::new(folder).join("scene.xml"), &scene.mjcf)?;
    let depths = (0..still.cameras.len()).flat_map(|camera| still.depths(camera));
    std::fs::write(Path::new(folder).join("depths.bin"), depths.flat_map(f64::to_le_bytes).collect::<Vec<u8>>())?;
    let (mut points, before) = (0, support::thread_seconds());
    for _ in 0..frames.parse::<usize>()? {
        points += (0..still.cameras.len()).map(|camera| still.look(camera)).sum::<usize>();
    }
    let seconds = support::thread_seconds() - before;
    let cameras: Vec<String> = still.cameras.iter().map(described).collect();
    println!(
        r#"{{"seconds": {seconds}, "points": {points}, "width": {}, "height": {}, "half_tangent": {}, "qpos": {:?}, "cameras": [{}]}}"#,
        still.cameras[0].width,
        still.cameras[0].height,
        still.cameras[0].half_tangent,
        still.qpos,
        cameras.join(", ")
    );
    Ok(())
}

/// A camera's place and its axes as rows.
fn described(camera: &Pinhole) -> String {
    let rotation = camera.world_from_camera.rotation.to_rotation_matrix();
    let axes: Vec<Vec<f64>> = (0..3).map(|axis| rotation.matrix().column(axis).iter().copied().collect()).collect();
    format!(r#"{{"position": {:?}, "axes": {axes:?}}}"#, camera.world_from_camera.translation.vector.as_slice())
}
