//! Solve rate, time and length of plans for the problem sets: `plan_rate COUNT [shelf|crossed] [ROBOTS]...`

use std::time::Instant;
use vmao_core::{
    collision::CollisionChecker,
    planning::{PlanOutcome, PlanSettings, plan, time_path},
    planning_problems::{Family, PlanningProblem},
    random::Stream,
    robots::RobotModel,
    time_parameterization::MotionLimits,
};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let count = arguments.first().and_then(|count| count.parse().ok()).unwrap_or(100);
    let sets = ["panda", "panda,panda", "panda,panda,panda", "sawyer", "sawyer,sawyer", "sawyer,sawyer,sawyer", "panda,sawyer"];
    let chosen = |name: &str, from: usize| arguments.len() <= from || arguments[from..].iter().any(|argument| argument == name);
    for (name, family) in [("shelf", Family::Shelf), ("crossed", Family::Crossed)] {
        for robots in sets {
            if arguments.get(1).is_none_or(|wanted| wanted == name) && chosen(robots, 2) {
                measure(name, family, robots, count);
            }
        }
    }
}

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn measure(name: &str, family: Family, robots: &str, count: u64) {
    let models: Vec<RobotModel> = robots.split(',').filter_map(RobotModel::named).collect();
    let start = Instant::now();
    let problems: Vec<PlanningProblem> = (0..count).map(|index| PlanningProblem::new(family, &models, index)).collect();
    let making = start.elapsed().as_secs_f64() / count as f64;
    let (mut times, mut timing, mut duration) = (Vec::new(), 0.0, 0.0);
    let (mut solved, mut straight, mut timed, mut length, mut checks) = (0, 0, 0, 0.0, 0.0);
    for (index, problem) in problems.iter().enumerate() {
        let world = problem.world();
        let settings = PlanSettings::default();
        let start = cpu_seconds();
        let outcome = plan(&world, &problem.start, &problem.goal, &settings, &mut Stream::new(index as u64, &[]));
        times.push((cpu_seconds() - start) * 1e3);
        let PlanOutcome::Path(path) = outcome else { continue };
        solved += 1;
        straight += u32::from(path.len() == 2);
        let distance = |e: &[Vec<f64>]| e[0].iter().zip(&e[1]).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
        length += path.windows(2).map(distance).sum::<f64>();
        let start = Instant::now();
        if let Some(trajectory) = time_path(&world, &path, &MotionLimits::of(&models), &settings) {
            timed += 1;
            duration += trajectory.duration();
        }
        timing += start.elapsed().as_secs_f64() * 1e3;
        let mut checker = CollisionChecker::new(&world);
        let start = Instant::now();
        for point in &path {
            std::hint::black_box(checker.is_free(point, 0.0));
        }
        checks += start.elapsed().as_secs_f64() * 1e6 / path.len() as f64;
    }
    times.sort_by(f64::total_cmp);
    let n = times.len();
    println!(
        "{name} {robots}: {solved}/{n} solved, {straight} straight; plan ms median {:.2} mean {:.2} 95 % {:.2} max {:.1}; length {:.3} rad; \
         {timed} timed, {:.2} s, in {:.1} ms; a check {:.2} us; making {:.0} ms",
        times[n / 2],
        times.iter().sum::<f64>() / n as f64,
        times[n * 95 / 100],
        times[n - 1],
        length / f64::from(solved),
        duration / f64::from(timed),
        timing / f64::from(solved),
        checks / f64::from(solved),
        making * 1e3,
    );
}

fn cpu_seconds() -> f64 {
    std::thread::yield_now(); // the count is brought up to date when the scheduler is called
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|run| run.parse::<f64>().ok()).unwrap_or(f64::NAN) * 1e-9
}
