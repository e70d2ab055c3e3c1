//! `plan`: a collision-free path of several arms at once, from a JSON request to a JSON answer (`interfaces`: `plan`).

use crate::{
    json::{Document, DocumentError, JsonPath, JsonPose, object, objects},
    wording::{quoted, unknown},
};
use serde::{Deserialize, Serialize};
use vmao_core::{
    collision::{CollisionWorld, Obstacle},
    geometry::Pose,
    planning::{PlanOutcome, PlanSettings, plan, time_path},
    random::Stream,
    robots::RobotModel,
    shape::{Shape, Solid},
    time_parameterization::{MotionLimits, Trajectory},
};

/// Most arms of one request.
pub const MAX_ARMS: usize = 6;
/// Most obstacles of one request.
pub const MAX_OBSTACLES: usize = 1000;
/// Positions and sizes in requests are within this (m).
const MAX_LENGTH: f64 = 100.0;
/// Highest margin that can be asked for (m).
const MAX_MARGIN: f64 = 0.5;
/// Shortest and longest period of a sampled trajectory (s).
const PERIODS: [f64; 2] = [1e-3, 10.0];
/// Least distance that is kept unless the request says otherwise or begins or ends closer (m).
const DEFAULT_MARGIN: f64 = 0.005;

/// What is asked: arms, where they are and shall be, and what is in the way.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The arms, 1 to [`MAX_ARMS`].
    #[serde(deserialize_with = "objects")]
    pub arms: Vec<ArmRequest>,
    /// What stands around.
    #[serde(default, deserialize_with = "objects")]
    pub obstacles: Vec<ObstacleRequest>,
    /// Height below which everything is solid (m); no floor if absent.
    pub floor: Option<f64>,
    /// Least distance to keep (m); if absent 5 mm, or nine tenths of what start and goal keep if that is less.
    pub margin: Option<f64>,
    /// Period of the trajectory to return (s); none is returned if absent.
    pub time_step: Option<f64>,
}

/// An arm that shall move.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmRequest {
    /// Its name, one of [`RobotModel::NAMES`].
    pub robot: String,
    /// Where its base stands, world frame.
    #[serde(deserialize_with = "object")]
    pub base: JsonPose,
    /// Joint angles now (rad).
    pub start: Vec<f64>,
    /// Joint angles wanted (rad).
    pub goal: Vec<f64>,
    /// Distance between the pads (m); as wide as they go if absent.
    pub opening: Option<f64>,
}

/// A solid in the way.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObstacleRequest {
    /// `box`, `sphere`, `cylinder` or `capsule`; the last two lie along z.
    #[serde(rename = "type")]
    pub kind: String,
    /// Its centre's pose, world frame.
    #[serde(deserialize_with = "object")]
    pub pose: JsonPose,
    /// Half the edges of a box (m).
    pub half_extents: Option<[f64; 3]>,
    /// Radius of the other kinds (m).
    pub radius: Option<f64>,
    /// Half the straight length of a cylinder or capsule (m).
    pub half_length: Option<f64>,
}

/// A path or why there is none.
#[derive(Debug, Clone, Serialize)]
pub struct Answer {
    /// Whether a path was found.
    pub success: bool,
    /// Angles of all arms, arm after arm, from start to goal, joined by straight lines (rad); empty without success.
    pub path: Vec<Vec<f64>>,
    /// Why there is no path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Distance that was kept at every check; half of it holds between them too (m).
    pub margin: f64,
    /// Time of the fastest motion along the path that cuts corners where that is free (s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub duration: Option<f64>,
    /// That motion, if asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trajectory: Option<Samples>,
}

/// A motion sampled evenly, its end included.
#[derive(Debug, Clone, Serialize)]
pub struct Samples {
    /// Times from the start (s).
    pub times: Vec<f64>,
    /// Angles of all arms at these times (rad).
    pub positions: Vec<Vec<f64>>,
    /// Their speeds (rad/s).
    pub velocities: Vec<Vec<f64>>,
}

/// The path that `document` asks for, or the first thing that is wrong with the request.
///
/// That no path was found is an answer, not an error.
pub fn answer(document: &Document, seed: u64) -> Result<Answer, DocumentError> {
    let request: Request = document.parse()?;
    let robots = robots(document, &request)?;
    let world = world(document, &request, &robots)?;
    let all = |of: fn(&ArmRequest) -> &Vec<f64>| request.arms.iter().flat_map(of).copied().collect::<Vec<f64>>();
    let (start, goal) = (all(|arm| &arm.start), all(|arm| &arm.goal));
    let margin = margin(document, &request, &world, [&start, &goal])?;
    let period = request.time_step;
    if period.is_some_and(|period| !(PERIODS[0]..=PERIODS[1]).contains(&period)) {
        let message = format!("{} s, expected {} to {} s", period.unwrap_or_default(), PERIODS[0], PERIODS[1]);
        return Err(document.refuse(&JsonPath::key("time_step"), message));
    }
    let settings = PlanSettings { margin, ..PlanSettings::default() };
    let mut answer = Answer { success: false, path: Vec::new(), reason: None, margin, duration: None, trajectory: None };
    match plan(&world, &start, &goal, &settings, &mut Stream::new(seed, &[])) {
        PlanOutcome::Path(path) => {
            if let Some(trajectory) = time_path(&world, &path, &MotionLimits::of(&robots), &settings) {
                answer.duration = Some(trajectory.duration());
                answer.trajectory = period.map(|period| Samples::of(&trajectory, period));
            }
            answer.success = true;
            answer.path = path;
        }
        PlanOutcome::Failed(failure) => answer.reason = Some(failure.to_string()),
    }
    Ok(answer)
}

impl Samples {
    fn of(trajectory: &Trajectory, period: f64) -> Self {
        let count = (trajectory.duration() / period).ceil() as usize;
        let times: Vec<f64> = (0..=count).map(|i| (i as f64 * period).min(trajectory.duration())).collect();
        let (positions, velocities) = times.iter().map(|&time| trajectory.at(time)).unzip();
        Self { times, positions, velocities }
    }
}

fn robots(document: &Document, request: &Request) -> Result<Vec<RobotModel>, DocumentError> {
    let list = JsonPath::key("arms");
    if request.arms.is_empty() || request.arms.len() > MAX_ARMS {
        return Err(document.refuse(&list, format!("{} arms, expected 1 to {MAX_ARMS}", request.arms.len())));
    }
    let robot = |(index, arm): (usize, &ArmRequest)| {
        let at = |key| list.clone().at(index).then(key);
        let Some(robot) = RobotModel::named(&arm.robot) else {
            return Err(document.refuse(&at("robot"), unknown("the program", "robot", &arm.robot, RobotModel::NAMES)));
        };
        for (key, angles) in [("start", &arm.start), ("goal", &arm.goal)] {
            if angles.len() != robot.joints.len() {
                let message =
                    format!("{} angles, expected {}: one for each joint of {}", angles.len(), robot.joints.len(), robot.name);
                return Err(document.refuse(&at(key), message));
            }
        }
        let [closed, open] = [robot.gripper.closed_gap, robot.gripper.max_opening()];
        if arm.opening.is_some_and(|opening| !(closed..=open).contains(&opening)) {
            let message = format!(
                "{} m, expected {closed} to {open} m, what the gripper of {} can do",
                arm.opening.unwrap_or_default(),
                robot.name
            );
            return Err(document.refuse(&at("opening"), message));
        }
        Ok(robot)
    };
    request.arms.iter().enumerate().map(robot).collect()
}

fn world(document: &Document, request: &Request, robots: &[RobotModel]) -> Result<CollisionWorld, DocumentError> {
    let list = JsonPath::key("obstacles");
    if request.obstacles.len() > MAX_OBSTACLES {
        return Err(document.refuse(&list, format!("{} obstacles, expected at most {MAX_OBSTACLES}", request.obstacles.len())));
    }
    if request.floor.is_some_and(|height| height.abs() > MAX_LENGTH) {
        let message = format!("{} m, expected within {MAX_LENGTH} m of the origin", request.floor.unwrap_or_default());
        return Err(document.refuse(&JsonPath::key("floor"), message));
    }
    let mut world = CollisionWorld { floor_height: request.floor, ..CollisionWorld::default() };
    for (index, (arm, robot)) in request.arms.iter().zip(robots).enumerate() {
        let world_from_base = pose(document, &JsonPath::key("arms").at(index).then("base"), &arm.base)?;
        world.arms.push(robot.collision_model(world_from_base, arm.opening.unwrap_or(robot.gripper.max_opening())));
    }
    for (index, obstacle) in request.obstacles.iter().enumerate() {
        let path = list.clone().at(index);
        let carrier_from_solid = pose(document, &path.clone().then("pose"), &obstacle.pose)?;
        let solid = Solid { shape: shape(document, &path, obstacle)?, carrier_from_solid, color: [0.5; 3] };
        world.obstacles.push(Obstacle { name: path.to_string(), solid });
    }
    Ok(world)
}

fn shape(document: &Document, path: &JsonPath, obstacle: &ObstacleRequest) -> Result<Shape, DocumentError> {
    const KINDS: [&str; 4] = ["box", "sphere", "cylinder", "capsule"];
    let kind = &*obstacle.kind;
    let has = [obstacle.half_extents.is_some(), obstacle.radius.is_some(), obstacle.half_length.is_some()];
    let needs = match kind {
        "box" => [true, false, false],
        "sphere" => [false, true, false],
        "cylinder" | "capsule" => [false, true, true],
        _ => {
            let message = format!("{}, expected one of: {}", quoted(kind), KINDS.join(", "));
            return Err(document.refuse(&path.clone().then("type"), message));
        }
    };
    for (field, (has, needs)) in ["half_extents", "radius", "half_length"].into_iter().zip(has.into_iter().zip(needs)) {
        if has != needs {
            let place = if has { path.clone().then(field) } else { path.clone() };
            let message = if needs { format!("a {kind} without {field}") } else { format!("a {kind} has no {field}") };
            return Err(document.refuse(&place, message));
        }
    }
    let size = |field: &str, size: f64| {
        if size > 0.0 && size <= MAX_LENGTH {
            return Ok(size);
        }
        let message = format!("{size} m, expected more than 0 and at most {MAX_LENGTH} m");
        Err(document.refuse(&path.clone().then(field), message))
    };
    let [x, y, z] = obstacle.half_extents.unwrap_or_default();
    let radius = || size("radius", obstacle.radius.unwrap_or_default());
    let half_length = || size("half_length", obstacle.half_length.unwrap_or_default());
    Ok(match kind {
        "box" => Shape::Box { half_extents: [size("half_extents", x)?, size("half_extents", y)?, size("half_extents", z)?] },
        "sphere" => Shape::Sphere { radius: radius()? },
        "cylinder" => Shape::Cylinder { radius: radius()?, half_length: half_length()? },
        _ => Shape::Capsule { radius: radius()?, half_length: half_length()? },
    })
}

fn pose(document: &Document, path: &JsonPath, pose: &JsonPose) -> Result<Pose, DocumentError> {
    if let Some(coordinate) = pose.position.into_iter().find(|x| x.abs() > MAX_LENGTH) {
        let message = format!("{coordinate} m, expected within {MAX_LENGTH} m of the origin");
        return Err(document.refuse(&path.clone().then("position"), message));
    }
    document.pose(pose, path)
}

/// The least distance to keep (m): as asked, or the default, cut to what start and goal keep.
fn margin(document: &Document, request: &Request, world: &CollisionWorld, ends: [&[f64]; 2]) -> Result<f64, DocumentError> {
    const SHARE: f64 = 0.9; // of the clearance of the ends, so that rounding does not refuse them
    match request.margin {
        Some(margin) if !(0.0..=MAX_MARGIN).contains(&margin) => {
            let message = format!("{margin} m, expected 0 to {MAX_MARGIN} m");
            Err(document.refuse(&JsonPath::key("margin"), message))
        }
        Some(margin) => Ok(margin),
        None => {
            let clearance = ends.into_iter().map(|q| world.clearance(q)).fold(f64::INFINITY, f64::min);
            Ok((SHARE * clearance).clamp(0.0, DEFAULT_MARGIN))
        }
    }
}
