//! Prints planning problems as requests of `vmao plan`, one JSON document a line: FAMILY (shelf, crossed), robots, COUNT.
//!
//! `plan_problems crossed panda,panda 100`. With - for COUNT the problems' numbers come from standard input, line by line.
//! With `--solve` each line holds the request, the collision models, our path and the CPU time it took.

use serde_json::{Value, json};
use std::io::Write;
use vmao_core::{
    collision::LinkSolid,
    geometry::{Pose, position_quaternion},
    kinematics::ChainJoint,
    planning::{PlanOutcome, PlanSettings, plan},
    planning_problems::{Family, PlanningProblem},
    random::Stream,
    robots::RobotModel,
    shape::Shape,
};

fn main() -> Result<(), String> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let solve = arguments.iter().position(|argument| argument == "--solve").map(|at| arguments.remove(at)).is_some();
    let [family, robots, count] = arguments.as_slice() else {
        return Err("expected FAMILY ROBOT[,ROBOT]... COUNT [--solve]".to_owned());
    };
    let family = match family.as_str() {
        "shelf" => Family::Shelf,
        "crossed" => Family::Crossed,
        _ => return Err(format!("no family `{family}`; families are: shelf, crossed")),
    };
    let robot = |name| RobotModel::named(name).ok_or_else(|| format!("no robot `{name}`; robots are: {:?}", RobotModel::NAMES));
    let robots = robots.split(',').map(robot).collect::<Result<Vec<_>, _>>()?;
    let answer = |index: u64| {
        let problem = PlanningProblem::new(family, &robots, index);
        if solve { print(&solved(&problem, index)) } else { print(&request(&problem)) }
    };
    if count == "-" {
        for line in std::io::stdin().lines() {
            let line = line.map_err(|error| error.to_string())?;
            answer(line.trim().parse().map_err(|error| format!("`{line}`: {error}"))?)?;
        }
        return Ok(());
    }
    (0..count.parse().map_err(|error| format!("COUNT: {error}"))?).try_for_each(answer)
}

fn print(document: &Value) -> Result<(), String> {
    let mut stdout = std::io::stdout().lock();
    writeln!(stdout, "{document}").and_then(|()| stdout.flush()).map_err(|error| format!("stdout: {error}"))
}

/// The request with the collision models it means, our path (null if none), and the CPU time of planning with its checks.
fn solved(problem: &PlanningProblem, index: u64) -> Value {
    let world = problem.world();
    let before = cpu_seconds();
    let outcome = plan(&world, &problem.start, &problem.goal, &PlanSettings::default(), &mut Stream::new(index, &[]));
    let spent = before.and_then(|before| Some(cpu_seconds()? - before));
    let path = match outcome {
        PlanOutcome::Path(path) => Some(path),
        PlanOutcome::Failed(_) => None,
    };
    json!({"request": request(problem), "models": models(problem), "path": path, "cpu_seconds": spent})
}

/// CPU time of this thread so far as the kernel's scheduler counts it (s); only Linux tells.
fn cpu_seconds() -> Option<f64> {
    std::thread::yield_now(); // the count is brought up to date when the scheduler is called
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split(' ').next()?.parse::<f64>().ok()? * 1e-9)
}

/// Joints, solids and ignored pairs of every arm.
fn models(problem: &PlanningProblem) -> Value {
    let models = problem.world().arms.into_iter().map(|arm| {
        let joint = |joint: &ChainJoint| json!({"pose": pose(&joint.parent_from_joint), "range": [joint.lower, joint.upper]});
        let solid = |LinkSolid { link, solid }: &LinkSolid| {
            json!({"link": link, "shape": solid.shape, "pose": pose(&solid.carrier_from_solid)})
        };
        json!({
            "joints": arm.chain.joints.iter().map(joint).collect::<Vec<_>>(),
            "solids": arm.solids.iter().map(solid).collect::<Vec<_>>(),
            "ignored": arm.ignored_links,
        })
    });
    models.collect()
}

fn pose(pose: &Pose) -> Value {
    let (position, quaternion) = position_quaternion(pose);
    json!({"position": position, "quaternion": quaternion})
}

fn request(problem: &PlanningProblem) -> Value {
    let mut used = 0;
    let arms = problem.robots.iter().zip(&problem.world_from_bases).map(|(robot, base)| {
        let own = used..used + robot.joints.len();
        used = own.end;
        json!({"robot": robot.name, "base": pose(base), "start": problem.start[own.clone()], "goal": problem.goal[own]})
    });
    let arms: Vec<Value> = arms.collect();
    let obstacles = problem.obstacles.iter().filter_map(|obstacle| match obstacle.solid.shape {
        Shape::Box { half_extents } => {
            Some(json!({"type": "box", "pose": pose(&obstacle.solid.carrier_from_solid), "half_extents": half_extents}))
        }
        _ => None,
    });
    json!({"arms": arms, "obstacles": obstacles.collect::<Vec<_>>()})
}
