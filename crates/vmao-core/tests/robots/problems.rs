//! Planning problems by seed: Pandas around a table that must cross each other, with and without boxes in between.

use super::panda_model;
use vmao_core::{
    collision::{CollisionChecker, CollisionWorld, Obstacle},
    geometry::{Pose, pose, translation},
    random::Stream,
    shape::{Shape, Solid},
};

/// A world, a start and a goal.
pub(crate) struct Problem {
    pub(crate) world: CollisionWorld,
    pub(crate) start: Vec<f64>,
    pub(crate) goal: Vec<f64>,
}

/// Pandas on a ring of 0.55 m around the origin, looking inwards.
pub(crate) fn ring(arms: usize) -> CollisionWorld {
    let base = |i: usize| -> Pose {
        let angle = std::f64::consts::TAU * i as f64 / arms as f64;
        let facing = angle + std::f64::consts::PI;
        translation(0.55 * angle.cos(), 0.55 * angle.sin(), 0.0)
            * pose([0.0; 3], [(facing / 2.0).cos(), 0.0, 0.0, (facing / 2.0).sin()])
    };
    CollisionWorld {
        arms: (0..arms).map(|i| panda_model(base(i))).collect(),
        floor_height: Some(0.0),
        ..CollisionWorld::default()
    }
}

fn solid(shape: Shape, carrier_from_solid: Pose) -> Solid {
    Solid { shape, carrier_from_solid, color: [0.5; 3] }
}

/// A shelf of two boards and two walls, and a post, all within the arms' reach.
pub(crate) fn add_shelf(world: &mut CollisionWorld) {
    let boards = [
        ("lower board", [0.18, 0.02, 0.22], [0.0, 0.0, 0.25]),
        ("upper board", [0.18, 0.02, 0.22], [0.0, 0.0, 0.75]),
        ("wall", [0.02, 0.1, 0.25], [0.0, 0.0, 0.5]),
    ];
    for (name, [x, z, y], place) in boards {
        let half_extents = if name == "wall" { [x, y, 0.25] } else { [x, y, z] };
        let place = translation(place[0], place[1], place[2]);
        world.obstacles.push(Obstacle { name: name.to_owned(), solid: solid(Shape::Box { half_extents }, place) });
    }
    let post = Shape::Cylinder { radius: 0.04, half_length: 0.4 };
    world.obstacles.push(Obstacle { name: "post".to_owned(), solid: solid(post, translation(0.0, 0.4, 0.4)) });
}

/// A problem whose start and goal are free by 2 cm and have every tool low and near the middle, where the arms meet.
pub(crate) fn problem(world: CollisionWorld, seed: u64) -> Problem {
    let mut stream = Stream::new(seed, &[41]);
    let mut checker = CollisionChecker::new(&world);
    let mut draw = || {
        loop {
            let mut q = Vec::new();
            for arm in &world.arms {
                let own = loop {
                    let own = arm.chain.sample(&mut stream);
                    let tool = (arm.world_from_base * arm.chain.tool_pose(&own)).translation.vector;
                    if tool.xy().norm() < 0.35 && (0.1..0.7).contains(&tool.z) {
                        break own;
                    }
                };
                q.extend(own);
            }
            if checker.is_free(&q, 0.02) {
                return q;
            }
        }
    };
    let (start, goal) = (draw(), draw());
    Problem { world, start, goal }
}
