//! Solve rate, time, length and validity of plans for one to three arms, with and without a shelf between them.

#[path = "../tests/robots/mod.rs"]
mod robots;

use robots::problems::{add_shelf, problem, ring};
use std::time::Instant;
use vmao_core::{
    collision::CollisionChecker,
    planning::{PlanOutcome, PlanSettings, plan, time_path},
    random::Stream,
    time_parameterization::MotionLimits,
};

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() {
    for arms in 1..=3 {
        let mut world = ring(arms);
        add_shelf(&mut world);
        let mut checker = CollisionChecker::new(&world);
        let mut stream = Stream::new(3, &[]);
        let samples: Vec<Vec<f64>> =
            (0..20_000).map(|_| world.arms.iter().flat_map(|arm| arm.chain.sample(&mut stream)).collect()).collect();
        let free: Vec<&Vec<f64>> = samples.iter().filter(|q| checker.is_free(q, 0.005)).collect();
        let start = Instant::now();
        let still = free.iter().filter(|q| checker.is_free(q, 0.005)).count();
        let each = start.elapsed().as_secs_f64() * 1e6 / still as f64;
        println!("{arms} arms: {} of {} samples free, a free check takes {each:.2} us", free.len(), samples.len());
    }
    let count = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(50_u64);
    for (arms, shelf) in [(1, false), (2, false), (3, false), (1, true), (2, true), (3, true)] {
        let mut timing = 0.0;
        let (mut times, mut solved, mut valid, mut bent, mut seconds, mut timed, mut length) =
            (Vec::new(), 0, 0, 0, 0.0, 0.0, 0.0);
        for seed in 0..count {
            let mut world = ring(arms);
            if shelf {
                add_shelf(&mut world);
            }
            let problem = problem(world, seed);
            let start = Instant::now();
            let mut stream = Stream::new(seed, &[]);
            let outcome = plan(&problem.world, &problem.start, &problem.goal, &PlanSettings::default(), &mut stream);
            times.push(start.elapsed().as_secs_f64() * 1e3);
            let PlanOutcome::Path(path) = outcome else { continue };
            solved += 1;
            bent += u32::from(path.len() > 2);
            let mut checker = CollisionChecker::new(&problem.world);
            valid += u32::from(path.windows(2).all(|edge| {
                let turn = edge[0].iter().zip(&edge[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                let steps = (turn / 0.002).ceil() as usize;
                (0..=steps).all(|i| {
                    let t = i as f64 / steps as f64;
                    let q: Vec<f64> = edge[0].iter().zip(&edge[1]).map(|(a, b)| a + t * (b - a)).collect();
                    checker.is_free(&q, 0.0)
                })
            }));
            length +=
                path.windows(2).map(|e| e[0].iter().zip(&e[1]).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()).sum::<f64>();
            let limits = MotionLimits { velocity: vec![2.1; 7 * arms], acceleration: vec![7.0; 7 * arms] };
            let start = Instant::now();
            let trajectory = time_path(&problem.world, &path, &limits, &PlanSettings::default());
            timing += start.elapsed().as_secs_f64() * 1e3;
            if let Some(trajectory) = trajectory {
                timed += 1.0;
                seconds += trajectory.duration();
            }
        }
        times.sort_by(f64::total_cmp);
        println!(
            "{arms} arms{}: {solved}/{count} solved, {bent} not straight, {valid} valid at 0.002 rad, median {:.1} ms, 90 % {:.1} ms, \
             max {:.0} ms, mean {:.1} ms; length {:.2} rad; {timed} timed, {:.2} s, {:.1} ms each",
            if shelf { " and a shelf" } else { "" },
            times[times.len() / 2],
            times[times.len() * 9 / 10],
            times[times.len() - 1],
            times.iter().sum::<f64>() / times.len() as f64,
            length / f64::from(solved),
            seconds / timed,
            timing / f64::from(solved),
        );
    }
}
