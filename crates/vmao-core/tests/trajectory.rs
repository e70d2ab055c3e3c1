//! Timed paths: limits everywhere, continuity, corner deviation, closed forms.

use proptest::prelude::*;
use vmao_core::{
    random::Stream,
    time_parameterization::{MotionLimits, SMOOTHING_WINDOW, Trajectory},
};

fn panda_limits(arms: usize) -> MotionLimits {
    MotionLimits {
        velocity: [2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61].repeat(arms),
        acceleration: [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0].repeat(arms),
    }
}

fn check(path: &[Vec<f64>], limits: &MotionLimits, deviation: f64) -> Trajectory {
    let trajectory = Trajectory::new(path, limits, deviation);
    let duration = trajectory.duration();
    let (start, goal) = (&path[0], &path[path.len() - 1]);
    for (time, end) in [(0.0, start), (-1.0, start), (duration, goal), (duration + 1.0, goal)] {
        let (q, qd) = trajectory.at(time);
        assert!(q.iter().zip(end).all(|(a, b)| (a - b).abs() < 1e-9), "{time}: {q:?} is not {end:?}");
        assert!(qd.iter().all(|v| v.abs() < 1e-9), "at rest at {time}");
    }
    let steps = 2000;
    let dt = duration / f64::from(steps);
    let (mut last_q, mut last_v) = trajectory.at(0.0);
    for step in 1..=steps {
        let time = dt * f64::from(step);
        let ((q, v), middle) = (trajectory.at(time), trajectory.at(time - 0.5 * dt).1);
        let acceleration = trajectory.acceleration(time);
        for i in 0..q.len() {
            let a = limits.acceleration[i];
            assert!(v[i].abs() <= limits.velocity[i] * (1.0 + 1e-6), "joint {i} at {time}: {} rad/s", v[i]);
            assert!((v[i] - last_v[i]).abs() <= a * dt * (1.0 + 1e-6) + 1e-9, "joint {i} at {time}: accelerates too fast");
            assert!(acceleration[i].abs() <= a * (1.0 + 1e-6), "joint {i} at {time}: {} rad/s2", acceleration[i]);
            // the velocity is the derivative of the position, Simpson's rule
            let moved = (last_v[i] + 4.0 * middle[i] + v[i]) * dt / 6.0;
            assert!((q[i] - last_q[i] - moved).abs() < 2.0 * a * dt * dt + 1e-9, "joint {i} at {time}");
        }
        let off = distance_to_path(path, &q);
        let allowed = deviation + limits.acceleration.iter().map(|a| a * a).sum::<f64>().sqrt() * SMOOTHING_WINDOW.powi(2) / 24.0;
        assert!(off <= allowed + 1e-9, "{off} rad off the path at {time}, at most {allowed}");
        (last_q, last_v) = (q, v);
    }
    trajectory
}

fn distance_to_path(path: &[Vec<f64>], q: &[f64]) -> f64 {
    let to_edge = |edge: &[Vec<f64>]| {
        let along: f64 = edge[0].iter().zip(&edge[1]).zip(q).map(|((a, b), q)| (b - a) * (q - a)).sum();
        let square: f64 = edge[0].iter().zip(&edge[1]).map(|(a, b)| (b - a) * (b - a)).sum();
        let t = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
        edge[0].iter().zip(&edge[1]).zip(q).map(|((a, b), q)| (a + t * (b - a) - q).powi(2)).sum::<f64>().sqrt()
    };
    path.windows(2).map(to_edge).fold(f64::INFINITY, f64::min)
}

#[test]
fn one_joint_moves_as_fast_as_a_trapezoid() {
    let limits = MotionLimits { velocity: vec![2.0], acceleration: vec![4.0] };
    for (distance, ideal) in [(3.0, 3.0 / 2.0 + 2.0 / 4.0), (0.25, 2.0 * (0.25_f64 / 4.0).sqrt())] {
        let duration = check(&[vec![0.0], vec![distance]], &limits, 0.1).duration() - SMOOTHING_WINDOW;
        assert!(duration >= ideal - 1e-9 && duration < ideal * 1.02, "{duration} s, ideally {ideal} s");
    }
}

#[test]
fn the_slowest_joint_sets_the_time_of_a_line() {
    let limits = MotionLimits { velocity: vec![1.0, 1.0, 1.0], acceleration: vec![1e3, 1e3, 1e3] };
    let duration = check(&[vec![0.0, 0.0, 0.0], vec![0.5, -2.0, 0.0]], &limits, 0.0).duration();
    assert!((duration - SMOOTHING_WINDOW - 2.0).abs() < 0.02, "{duration}");
}

#[test]
fn a_path_that_goes_nowhere_takes_no_time() {
    let q = vec![0.3; 7];
    for path in [vec![q.clone()], vec![q.clone(), q.clone(), q.clone()]] {
        let trajectory = Trajectory::new(&path, &panda_limits(1), 0.1);
        assert_eq!(trajectory.duration(), 0.0);
        assert_eq!(trajectory.at(0.5), (q.clone(), vec![0.0; 7]));
        assert_eq!(trajectory.acceleration(0.1), vec![0.0; 7]);
    }
}

#[test]
fn reversals_repeats_and_sharp_corners_keep_the_limits() {
    let limits = panda_limits(1);
    let (a, b, mut c) = (vec![0.0; 7], vec![0.5; 7], vec![0.5; 7]);
    c[3] = -0.5;
    for deviation in [0.0, 0.001, 0.1, 10.0] {
        let turned = check(&[a.clone(), b.clone(), b.clone(), a.clone()], &limits, deviation);
        let cornered = check(&[a.clone(), b.clone(), c.clone(), a.clone()], &limits, deviation);
        assert!(turned.duration() > 0.4 && cornered.duration() > 0.4);
    }
    let wide = check(&[a.clone(), b.clone(), c.clone()], &limits, 0.2).duration();
    let stopping = check(&[a, b, c], &limits, 0.0).duration();
    assert!(wide < stopping, "{wide} s against {stopping} s with stops");
}

#[test]
fn a_corner_is_cut_by_just_the_deviation() {
    let limits = MotionLimits { velocity: vec![1.0; 2], acceleration: vec![3.0; 2] };
    let path = [vec![0.0, 0.0], vec![1.0, 0.0], vec![1.0, 1.0]];
    for deviation in [0.001, 0.03, 0.15] {
        let trajectory = check(&path, &limits, deviation);
        let passes = |i: u32| {
            let q = trajectory.at(trajectory.duration() * f64::from(i) / 20_000.0).0;
            (q[0] - 1.0).hypot(q[1])
        };
        let nearest = (0..20_000).map(passes).fold(f64::INFINITY, f64::min);
        assert!((nearest - deviation).abs() < 3e-4, "{nearest} rad from the corner, {deviation} asked for");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn limits_hold_on_random_paths(seed in 0_u64..1 << 40, points in 2_usize..12, arms in 1_usize..4, deviation in 0.0..0.3_f64) {
        let mut stream = Stream::new(seed, &[]);
        let scale = stream.range(0.01, 2.0);
        let path: Vec<Vec<f64>> = (0..points).map(|_| (0..7 * arms).map(|_| stream.range(-scale, scale)).collect()).collect();
        check(&path, &panda_limits(arms), deviation);
    }
}
