//! Plans every problem of the sets, judges the paths by MuJoCo at 0.01 rad and checks their timing: `judge_plans [COUNT]`

#[path = "../tests/support/mod.rs"]
mod support;

use std::error::Error;
use vmao_core::{
    planning::{PlanOutcome, PlanSettings, plan, time_path},
    planning_problems::{Family, PlanningProblem},
    random::Stream,
    robots::RobotModel,
    time_parameterization::{MotionLimits, Trajectory},
};
use vmao_sim::CollisionJudge;

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() -> Result<(), Box<dyn Error>> {
    let (scene, _) = support::configuration();
    let count = std::env::args().nth(1).map_or(Ok(100), |count| count.parse())?;
    let sets = ["panda", "panda,panda", "panda,panda,panda", "sawyer", "sawyer,sawyer", "sawyer,sawyer,sawyer", "panda,sawyer"];
    println!(
        "| family | robots | solved | straight | valid at 0.01 rad | witness valid | timed | within limits | length rad | duration s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (name, family) in [("shelf", Family::Shelf), ("crossed", Family::Crossed)] {
        for robots in sets {
            let models: Vec<RobotModel> = robots.split(',').filter_map(RobotModel::named).collect();
            let openings: Vec<f64> = models.iter().map(|robot| robot.gripper.max_opening()).collect();
            let mut counts = [0_u64; 6];
            let (mut length, mut duration) = (0.0, 0.0);
            for index in 0..count {
                let problem = PlanningProblem::new(family, &models, index);
                let mut judge = CollisionJudge::new(&scene, &models, &problem.world_from_bases, &openings, &problem.obstacles)?;
                let mut tell = |slot: usize, holds: bool| counts[slot] += u64::from(holds);
                tell(0, judge.first_overlap(&problem.witness, 0.01).is_none());
                let (world, settings) = (problem.world(), PlanSettings::default());
                let outcome = plan(&world, &problem.start, &problem.goal, &settings, &mut Stream::new(index, &[]));
                let PlanOutcome::Path(path) = outcome else { continue };
                tell(1, true);
                tell(2, path.len() == 2);
                tell(3, judge.first_overlap(&path, 0.01).is_none());
                let turn = |edge: &[Vec<f64>]| edge[0].iter().zip(&edge[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
                length += path.windows(2).map(turn).sum::<f64>();
                let limits = MotionLimits::of(&models);
                let Some(timed) = time_path(&world, &path, &limits, &settings) else { continue };
                tell(4, true);
                tell(5, within(&timed, &limits));
                duration += timed.duration();
            }
            let [witnesses, solved, straight, valid, timed, slow] = counts;
            println!(
                "| {name} | {robots} | {solved}/{count} | {straight} | {valid}/{solved} | {witnesses}/{count} | {timed}/{solved} | {slow}/{timed} | {:.2} | {:.2} |",
                length / solved as f64,
                duration / timed as f64
            );
        }
    }
    Ok(())
}

/// Whether speeds and accelerations, taken from sampled positions, are within the limits.
fn within(timed: &Trajectory, limits: &MotionLimits) -> bool {
    const PERIOD: f64 = 0.002;
    let samples: Vec<Vec<f64>> =
        (0..=(timed.duration() / PERIOD).ceil() as usize + 1).map(|i| timed.at(i as f64 * PERIOD).0).collect();
    samples.windows(3).all(|three| {
        (0..three[0].len()).all(|joint| {
            let velocity = (three[2][joint] - three[0][joint]) / (2.0 * PERIOD);
            let acceleration = (three[2][joint] - 2.0 * three[1][joint] + three[0][joint]) / (PERIOD * PERIOD);
            velocity.abs() <= limits.velocity[joint] * (1.0 + 1e-6)
                && acceleration.abs() <= limits.acceleration[joint] * (1.0 + 1e-4)
        })
    })
}
