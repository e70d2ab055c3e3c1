//! Prints planning problems as requests of `vmao plan`, one JSON document a line: FAMILY (shelf, crossed), robots, COUNT.
//!
//! `plan_problems crossed panda,panda 100`

use serde_json::{Value, json};
use vmao_core::{
    geometry::{Pose, position_quaternion},
    planning_problems::{Family, PlanningProblem},
    robots::RobotModel,
    shape::Shape,
};

fn main() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [family, robots, count] = arguments.as_slice() else {
        return Err("expected FAMILY ROBOT[,ROBOT]... COUNT".to_owned());
    };
    let family = match family.as_str() {
        "shelf" => Family::Shelf,
        "crossed" => Family::Crossed,
        _ => return Err(format!("no family `{family}`; families are: shelf, crossed")),
    };
    let robot = |name| RobotModel::named(name).ok_or_else(|| format!("no robot `{name}`; robots are: {:?}", RobotModel::NAMES));
    let robots = robots.split(',').map(robot).collect::<Result<Vec<_>, _>>()?;
    for index in 0..count.parse::<u64>().map_err(|error| format!("COUNT: {error}"))? {
        print(&request(&PlanningProblem::new(family, &robots, index)));
    }
    Ok(())
}

#[expect(clippy::print_stdout, reason = "the requests are the output")]
fn print(request: &Value) {
    println!("{request}");
}

fn request(problem: &PlanningProblem) -> Value {
    let pose = |pose: &Pose| {
        let (position, quaternion) = position_quaternion(pose);
        json!({"position": position, "quaternion": quaternion})
    };
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
