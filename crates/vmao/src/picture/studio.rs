//! A rollout's frames as pictures: light and shadow, the goal as a green translucent cloud, contacts, forces.

use super::eye::{Eye, fit};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI};
use vmao_core::depth_picture::{DepthPicture, Pinhole, Window};
use vmao_core::geometry::Pose;
use vmao_core::observation::PointLabel;
use vmao_core::rays::normal;
use vmao_core::rollout::{Rollout, RolloutContact};
use vmao_core::shape::{Shape, Solid};
use vmao_sim::Picture;

/// Each pixel is the mean of so many rays squared.
const RAYS: usize = 2;
const FIELD: f64 = 0.45;
const BACKGROUND: Vector3<f64> = Vector3::new(0.965, 0.961, 0.949);
const TABLE: Vector3<f64> = Vector3::new(0.86, 0.83, 0.78);
const GOAL: Vector3<f64> = Vector3::new(0.13, 0.62, 0.30);
/// Finger 1 and finger 2, as in the report.
pub(super) const FINGERS: [[f32; 3]; 2] = [[0.09, 0.57, 0.29], [0.15, 0.39, 0.85]];
const FORCE: [f32; 3] = [0.85, 0.45, 0.05];
/// Share of the light that comes from everywhere, and what a shadow leaves of the rest.
const AMBIENT: f64 = 0.46;
const SHADED: f64 = 0.25;
/// From the target to the light, seen from the eye: right, up (world), towards the eye.
const TO_LIGHT: [f64; 3] = [-0.5, 1.6, 0.9];
const LIGHT_PIXELS: usize = 640;
/// How far behind the nearest surface a point must be to lie in its shadow (m).
const BIAS: f64 = 0.008;
/// Edge of the cells that hold one point of the goal's cloud, and the radius of a point (m).
const CELL: f64 = 0.006;
const DOT: f64 = 0.0024;
const CONTACT_RADIUS: f64 = 0.007;
const METRES_PER_NEWTON: f64 = 0.004;
/// Room for hands about the parts (m).
const WORK_ROOM: f64 = 0.16;
const TABLE_NUMBER: u32 = u32::MAX - 1;

/// What is drawn besides bodies and goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Layer {
    /// Asked contacts and the pads' forces.
    Touch,
    /// Nothing.
    Plain,
}

/// How much is to be seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Framing {
    /// Arms and object.
    Whole,
    /// The object's way and the hands about it.
    Work,
}

/// A rollout set up for pictures.
#[derive(Debug)]
pub(crate) struct Studio<'r> {
    rollout: &'r Rollout,
    goal_points: Vec<Point3<f64>>,
    /// The direction from which the arms stand side by side (rad).
    front: f64,
    /// What a picture of everything must hold, and one of the work: places and room about them (m).
    whole: Vec<(Point3<f64>, f64)>,
    work: Vec<(Point3<f64>, f64)>,
}

/// A solid where it is.
struct Placed<'s> {
    shape: &'s Shape,
    world_from_solid: Pose,
    color: Vector3<f64>,
}

impl<'r> Studio<'r> {
    /// Sets a rollout up; it must have a frame.
    pub(crate) fn new(rollout: &'r Rollout) -> Self {
        let parts = || rollout.bodies.iter().filter(|body| matches!(body.label, PointLabel::Part(_)));
        let goal: Vec<(&Solid, Pose)> = parts()
            .zip(&rollout.goal)
            .flat_map(|(body, pose)| body.solids.iter().map(move |solid| (solid, pose * solid.carrier_from_solid)))
            .collect();
        let goal_points = surface(&goal);
        let whole = balls(rollout, &goal_points, &|label| match label {
            PointLabel::Table => None,
            PointLabel::Arm(_) => Some(0.07),
            PointLabel::Part(_) => Some(0.05),
        });
        let work = balls(rollout, &goal_points, &|label| matches!(label, PointLabel::Part(_)).then_some(WORK_ROOM));
        let front = front(rollout, &whole);
        Self { rollout, goal_points, front, whole, work }
    }

    /// An eye for all frames, turned from the front by `turn` and above the level by `elevation` (rad).
    pub(crate) fn eye(&self, [turn, elevation]: [f64; 2], aspect: f64, framing: Framing) -> Eye {
        let balls = if framing == Framing::Whole { &self.whole } else { &self.work };
        fit(balls, [self.front + turn, elevation], FIELD, aspect)
    }

    /// The picture of a frame.
    pub(crate) fn picture(&self, frame: usize, eye: &Eye, [width, height]: [usize; 2], layer: Layer) -> Picture {
        let marks = if layer == Layer::Touch { self.marks(frame) } else { Vec::new() };
        let placed = self.placed(frame, &marks);
        let camera = eye.pinhole(width * RAYS, height * RAYS);
        let depths = depths(&placed, &camera);
        let light = light(eye);
        let shadows = Shadows { depths: self::depths(&placed, &light), light };
        let mut colors = vec![BACKGROUND; camera.width * camera.height];
        for row in 0..camera.height {
            for column in 0..camera.width {
                if let Some((index, depth)) = depths.at(row, column) {
                    let at = row * camera.width + camera.width - 1 - column;
                    let point = point(&camera, row, column, depth);
                    colors[at] = shadows.shade(&placed, index, &point, eye);
                }
            }
        }
        self.draw_goal(&mut colors, &camera, &depths);
        average(&colors, [width, height], RAYS)
    }

    fn placed<'s>(&'s self, frame: usize, marks: &'s [(Solid, Pose)]) -> Vec<Placed<'s>> {
        let bodies = self.rollout.bodies.iter().zip(&self.rollout.frames[frame]);
        let of_bodies = bodies.flat_map(|(body, pose)| body.solids.iter().map(move |solid| (solid, pose)));
        let all = of_bodies.chain(marks.iter().map(|(solid, pose)| (solid, pose)));
        let place = |(solid, pose): (&'s Solid, &Pose)| Placed {
            shape: &solid.shape,
            world_from_solid: pose * solid.carrier_from_solid,
            color: Vector3::from(solid.color).map(f64::from),
        };
        all.map(place).collect()
    }

    /// Balls at the contacts asked for so far, each on its part, and an arrow for each pad's force.
    fn marks(&self, frame: usize) -> Vec<(Solid, Pose)> {
        let rollout = self.rollout;
        let time = frame as f64 * rollout.frame_seconds;
        let mut marks = Vec::new();
        for contact in rollout.contacts.iter().filter(|contact| contact.time <= time + 1e-9) {
            let Some(now_from_then) = self.carried(contact, frame) else { continue };
            for (finger, color) in contact.fingers.iter().zip(FINGERS) {
                let at = now_from_then * Point3::from(*finger);
                let ball = Shape::Sphere { radius: CONTACT_RADIUS };
                marks.push((
                    Solid { shape: ball, carrier_from_solid: Pose::identity(), color },
                    Pose::translation(at.x, at.y, at.z),
                ));
            }
        }
        let pads = rollout.forces.get(frame).into_iter().flatten().flatten();
        for pad in pads {
            let force = Vector3::from(pad.force);
            let size = force.norm();
            if size > 0.3 {
                let turn = UnitQuaternion::rotation_between(&Vector3::z(), &force)
                    .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI));
                // The tip is where the pad presses.
                let half = (METRES_PER_NEWTON * size).min(0.3) / 2.0;
                let from = Pose::from_parts((Vector3::from(pad.point) - force / size * (2.0 * half + 0.008)).into(), turn);
                let stick = |radius: f64, half_length: f64, middle: f64| Solid {
                    shape: Shape::Capsule { radius, half_length },
                    carrier_from_solid: Pose::translation(0.0, 0.0, middle),
                    color: FORCE,
                };
                marks.extend([(stick(0.0018, half, half), from), (stick(0.0045, 0.004, 2.0 * half), from)]);
            }
        }
        marks
    }

    /// The motion of a contact's part since it was asked for.
    fn carried(&self, contact: &RolloutContact, frame: usize) -> Option<Pose> {
        let rollout = self.rollout;
        let body = rollout.bodies.iter().position(|body| body.label == PointLabel::Part(contact.part))?;
        let then = ((contact.time / rollout.frame_seconds).round() as usize).min(rollout.frames.len().checked_sub(1)?);
        Some(rollout.frames[frame][body] * rollout.frames[then][body].inverse())
    }

    /// Dots of the goal's cloud: clear in front of everything, faint behind.
    fn draw_goal(&self, colors: &mut [Vector3<f64>], camera: &Pinhole, depths: &DepthPicture) {
        let scale = camera.height as f64 / (2.0 * camera.half_tangent);
        let mut strength = vec![0.0_f64; colors.len()];
        for goal in &self.goal_points {
            let seen = camera.world_from_camera.inverse_transform_point(goal);
            if seen.z <= 0.05 {
                continue;
            }
            let column = (camera.width as f64 / 2.0) + seen.x / seen.z * scale - 0.5;
            let row = (camera.height as f64 / 2.0) - seen.y / seen.z * scale - 0.5;
            let radius = (DOT / seen.z * scale).max(0.7);
            let rows = clamped(row, radius, camera.height);
            for (y, x) in rows.flat_map(|y| clamped(column, radius, camera.width).map(move |x| (y, x))) {
                if (y as f64 - row).powi(2) + (x as f64 - column).powi(2) > radius * radius {
                    continue;
                }
                let hidden = depths.at(y, x).is_some_and(|(_, depth)| depth < seen.z - 0.004);
                let at = y * camera.width + camera.width - 1 - x;
                strength[at] = strength[at].max(if hidden { 0.16 } else { 0.62 });
            }
        }
        for (color, strength) in colors.iter_mut().zip(strength) {
            *color = color.lerp(&GOAL, strength);
        }
    }
}

/// The whole pixels within `radius` of `middle` that a line of `count` has.
fn clamped(middle: f64, radius: f64, count: usize) -> std::ops::Range<usize> {
    let bound = |x: f64| x.clamp(0.0, count as f64) as usize;
    bound((middle - radius).ceil())..bound((middle + radius).floor() + 1.0)
}

fn point(camera: &Pinhole, row: usize, column: usize, depth: f64) -> Point3<f64> {
    camera.world_from_camera * Point3::new(camera.x(column) * depth, camera.y(row) * depth, depth)
}

fn depths(placed: &[Placed<'_>], camera: &Pinhole) -> DepthPicture {
    let whole = Window { rows: 0..camera.height, columns: 0..camera.width };
    let mut depths = DepthPicture::new(camera);
    depths.add_rectangle(camera, &whole, TABLE_NUMBER, &[1.5, 1.5], &Pose::identity());
    for (index, solid) in placed.iter().enumerate() {
        depths.add_solid(camera, &whole, index as u32, solid.shape, &solid.world_from_solid);
    }
    depths
}

/// The light as a camera that sees what the eye sees.
fn light(eye: &Eye) -> Pinhole {
    let [right, _, back] = eye.axes();
    let level = Vector3::new(back.x, back.y, 0.0).try_normalize(1e-9).unwrap_or_else(|| Vector3::z().cross(&right));
    let to_light = right * TO_LIGHT[0] + Vector3::z() * TO_LIGHT[1] + level * TO_LIGHT[2];
    let reach = eye.distance * (eye.field / 2.0).tan();
    let (azimuth, elevation) = (to_light.y.atan2(to_light.x), (to_light.z / to_light.norm()).asin());
    let distance = 6.0 * reach;
    let field = 2.0 * (2.2 * reach / distance).atan();
    Eye { target: eye.target, distance, azimuth, elevation, field }.pinhole(LIGHT_PIXELS, LIGHT_PIXELS)
}

struct Shadows {
    light: Pinhole,
    depths: DepthPicture,
}

impl Shadows {
    fn lit(&self, point: &Point3<f64>) -> bool {
        let seen = self.light.world_from_camera.inverse_transform_point(point);
        let pixel = |x: f64, count: usize| (count as f64 * (x / self.light.half_tangent + 1.0) / 2.0) as usize;
        let inside = seen.z > 0.0
            && (seen.x / seen.z).abs() < self.light.half_tangent
            && (seen.y / seen.z).abs() < self.light.half_tangent;
        if !inside {
            return true;
        }
        let (row, column) = (pixel(-seen.y / seen.z, self.light.height), pixel(seen.x / seen.z, self.light.width));
        let (row, column) = (row.min(self.light.height - 1), column.min(self.light.width - 1));
        self.depths.at(row, column).is_none_or(|(_, depth)| seen.z < depth + BIAS)
    }

    fn shade(&self, placed: &[Placed<'_>], index: u32, point: &Point3<f64>, eye: &Eye) -> Vector3<f64> {
        let to_light = (self.light.world_from_camera.translation.vector - point.coords).normalize();
        let direct = if self.lit(point) { 1.0 } else { SHADED };
        let Some(solid) = placed.get(index as usize) else {
            // The table fades into the page away from what is looked at.
            let away = (point - eye.target).xy().norm() / (eye.distance * (eye.field / 2.0).tan());
            let light = AMBIENT + (1.0 - AMBIENT) * direct;
            return (TABLE * light).lerp(&BACKGROUND, ((away - 1.0) / 0.9).clamp(0.0, 1.0));
        };
        let local = solid.world_from_solid.inverse_transform_point(point);
        let normal = solid.world_from_solid.rotation * normal(solid.shape, &local.coords);
        solid.color * (AMBIENT + (1.0 - AMBIENT) * direct * normal.dot(&to_light).max(0.0) + 0.08 * normal.z.max(0.0))
    }
}

/// Means over the `rays` squared of each pixel.
pub(super) fn average(colors: &[Vector3<f64>], [width, height]: [usize; 2], rays: usize) -> Picture {
    let mut pixels = Vec::with_capacity(width * height);
    for row in 0..height {
        for column in 0..width {
            let place = |ray: usize| (row * rays + ray / rays) * width * rays + column * rays + ray % rays;
            let mean = (0..rays * rays).map(|ray| colors[place(ray)]).sum::<Vector3<f64>>() / (rays * rays) as f64;
            pixels.push(mean.map(|light| (255.0 * light.clamp(0.0, 1.0)).round() as u8).into());
        }
    }
    Picture { width, height, pixels }
}

/// Points on these solids' outer surface, one a cell: what cameras all around see.
fn surface(solids: &[(&Solid, Pose)]) -> Vec<Point3<f64>> {
    let reach = |(solid, pose): &(&Solid, Pose)| {
        let extent = [Vector3::x(), Vector3::y(), Vector3::z()]
            .map(|axis| solid.shape.extent_along(&axis).max(solid.shape.extent_along(&-axis)));
        (Point3::from(pose.translation.vector), Vector3::from(extent).norm())
    };
    let balls: Vec<(Point3<f64>, f64)> = solids.iter().map(reach).collect();
    if balls.is_empty() {
        return Vec::new();
    }
    let (mut cells, mut points) = (BTreeSet::new(), Vec::new());
    for (turn, elevation) in [0.3, 1.9, 3.4, 5.0].into_iter().flat_map(|turn| [(turn, 0.7), (turn, -0.7)]) {
        let camera = fit(&balls, [turn, elevation], FIELD, 1.0).pinhole(160, 160);
        let whole = Window { rows: 0..camera.height, columns: 0..camera.width };
        let mut depths = DepthPicture::new(&camera);
        for (solid, pose) in solids {
            depths.add_solid(&camera, &whole, 0, &solid.shape, pose);
        }
        for (row, column) in (0..camera.height).flat_map(|row| (0..camera.width).map(move |column| (row, column))) {
            if let Some((_, depth)) = depths.at(row, column) {
                let point = point(&camera, row, column, depth);
                if cells.insert([point.x, point.y, point.z].map(|x| (x / CELL).floor() as i64)) {
                    points.push(point);
                }
            }
        }
    }
    points
}

/// The ways of the bodies that have room, each with its own (m), and the goal.
fn balls(rollout: &Rollout, goal: &[Point3<f64>], room: &dyn Fn(PointLabel) -> Option<f64>) -> Vec<(Point3<f64>, f64)> {
    let mut balls: Vec<(Point3<f64>, f64)> = goal.iter().step_by(20).map(|point| (*point, 0.02)).collect();
    let frames = rollout.frames.iter().step_by((rollout.frames.len() / 24).max(1)).chain(rollout.frames.last());
    for (body, pose) in frames.flat_map(|frame| rollout.bodies.iter().zip(frame)) {
        balls.extend(room(body.label).map(|room| (pose.translation.vector.into(), room)));
    }
    // A motion of nothing is still a picture.
    if balls.is_empty() { vec![(Point3::origin(), 0.5)] } else { balls }
}

/// The horizontal direction from which the arms stand side by side.
fn front(rollout: &Rollout, balls: &[(Point3<f64>, f64)]) -> f64 {
    let Some(frame) = rollout.frames.first() else { return -FRAC_PI_2 };
    let mut seen = BTreeSet::new();
    let bases: Vec<Vector3<f64>> = rollout
        .bodies
        .iter()
        .zip(frame)
        .filter(|(body, _)| matches!(body.label, PointLabel::Arm(arm) if seen.insert(arm)))
        .map(|(_, pose)| pose.translation.vector)
        .collect();
    let mut widest = (0.05, -FRAC_PI_2);
    for (a, b) in bases.iter().flat_map(|a| bases.iter().map(move |b| (a, b))) {
        let gap = (b - a).xy();
        if gap.norm() > widest.0 + 1e-9 {
            widest = (gap.norm(), gap.y.atan2(gap.x) - FRAC_PI_2);
        }
    }
    // The work stands between the reader and the arms, not behind them.
    let middle = balls.iter().map(|(point, _)| point.coords).sum::<Vector3<f64>>() / balls.len() as f64;
    let towards = Vector3::new(widest.1.cos(), widest.1.sin(), 0.0);
    let behind: f64 = bases.iter().map(|base| (middle - base).dot(&towards)).sum();
    if behind < -0.2 * bases.len() as f64 { widest.1 + PI } else { widest.1 }
}
