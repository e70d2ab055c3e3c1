//! Forward kinematics against the published hand poses, the Jacobian against differences.

mod robots;

use nalgebra::Vector3;
use robots::{PANDA_HOME, SAWYER_NEUTRAL, panda, sawyer};
use vmao_core::{
    geometry::{pose, rotation_log},
    kinematics::SerialChain,
    random::Stream,
};

fn robots() -> [(&'static str, SerialChain); 2] {
    [("panda", panda()), ("sawyer", sawyer())]
}

#[test]
fn hands_are_where_the_published_models_put_them() {
    use std::f64::consts::PI;
    let ready = [0.0, -PI / 4.0, 0.0, -3.0 * PI / 4.0, 0.0, PI / 2.0, PI / 4.0];
    let cases = [
        (panda(), PANDA_HOME, [0.5545, 0.0, 0.6245]),
        (panda(), ready, [0.3069, 0.0, 0.5903]),
        (panda(), [0.0, PI / 16.0, 0.0, -5.0 * PI / 6.0, 0.0, PI - 0.2, PI / 4.0], [0.445, 0.0, 0.195]),
        (sawyer(), SAWYER_NEUTRAL, [0.4496, 0.1603, 0.2158]),
    ];
    for (chain, q, position) in cases {
        let hand = chain.tool_pose(&q);
        assert!((hand.translation.vector - Vector3::from(position)).norm() < 1e-3, "{hand} instead of {position:?}");
    }
    let down = panda().tool_pose(&ready).rotation;
    assert!((down * Vector3::z() + Vector3::z()).norm() < 1e-6, "the hand points down");
    assert!((down * Vector3::x() - Vector3::x()).norm() < 1e-6, "the hand's x is the world's");
    let home = panda().tool_pose(&PANDA_HOME).rotation;
    assert!((home * Vector3::x() - Vector3::y()).norm() < 1e-3, "the hand's x is the world's y");
}

#[test]
fn the_jacobian_is_the_derivative_of_the_tool_pose() {
    for (name, mut chain) in robots() {
        chain.last_from_tool *= pose([0.02, -0.05, 0.1], [0.8, 0.1, -0.3, 0.5]);
        let mut stream = Stream::new(11, &[]);
        for _ in 0..20 {
            let q = chain.sample(&mut stream);
            let jacobian = chain.jacobian(&q);
            assert_eq!(jacobian.shape(), (6, 7));
            for column in 0..7 {
                let shifted = |by: f64| {
                    let mut q = q.clone();
                    q[column] += by;
                    chain.tool_pose(&q)
                };
                let (h, low, high) = (1e-6, shifted(-1e-6), shifted(1e-6));
                let linear = (high.translation.vector - low.translation.vector) / (2.0 * h);
                let angular = rotation_log(&(high.rotation * low.rotation.inverse())) / (2.0 * h);
                let difference = (jacobian.fixed_view::<3, 1>(0, column) - linear).norm()
                    + (jacobian.fixed_view::<3, 1>(3, column) - angular).norm();
                assert!(difference < 1e-7, "{name} column {column}: {difference}");
            }
        }
    }
}

#[test]
fn limits_hold_their_ends_and_clamping_returns_to_them() {
    let chain = panda();
    let upper: Vec<f64> = chain.joints.iter().map(|joint| joint.upper).collect();
    assert!(chain.within_limits(&upper) && !chain.within_limits(&upper[..6]));
    let beyond: Vec<f64> = upper.iter().map(|angle| angle + 0.1).collect();
    assert!(!chain.within_limits(&beyond));
    assert_eq!(chain.clamp(&beyond), upper);
}
