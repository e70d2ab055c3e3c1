//! A made-up motion: two jointed arms take a pair of pliers apart-wise and carry it to a goal. No physics.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use vmao_core::{
    geometry::{Pose, interpolate, minimum_jerk, pose, rotation_exp, translation},
    observation::PointLabel,
    rollout::{PadForce, Rollout, RolloutBody, RolloutContact, RolloutEvent},
    shape::{Shape, Solid},
};

const WHITE: [f32; 3] = [0.93, 0.93, 0.94];
const DARK: [f32; 3] = [0.22, 0.24, 0.27];
const STEEL: [f32; 3] = [0.62, 0.65, 0.68];
const HANDLES: [[f32; 3]; 2] = [[0.78, 0.24, 0.2], [0.93, 0.68, 0.2]];
const SHOULDER: f64 = 0.333;
const UPPER: f64 = 0.33;
const LOWER: f64 = 0.36;
const HAND: f64 = 0.19;
const SECONDS: f64 = 1.0 / 30.0;

fn solid(shape: Shape, carrier_from_solid: Pose, color: [f32; 3]) -> Solid {
    Solid { shape, carrier_from_solid, color }
}

fn capsule(radius: f64, half_length: f64) -> Shape {
    Shape::Capsule { radius, half_length }
}

/// Solids of a pliers' half in its own frame; `side` is 1 or −1.
pub(crate) fn pliers_half(part: usize) -> Vec<Solid> {
    let side = if part == 0 { 1.0 } else { -1.0 };
    let along_x = |x: f64, y: f64, turn: f64| {
        translation(x, y, 0.0) * Pose::rotation(Vector3::z() * turn) * Pose::rotation(Vector3::y() * std::f64::consts::FRAC_PI_2)
    };
    vec![
        solid(capsule(0.009, 0.055), along_x(-0.088, side * 0.012, -side * 0.13), HANDLES[part]),
        solid(capsule(0.006, 0.02), along_x(-0.018, side * 0.003, -side * 0.15), STEEL),
        solid(Shape::Cylinder { radius: 0.0135, half_length: 0.0085 }, translation(0.0, 0.0, side * 0.001), STEEL),
        solid(Shape::Box { half_extents: [0.026, 0.0065, 0.007] }, translation(0.034, -side * 0.007, 0.0), STEEL),
    ]
}

/// World poses of both halves for the object's pose and opening angle.
pub(crate) fn halves(world_from_object: &Pose, opening: f64) -> [Pose; 2] {
    [-1.0, 1.0].map(|sign| world_from_object * Pose::rotation(Vector3::z() * (sign * opening / 2.0)))
}

fn between(start: Point3<f64>, end: Point3<f64>) -> Pose {
    let along = end - start;
    let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &along).unwrap_or_default();
    Pose::from_parts(((start.coords + end.coords) / 2.0).into(), rotation)
}

/// Poses of an arm's eight bodies with the tool here; the tool's z points out of the gripper.
fn arm(base: Point3<f64>, tool: &Pose, opening: f64) -> Vec<Pose> {
    let shoulder = base + Vector3::z() * SHOULDER;
    let wrist = tool * Point3::new(0.0, 0.0, -HAND);
    let reach = wrist - shoulder;
    let length = reach.norm().min(UPPER + LOWER - 1e-3);
    let cosine = (UPPER * UPPER + length * length - LOWER * LOWER) / (2.0 * UPPER * length);
    let sideways = reach.cross(&Vector3::z()).normalize();
    let elbow = shoulder + rotation_exp(&(sideways * cosine.acos())) * (reach.normalize() * UPPER);
    let yaw = Pose::from_parts(shoulder.coords.into(), rotation_exp(&(Vector3::z() * reach.y.atan2(reach.x))));
    let finger = |sign: f64| tool * translation(0.0, sign * (opening / 2.0 + 0.006), -0.018);
    vec![
        Pose::translation(base.x, base.y, base.z),
        yaw,
        between(shoulder, elbow),
        between(elbow, wrist),
        tool * translation(0.0, 0.0, -0.15),
        tool * translation(0.0, 0.0, -0.075),
        finger(1.0),
        finger(-1.0),
    ]
}

fn arm_bodies(index: u16) -> Vec<RolloutBody> {
    let own = Pose::identity();
    let flat = Pose::rotation(Vector3::x() * std::f64::consts::FRAC_PI_2);
    let parts = [
        ("base", vec![solid(Shape::Cylinder { radius: 0.075, half_length: 0.11 }, translation(0.0, 0.0, 0.11), WHITE)]),
        (
            "shoulder",
            vec![
                solid(Shape::Cylinder { radius: 0.058, half_length: 0.07 }, flat, DARK),
                solid(capsule(0.057, 0.05), translation(0.0, 0.0, -0.08), WHITE),
            ],
        ),
        ("upper", vec![solid(capsule(0.05, UPPER / 2.0 - 0.03), own, WHITE)]),
        (
            "lower",
            vec![
                solid(capsule(0.043, LOWER / 2.0 - 0.03), own, WHITE),
                solid(Shape::Sphere { radius: 0.056 }, translation(0.0, 0.0, -LOWER / 2.0), DARK),
            ],
        ),
        ("wrist", vec![solid(capsule(0.04, 0.03), own, DARK)]),
        ("hand", vec![solid(Shape::Box { half_extents: [0.03, 0.1, 0.03] }, own, WHITE)]),
        ("finger 1", vec![solid(Shape::Box { half_extents: [0.009, 0.006, 0.027] }, own, DARK)]),
        ("finger 2", vec![solid(Shape::Box { half_extents: [0.009, 0.006, 0.027] }, own, DARK)]),
    ];
    parts
        .into_iter()
        .map(|(name, solids)| RolloutBody { name: format!("arm {index} {name}"), label: PointLabel::Arm(index), solids })
        .collect()
}

/// Where the pliers lie at first, and where they go: pose and opening (rad).
pub(crate) fn start_and_goal() -> [(Pose, f64); 2] {
    let start = pose([0.02, 0.03, 0.009], [0.735, 0.0, 0.0, 0.678]);
    let tilt = rotation_exp(&Vector3::new(0.16, 0.12, 0.0)) * rotation_exp(&(Vector3::z() * 2.05));
    [(start, 0.35), (Pose::from_parts(Vector3::new(-0.05, 0.1, 0.17).into(), tilt), 0.95)]
}

/// Where arm `index` holds its half, in that half's frame: the tool points down, the fingers close across the handle.
fn grasp(index: usize) -> Pose {
    let side = if index == 0 { 1.0 } else { -1.0 };
    translation(-0.1, side * 0.0135, 0.0) * Pose::rotation(Vector3::x() * std::f64::consts::PI)
}

/// A motion that reaches the goal, or loses the second part on the way.
pub(crate) fn rollout(fails: bool) -> Rollout {
    let [(start, closed), (goal, open)] = start_and_goal();
    let bases = [Point3::new(-0.52, -0.06, 0.0), Point3::new(0.56, -0.06, 0.0)];
    let lost = 7.3;
    let end = if fails { 9.2 } else { 10.5 };
    let progress = |time: f64| minimum_jerk(time - 6.0, 3.2);
    let object = |time: f64| {
        let s = progress(time);
        halves(&interpolate(&start, &goal, s), closed + (open - closed) * s)
    };
    let parts = |time: f64| {
        let mut parts = object(time);
        if fails && time > lost {
            let held = object(lost)[1];
            let fall = time - lost;
            let height = (held.translation.z - 0.5 * 9.81 * fall * fall).max(0.009);
            let flat = minimum_jerk(fall, 0.2);
            parts[1] = interpolate(&held, &start, 0.35 * flat);
            parts[1].translation.z = height;
        }
        parts
    };
    let tool = |index: usize, time: f64| {
        let begin = if index == 0 { 0.0 } else { 3.0 };
        let at_part = object(time)[index] * grasp(index);
        let above = at_part * translation(0.0, 0.0, -0.12);
        let home = pose([bases[index].x * 0.45, -0.16, 0.36], [0.0, 1.0, 0.0, 0.0]);
        let near = interpolate(&home, &above, minimum_jerk(time - begin, 1.5));
        interpolate(&near, &at_part, minimum_jerk(time - begin - 1.5, 0.8))
    };
    let opening = |index: usize, time: f64| 0.075 - 0.057 * minimum_jerk(time - if index == 0 { 2.4 } else { 5.4 }, 0.4);

    let table = Solid {
        shape: Shape::Box { half_extents: [0.8, 0.5, 0.02] },
        carrier_from_solid: Pose::identity(),
        color: [0.80, 0.74, 0.66],
    };
    let mut bodies = vec![RolloutBody { name: "table".into(), label: PointLabel::Table, solids: vec![table] }];
    bodies.extend((0..2).flat_map(arm_bodies));
    for part in 0..2 {
        let name = ["handle-a", "handle-b"][part].into();
        bodies.push(RolloutBody { name, label: PointLabel::Part(part as u16), solids: pliers_half(part) });
    }
    let frames: Vec<Vec<Pose>> = (0..=(end / SECONDS) as usize)
        .map(|k| {
            let time = k as f64 * SECONDS;
            let mut frame = vec![translation(0.0, 0.0, -0.02)];
            for index in 0..2 {
                frame.extend(arm(bases[index], &tool(index, time), opening(index, time)));
            }
            frame.extend(parts(time));
            frame
        })
        .collect();
    let touch = |index: usize, time: f64| {
        let at = |y: f64| -> [f64; 3] { (object(time)[index] * grasp(index) * Point3::new(0.0, y, 0.0)).coords.into() };
        RolloutContact { time, arm: index as u16, part: index as u16, fingers: [at(0.009), at(-0.009)] }
    };
    // Each hand squeezes with 12 N from when it has closed, and carries 1.5 N upward while the object moves.
    let pads = |index: usize, time: f64| {
        let holds = time > if index == 0 { 2.8 } else { 5.8 } && !(fails && index == 1 && time > lost);
        [0.009, -0.009].map(|y| {
            if !holds {
                return PadForce::default();
            }
            let world = object(time)[index] * grasp(index);
            let up = if time > 6.0 { 0.75 } else { 0.0 };
            let squeeze = world.rotation * Vector3::new(0.0, -12.0 * y / 0.009, 0.0);
            PadForce { point: (world * Point3::new(0.0, y, 0.0)).coords.into(), force: (squeeze + Vector3::z() * up).into() }
        })
    };
    let forces = (0..frames.len()).map(|k| [0, 1].map(|arm| pads(arm, k as f64 * SECONDS)).to_vec()).collect();
    let mut stages = vec![
        (0.0, "approach handle-a with arm 0"),
        (1.5, "reach the contact points"),
        (2.4, "close gripper 0"),
        (2.8, "check the hold of arm 0"),
        (3.0, "approach handle-b with arm 1"),
        (4.5, "reach the contact points"),
        (5.4, "close gripper 1"),
        (5.8, "check the hold of arm 1"),
        (6.0, "move both parts to the goal"),
    ];
    stages.push(if fails { (lost, "slip: arm 1 lost handle-b") } else { (9.2, "hold at the goal") });
    Rollout {
        bodies,
        frame_seconds: SECONDS,
        frames,
        goal: halves(&goal, open).to_vec(),
        events: stages.into_iter().map(|(time, label)| RolloutEvent { time, label: label.into() }).collect(),
        contacts: vec![touch(0, 2.4), touch(1, 5.4)],
        forces,
        outcome: if fails { "slip: arm 1 lost handle-b 0.11 m above the table".into() } else { "success".into() },
    }
}
