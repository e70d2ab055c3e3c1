//! From two contact points to gripper poses: the closing axis is given, the approach about it is free.

use crate::geometry::Pose;
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

/// A way to bring the gripper to two contact points.
#[derive(Debug, Clone, PartialEq)]
pub struct GripperPose {
    /// World pose of the tool frame at the grasp: y through the contacts, z the approach.
    pub world_from_tool: Pose,
    /// Angle of the approach about the closing axis, from straight down (rad).
    pub approach_angle: f64,
}

impl GripperPose {
    /// The tool pose a `distance` (m) back along the approach.
    pub fn backed_off(&self, distance: f64) -> Pose {
        self.world_from_tool * Translation3::new(0.0, 0.0, -distance)
    }
}

/// All gripper poses on these finger points: `count` approaches evenly about the closing axis, each with both fingerings.
///
/// The tool's origin is the middle of the points. A parallel gripper is symmetric, so finger 1 may lie at +y or at -y.
/// Straight down is the first approach, then alternating to both sides. Empty if the points coincide.
pub fn gripper_poses(fingers: &[Point3<f64>; 2], count: usize) -> Vec<GripperPose> {
    let Some(closing) = Unit::try_new(fingers[0] - fingers[1], 1e-6) else { return Vec::new() };
    let middle = nalgebra::center(&fingers[0], &fingers[1]);
    // Straight down, as far as the closing axis allows; along x if the axis itself is vertical.
    let down = -Vector3::z();
    let across = down - closing.into_inner() * closing.dot(&down);
    let across = Unit::try_new(across, 1e-3).unwrap_or_else(|| {
        let level = Vector3::x() - closing.into_inner() * closing.x;
        Unit::new_normalize(level)
    });
    let mut poses = Vec::with_capacity(2 * count);
    for index in 0..count {
        let side = if index % 2 == 0 { 1.0 } else { -1.0 };
        let angle = side * index.div_ceil(2) as f64 * std::f64::consts::TAU / count as f64;
        let approach = Rotation3::from_axis_angle(&closing, angle) * across.into_inner();
        for fingering in [1.0, -1.0] {
            let y = closing.into_inner() * fingering;
            let x = y.cross(&approach);
            let rotation = Rotation3::from_basis_unchecked(&[x, y, approach]);
            poses.push(GripperPose {
                world_from_tool: Pose::from_parts(
                    Translation3::from(middle.coords),
                    UnitQuaternion::from_rotation_matrix(&rotation),
                ),
                approach_angle: angle,
            });
        }
    }
    poses
}

/// The same contacts with the closing axis turned square to the bar they lie on and flat on its sides, about the bar's middle.
///
/// The bar's direction is the principal axis of the cloud `points` around the contacts' middle; flat is along an edge of
/// the rectangle that fits its cross-section best, and level if all ways are alike. Pads that close askew turn the part or
/// the hand until they lie flat; planning for the square grasp foresees it. `None` where the points nearby are not drawn out
/// like a bar, the contacts lie far beside it, or the axis would have to turn by more than `limit` (rad).
pub fn squared(fingers: &[Point3<f64>; 2], points: &[Point3<f64>], limit: f64) -> Option<[Point3<f64>; 2]> {
    let middle = nalgebra::center(&fingers[0], &fingers[1]);
    let near: Vec<Vector3<f64>> =
        points.iter().map(|point| point - middle).filter(|offset| offset.norm() < BAR_NEIGHBOURHOOD).collect();
    let bar = direction_of_bar(&near)?;
    let along = fingers[0] - fingers[1];
    let mut square = along - bar * bar.dot(&along);
    let across_bar = square.norm();
    // Two points on one side of the bar say where along it, not how wide it is.
    let reach = if across_bar < ONE_SIDE { WIDEST_BAR } else { across_bar / 2.0 + SLICE_MARGIN };
    let tilt = square.z.abs().atan2(square.xy().norm());
    // Level first, then square again within the level plane, unless the bar itself stands upright.
    if tilt < STEEP {
        let across = bar.cross(&Vector3::z());
        if across.norm() > 0.3 {
            square = across * across.dot(&along);
        }
    }
    let square = square.try_normalize(1e-6)?;
    let slice = |offset: &&Vector3<f64>| offset.dot(&bar).abs() < SLICE && (*offset - bar * offset.dot(&bar)).norm() < reach;
    let slice: Vec<Vector3<f64>> = near.iter().filter(slice).copied().collect();
    // Where too little is seen of the cross-section, the contacts alone say how wide it is.
    let half = along.dot(&square).abs() / 2.0;
    let (direction, [low, high]) = flat(&slice, &Unit::new_unchecked(bar), square).unwrap_or((square, [-half, half]));
    // Points far beside a bar are not on it.
    if across_bar > high - low + 2.0 * SLICE_MARGIN {
        return None;
    }
    // Either way round is the same grasp.
    if direction.dot(&along).abs() < along.norm() * limit.cos() {
        return None;
    }
    let at = |place: f64| middle + direction * place;
    Some([at(high), at(low)])
}

/// The principal axis of these offsets (m); none if they are few or not drawn out.
fn direction_of_bar(near: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    if near.len() < FEWEST_BAR_POINTS {
        return None;
    }
    let mean: Vector3<f64> = near.iter().sum::<Vector3<f64>>() / near.len() as f64;
    let covariance: Matrix3<f64> = near.iter().map(|offset| (offset - mean) * (offset - mean).transpose()).sum();
    let eigen = covariance.symmetric_eigen();
    let longest = eigen.eigenvalues.imax();
    let second = (0..3).filter(|&i| i != longest).map(|i| eigen.eigenvalues[i]).fold(0.0, f64::max);
    let drawn_out = eigen.eigenvalues[longest] >= BAR_ELONGATION * second;
    drawn_out.then(|| eigen.eigenvectors.column(longest).into_owned())
}

/// The direction about `bar` near `start` that is square to a side of the bar, and from where to where these offsets (m) reach in it.
///
/// Of all rectangles about the cross-section that are just large enough, the one on whose edges the points lie best. The narrowest
/// one, or the smallest, would be askew where two sides only are seen. None if they are few.
fn flat(slice: &[Vector3<f64>], bar: &Unit<Vector3<f64>>, start: Vector3<f64>) -> Option<(Vector3<f64>, [f64; 2])> {
    if slice.len() < FEWEST_BAR_POINTS {
        return None;
    }
    let most = (MOST_TURN / TURN_STEP).round() as i32;
    let turned = (-most..=most).map(|step| {
        let angle = f64::from(step) * TURN_STEP;
        let direction = Rotation3::from_axis_angle(bar, angle) * start;
        let sides = [direction, bar.cross(&direction)];
        let reach = sides.map(|side| {
            let places = slice.iter().map(|offset| offset.dot(&side));
            places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        });
        let from_edge = |offset: &Vector3<f64>| {
            let distances =
                sides.iter().zip(&reach).map(|(side, [low, high])| (offset.dot(side) - low).min(high - offset.dot(side)));
            distances.fold(f64::INFINITY, f64::min)
        };
        let misfit = slice.iter().map(from_edge).sum::<f64>() / slice.len() as f64;
        (misfit + TURN_COST * angle.abs(), direction, reach[0])
    });
    turned.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, direction, reach)| (direction, reach))
}

/// Cloud points within this distance of the contacts' middle show the bar's direction (m) ...
const BAR_NEIGHBOURHOOD: f64 = 0.035;
/// ... if there are at least so many ...
const FEWEST_BAR_POINTS: usize = 12;
/// ... and their longest variance is this many times the next.
const BAR_ELONGATION: f64 = 1.6;
/// Points this far along the bar (m), and so much farther across it than the contacts (m), show its cross-section.
const SLICE: f64 = 0.014;
const SLICE_MARGIN: f64 = 0.006;
/// Contacts nearer than this across the bar lie on one side of it (m); then this far around them shows the cross-section (m).
const ONE_SIDE: f64 = 0.008;
const WIDEST_BAR: f64 = 0.024;
/// A steeper closing axis holds the bar from above and below (rad).
const STEEP: f64 = 1.4;
/// Directions about the bar that are compared (rad), and what turning costs (m/rad): more than noise, less than an edge.
const MOST_TURN: f64 = 0.75;
const TURN_STEP: f64 = 0.03;
const TURN_COST: f64 = 0.001;

#[cfg(test)]
mod tests {
    use super::*;

    fn axes(pose: &GripperPose) -> [Vector3<f64>; 3] {
        [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| pose.world_from_tool.rotation * axis)
    }

    #[test]
    fn the_first_pose_of_a_level_grasp_looks_straight_down_with_its_fingers_on_the_points() {
        let fingers = [Point3::new(0.1, 0.23, 0.05), Point3::new(0.1, 0.2, 0.05)];
        let poses = gripper_poses(&fingers, 8);
        assert_eq!(poses.len(), 16);
        let [_, y, z] = axes(&poses[0]);
        assert!((z + Vector3::z()).norm() < 1e-12 && (y - Vector3::y()).norm() < 1e-12);
        for pose in &poses {
            for (finger, sign) in fingers.iter().zip([1.0, -1.0]) {
                let in_tool = pose.world_from_tool.inverse_transform_point(finger);
                assert!(in_tool.x.abs() < 1e-12 && in_tool.z.abs() < 1e-12 && (in_tool.y.abs() - 0.015).abs() < 1e-12, "{sign}");
            }
            let [x, y, z] = axes(pose);
            assert!((x.cross(&y) - z).norm() < 1e-12, "a right-handed frame");
        }
    }

    #[test]
    fn a_vertical_closing_axis_gives_level_approaches() {
        let poses = gripper_poses(&[Point3::new(0.0, 0.0, 0.12), Point3::new(0.0, 0.0, 0.1)], 5);
        assert_eq!(poses.len(), 10);
        for pose in &poses {
            assert!(axes(pose)[2].z.abs() < 1e-12);
        }
    }

    #[test]
    fn coinciding_points_give_no_pose() {
        assert!(gripper_poses(&[Point3::origin(), Point3::origin()], 8).is_empty());
    }

    #[test]
    fn askew_contacts_on_a_bar_are_squared_and_a_ball_is_left_alone() {
        let heading = 0.7_f64;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), heading);
        let mut bar = Vec::new();
        for step in -30..=30 {
            for side in [-0.008, 0.008] {
                for height in [0.002, 0.01, 0.018] {
                    bar.push(turn * Point3::new(f64::from(step) * 0.002, side, height));
                }
            }
        }
        let askew = [turn * Point3::new(0.005, 0.008, 0.013), turn * Point3::new(-0.005, -0.008, 0.007)];
        let square = squared(&askew, &bar, 0.9).unwrap();
        let axis = turn.inverse() * (square[0] - square[1]).normalize();
        assert!((axis - Vector3::y()).norm() < 0.02, "{axis:?}");
        let middle = nalgebra::center(&square[0], &square[1]);
        assert!((middle - nalgebra::center(&askew[0], &askew[1])).norm() < 1e-12);
        // Carried and tilted by 0.3 rad about itself, with one finger's point on top: flat on its sides, about its middle.
        let roll = turn * Rotation3::from_axis_angle(&Vector3::x_axis(), 0.3) * turn.inverse();
        let tilted: Vec<Point3<f64>> = bar.iter().map(|point| roll * point).collect();
        let one_on_top =
            [turn * Point3::new(0.0, 0.004, 0.018), turn * Point3::new(0.0, -0.008, 0.006)].map(|point| roll * point);
        let square = squared(&one_on_top, &tilted, 1.4).unwrap();
        let [first, second] = square.map(|point| turn.inverse() * (roll.inverse() * point));
        assert!((first.y - 0.008).abs() < 1e-3 && (second.y + 0.008).abs() < 1e-3, "{first} {second}");
        assert!((first.z - second.z).abs() < 0.6e-3, "{first} {second}");
        // Seen on top and on one side only: flat all the same, though the bar is narrower across the corner that is seen.
        let corner: Vec<Point3<f64>> = (-30..=30)
            .flat_map(|step| (0..=8).map(move |i| (f64::from(step) * 0.002, f64::from(i) * 0.002)))
            .flat_map(|(x, along)| [Point3::new(x, 0.008, along + 0.002), Point3::new(x, 0.008 - along, 0.018)])
            .map(|point| roll * (turn * point))
            .collect();
        let square = squared(&one_on_top, &corner, 1.4).unwrap();
        let [first, second] = square.map(|point| turn.inverse() * (roll.inverse() * point));
        assert!((first.y - 0.008).abs() < 1e-3 && (second.y + 0.008).abs() < 1e-3, "{first} {second}");
        assert!((first.z - second.z).abs() < 0.6e-3, "{first} {second}");
        // Where the contacts are nothing is seen of the same bar: square and level, as wide as the contacts.
        let end: Vec<Point3<f64>> = bar.iter().filter(|p| (turn.inverse() * *p).x.abs() > 0.014).copied().collect();
        let few = squared(&askew, &end, 1.4).unwrap().map(|point| turn.inverse() * point);
        assert!((few[0].y - few[1].y - 0.016).abs() < 1e-3 && (few[0].z - few[1].z).abs() < 1e-9, "{few:?}");
        let beside = [Point3::new(0.0, 0.1, 0.01), Point3::new(0.0, -0.1, 0.01)].map(|point| turn * point);
        assert_eq!(squared(&beside, &bar, 1.4), None, "points far beside the bar are not on it");
        // Both fingers' points on one side, one behind the other: across the bar where they are.
        let one_side = [Point3::new(0.01, 0.008, 0.01), Point3::new(-0.01, 0.007, 0.01)].map(|point| turn * point);
        let square = squared(&one_side, &bar, std::f64::consts::FRAC_PI_2).unwrap().map(|point| turn.inverse() * point);
        assert!((square[0].y - square[1].y).abs() > 0.0155 && square.iter().all(|p| p.x.abs() < 1e-3), "{square:?}");
        assert!((square[0].y + square[1].y).abs() < 1e-3, "about the bar's middle: {square:?}");
        let mut stream = crate::random::Stream::new(1, &[]);
        let ball: Vec<Point3<f64>> = (0..400)
            .filter_map(|_| Vector3::new(stream.normal(), stream.normal(), stream.normal()).try_normalize(1e-6))
            .map(|direction| Point3::from(direction * 0.012))
            .collect();
        assert_eq!(squared(&[Point3::new(0.0, 0.012, 0.0), Point3::new(0.0, -0.012, 0.0)], &ball, 0.9), None);
    }
}
