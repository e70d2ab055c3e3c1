//! Planning problems by seed: arms that reach into shelves, and arms that must cross each other.
//!
//! Each problem is made around a witness: every arm, one after the other, backs its tool off in a straight line and goes
//! home, from the start and from the goal. The way there and back is checked without gaps, so every problem has a
//! solution, though a poor one. Tools stand where inverse kinematics put them; nothing else is sought to make it easy.

use crate::{
    collision::{CollisionChecker, CollisionWorld, Obstacle},
    geometry::{Pose, pose, rotation_exp, translation},
    inverse_kinematics::{IkSettings, solutions, track},
    random::Stream,
    robots::RobotModel,
    shape::{Shape, Solid},
};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Where the arms have to go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Arms side by side before a shelf of nine bays; every tool goes from one bay into another.
    Shelf,
    /// Arms around a table whose tools change places; one arm alone must get round a gantry.
    Crossed,
}

/// Arms, where they are and shall be, and what is in the way.
#[derive(Debug, Clone)]
pub struct PlanningProblem {
    /// The arms, their grippers open.
    pub robots: Vec<RobotModel>,
    /// Where they stand.
    pub world_from_bases: Vec<Pose>,
    /// What is in the way: boxes.
    pub obstacles: Vec<Obstacle>,
    /// Angles of all arms at the start (rad).
    pub start: Vec<f64>,
    /// Angles of all arms at the goal (rad).
    pub goal: Vec<f64>,
    /// A way from start to goal that is clear by [`WITNESS_MARGIN`]: the proof that there is one.
    pub witness: Vec<Vec<f64>>,
}

/// Least distance that a witness keeps (m).
pub const WITNESS_MARGIN: f64 = 0.006;
/// Least distance at start and goal (m).
const END_MARGIN: f64 = 0.01;

impl PlanningProblem {
    /// Problem number `index` of `family` for arms of these kinds.
    ///
    /// Problems differ in the furniture's sizes and places, the tools' places, leans and turns. Panics if `robots` is empty.
    pub fn new(family: Family, robots: &[RobotModel], index: u64) -> Self {
        assert!(!robots.is_empty(), "a problem needs an arm");
        let mut stream = Stream::new(index, &[71, family as u64, robots.len() as u64]);
        loop {
            if let Some(problem) = draw(family, robots, &mut stream) {
                return problem;
            }
        }
    }

    /// The collision world of the problem.
    pub fn world(&self) -> CollisionWorld {
        let arm = |(robot, base): (&RobotModel, &Pose)| robot.collision_model(*base, robot.gripper.max_opening());
        CollisionWorld {
            arms: self.robots.iter().zip(&self.world_from_bases).map(arm).collect(),
            obstacles: self.obstacles.clone(),
            ..CollisionWorld::default()
        }
    }
}

/// Where tools may be asked to be: a pose that tools lean and turn about, and how a tool backs off from there (m).
struct Place {
    world_from_tool: Pose,
    retreat: Vector3<f64>,
}

/// One attempt: furniture, then places for start and goal, then arms in them and their ways home.
fn draw(family: Family, robots: &[RobotModel], stream: &mut Stream) -> Option<PlanningProblem> {
    const DRAWS: usize = 40; // of the tools, before the furniture is drawn anew
    let arms = robots.len();
    let (world_from_bases, obstacles, places) = match family {
        Family::Shelf => shelf(robots, stream),
        Family::Crossed => crossed(robots, stream),
    };
    let mut problem = PlanningProblem {
        robots: robots.to_vec(),
        world_from_bases,
        obstacles,
        start: Vec::new(),
        goal: Vec::new(),
        witness: Vec::new(),
    };
    let world = problem.world();
    let mut checker = CollisionChecker::new(&world);
    let mut way_home = |chosen: &[usize], stream: &mut Stream| {
        (0..DRAWS).find_map(|_| {
            let ways = chosen.iter().enumerate().map(|(arm, &place)| problem.retreat(&world, arm, &places[place], stream));
            one_after_the_other(&mut checker, &ways.collect::<Option<Vec<_>>>()?, stream)
        })
    };
    let from = &stream.permutation(places.len())[..arms];
    let to: Vec<usize> = match family {
        Family::Shelf => {
            let order = stream.permutation(places.len());
            let mut free = order.into_iter().filter(|place| !from.contains(place));
            (0..arms).map_while(|_| free.next()).collect()
        }
        Family::Crossed if arms == 1 => vec![(from[0] + 1) % places.len()],
        Family::Crossed => (0..arms).map(|arm| from[(arm + 1) % arms]).collect(),
    };
    let out = way_home(from, stream)?;
    let mut back = way_home(&to, stream)?;
    back.reverse();
    problem.start.clone_from(out.first()?);
    problem.goal.clone_from(back.last()?);
    problem.witness = out;
    problem.witness.extend(back.into_iter().skip(1));
    Some(problem)
}

impl PlanningProblem {
    /// The angles of one arm in a place, backing off from it, and at home; none if that is out of reach.
    fn retreat(&self, world: &CollisionWorld, arm: usize, place: &Place, stream: &mut Stream) -> Option<Vec<Vec<f64>>> {
        const STEPS: usize = 8;
        let (chain, robot) = (&world.arms[arm].chain, &self.robots[arm]);
        let lean = rotation_exp(&Vector3::from_fn(|_, _| stream.range(-0.35, 0.35)));
        let half_turn = if stream.unit() < 0.5 { 0.0 } else { PI };
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), stream.range(-0.6, 0.6) + half_turn);
        let shift = Vector3::from_fn(|_, _| stream.range(-0.04, 0.04));
        let middle = &place.world_from_tool;
        let world_from_tool = Pose::from_parts((middle.translation.vector + shift).into(), middle.rotation * lean * turn);
        let base_from_world = self.world_from_bases[arm].inverse();
        let settings = IkSettings { restarts: 10, ..IkSettings::default() };
        let reached = solutions(chain, &(base_from_world * world_from_tool), &robot.home, 2, &settings, stream);
        let there = reached.into_iter().next()?;
        let back_off = |step: usize| {
            let shift = place.retreat * (step as f64 / STEPS as f64);
            base_from_world * Translation3::from(shift) * world_from_tool
        };
        let poses: Vec<Pose> = (1..=STEPS).map(back_off).collect();
        let mut way = vec![there.clone()];
        way.extend(track(chain, &poses, &there, 0.5, &settings).ok()?);
        way.push(robot.home.clone());
        Some(way)
    }
}

/// All arms' ways home, walked one after the other in some order that is free; from the configuration where all are out.
fn one_after_the_other(checker: &mut CollisionChecker<'_>, ways: &[Vec<Vec<f64>>], stream: &mut Stream) -> Option<Vec<Vec<f64>>> {
    const ORDERS: usize = 3;
    let out: Vec<f64> = ways.iter().flat_map(|way| way[0].clone()).collect();
    if !checker.is_free(&out, END_MARGIN) {
        return None;
    }
    let first_joint = |arm: usize| ways[..arm].iter().map(|way| way[0].len()).sum::<usize>();
    (0..ORDERS).find_map(|_| {
        let mut path = vec![out.clone()];
        for arm in stream.permutation(ways.len()) {
            for own in &ways[arm][1..] {
                let before = path.last()?;
                let mut next = before.clone();
                next[first_joint(arm)..][..own.len()].copy_from_slice(own);
                if !checker.edge_is_free(before, &next, WITNESS_MARGIN) {
                    return None;
                }
                path.push(next);
            }
        }
        Some(path)
    })
}

/// How much further a robot reaches than a Panda (m).
fn longer(robots: &[RobotModel]) -> f64 {
    let reach = |robot: &RobotModel| -> f64 {
        robot.joints.iter().skip(1).map(|joint| joint.parent_from_joint.translation.vector.norm()).sum()
    };
    let least = robots.iter().map(reach).fold(f64::INFINITY, f64::min);
    (least - 0.88).max(0.0) / 2.0
}

fn board(name: &str, center: [f64; 3], half_extents: [f64; 3]) -> Obstacle {
    let carrier_from_solid = translation(center[0], center[1], center[2]);
    Obstacle {
        name: name.to_owned(),
        solid: Solid { shape: Shape::Box { half_extents }, carrier_from_solid, color: [0.6, 0.5, 0.4] },
    }
}

/// The table that all stand on; its top lies a little below the bases.
fn table() -> Obstacle {
    board("table", [0.0, 0.0, -0.06], [1.5, 1.5, 0.05])
}

type Setting = (Vec<Pose>, Vec<Obstacle>, Vec<Place>);

/// Three boards and a top, four walls and a back before a row of arms, which look along +x.
fn shelf(robots: &[RobotModel], stream: &mut Stream) -> Setting {
    const COLUMNS: usize = 3;
    const ROWS: usize = 3;
    const HALF_THICKNESS: f64 = 0.01;
    let arms = robots.len();
    let spacing = stream.range(0.5, 0.6);
    let row = |arm: usize| (arm as f64 - (arms - 1) as f64 / 2.0) * spacing;
    let bases = (0..arms).map(|arm| translation(0.0, row(arm), 0.0)).collect();
    let front = stream.range(0.42, 0.52) + longer(robots);
    let (width, height) = (stream.range(0.36, 0.44), stream.range(0.27, 0.33));
    let (depth, lowest) = (stream.range(0.25, 0.35), stream.range(0.1, 0.2));
    let (half_width, top) = (0.5 * COLUMNS as f64 * width, lowest + ROWS as f64 * height);
    let middle = front + depth / 2.0;
    let mut obstacles = vec![table()];
    for level in 0..=ROWS {
        let z = lowest + level as f64 * height;
        obstacles.push(board(&format!("board {level}"), [middle, 0.0, z], [depth / 2.0, half_width, HALF_THICKNESS]));
    }
    let half_height = (top - lowest) / 2.0;
    for wall in 0..=COLUMNS {
        let center = [middle, wall as f64 * width - half_width, lowest + half_height];
        obstacles.push(board(&format!("wall {wall}"), center, [depth / 2.0, HALF_THICKNESS, half_height]));
    }
    obstacles.push(board("back", [front + depth, 0.0, lowest + half_height], [HALF_THICKNESS, half_width, half_height]));
    let into = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2);
    let mut places = Vec::new();
    for column in 0..COLUMNS {
        for row in 0..ROWS {
            let (y, z) = ((column as f64 + 0.5) * width - half_width, lowest + (row as f64 + 0.5) * height);
            let position = Translation3::new(front + stream.range(0.08, 0.6 * depth), y, z);
            places.push(Place { world_from_tool: Pose::from_parts(position, into), retreat: Vector3::new(-0.22, 0.0, 0.0) });
        }
    }
    (bases, obstacles, places)
}

/// Arms on a ring that look inwards; as many places near its middle as arms, tools down. One arm gets a gantry over it.
fn crossed(robots: &[RobotModel], stream: &mut Stream) -> Setting {
    let arms = robots.len();
    let radius = stream.range(0.5, 0.6) + longer(robots) + if arms > 2 { 0.05 } else { 0.0 };
    let base = |arm: usize| {
        let angle = TAU * arm as f64 / arms as f64;
        let facing = angle + PI;
        let turn = pose([0.0; 3], [(facing / 2.0).cos(), 0.0, 0.0, (facing / 2.0).sin()]);
        translation(radius * angle.cos(), radius * angle.sin(), 0.0) * turn
    };
    let bases = (0..arms).map(base).collect();
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
    let mut obstacles = vec![table()];
    let count = arms.max(2);
    let (first, ring) = (stream.range(0.0, TAU), stream.range(0.14, 0.24));
    if arms == 1 {
        let (tall, across) = (stream.range(0.35, 0.5), stream.range(0.25, 0.4));
        obstacles.push(board("beam", [0.0, 0.0, tall], [across, 0.03, 0.03]));
        obstacles.push(board("post", [-across, 0.0, tall / 2.0 - 0.02], [0.03, 0.03, tall / 2.0 - 0.02]));
        obstacles.push(board("other post", [across - 0.1, 0.0, tall / 2.0 - 0.02], [0.03, 0.03, tall / 2.0 - 0.02]));
    }
    let place = |index: usize| {
        // a lone arm's two places lie on both sides of the beam
        let angle = if arms == 1 { FRAC_PI_2 } else { first } + TAU * index as f64 / count as f64;
        let position = Translation3::new(ring * angle.cos(), ring * angle.sin(), stream.range(0.1, 0.35));
        Place { world_from_tool: Pose::from_parts(position, down), retreat: Vector3::new(0.0, 0.0, 0.2) }
    };
    let places = (0..count).map(place).collect();
    (bases, obstacles, places)
}
