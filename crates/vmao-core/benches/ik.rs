//! Inverse kinematics of both robots: one solution, the nearest, all branches. A different reachable pose each time.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use vmao_core::{
    geometry::Pose,
    inverse_kinematics::{IkSettings, InverseKinematics},
    random::Stream,
    robots::RobotModel,
};

fn inverse_kinematics(criterion: &mut Criterion) {
    for robot in RobotModel::NAMES.into_iter().filter_map(RobotModel::named) {
        let (arm, name) = (InverseKinematics::new(robot.flange_chain(), &IkSettings::default()), robot.name);
        let mut stream = Stream::new(41, &[]);
        let poses: Vec<Pose> = (0..1000).map(|_| arm.chain().tool_pose(&arm.chain().sample(&mut stream))).collect();
        let mut poses = poses.iter().cycle();
        let mut measure = |what: &str, solve: &dyn Fn(&Pose) -> bool| {
            criterion.bench_function(&format!("{name}: {what}"), |bencher| {
                bencher.iter(|| assert!(poses.next().is_some_and(|pose| solve(black_box(pose)))));
            });
        };
        measure("one solution", &|pose| arm.solve(pose, &robot.home).solution().is_some());
        measure("nearest to home", &|pose| arm.nearest(pose, &robot.home).solution().is_some());
        measure("all branches", &|pose| !arm.branches(pose, &robot.home).is_empty());
    }
}

criterion_group!(benches, inverse_kinematics);
criterion_main!(benches);
