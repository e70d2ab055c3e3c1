//! Where the arms stand: around a table whose centre is the world's origin, all facing it.

use crate::error::Error;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use vmao_core::geometry::Pose;
use vmao_core::robots::RobotModel;

/// Most arms of a scene.
pub const MAX_ARMS: usize = 6;

/// How the arms stand around the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// Alternately on both long sides, facing each other.
    Opposed,
    /// All on one long side, in parallel.
    SideBySide,
    /// Of each three arms two in parallel on one long side and one opposite (appendix D).
    TwoParallelOneOpposite,
    /// Evenly on a circle around the centre.
    Ring,
    /// Where `scene.bases` says.
    Explicit,
}

/// Where an arm's base stands, for [`Layout::Explicit`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BasePlacement {
    /// World position (m).
    pub position: [f64; 3],
    /// Turn about the vertical (degrees); at 0 the arm faces +x.
    pub yaw_deg: f64,
}

/// Distances of a layout.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spacing {
    /// From the table's centre line, or from its centre in a ring (m).
    pub(crate) distance: f64,
    /// Between neighbours on one side (m).
    pub(crate) between: f64,
}

/// `world_from_base` of each arm.
///
/// An arm whose hand at home lies aside of its base, as the Sawyer's does by 16 cm, is shifted back by as much, so that
/// hands face the table as the layout says. Fails if there are no arms, more than [`MAX_ARMS`], or bases of another number.
pub(crate) fn base_poses(
    layout: Layout,
    spacing: Spacing,
    bases: &[BasePlacement],
    robots: &[RobotModel],
) -> Result<Vec<Pose>, Error> {
    let count = robots.len();
    if count == 0 || count > MAX_ARMS {
        return Err(Error::Placement { cause: format!("{count} arms, expected 1 to {MAX_ARMS}") });
    }
    if layout == Layout::Explicit {
        if bases.len() != count {
            let cause = format!("{} bases for {count} arms; an explicit layout needs one for each", bases.len());
            return Err(Error::Placement { cause });
        }
        let place = |base: &BasePlacement| Pose::new(Vector3::from(base.position), Vector3::z() * base.yaw_deg.to_radians());
        return Ok(bases.iter().map(place).collect());
    }
    if !bases.is_empty() {
        let cause = format!("{} bases given, expected none: only the layout `explicit` uses them", bases.len());
        return Err(Error::Placement { cause });
    }
    let stands = match layout {
        Layout::Ring => ring(count, spacing.distance),
        Layout::SideBySide => rows(count, spacing, |_| 0),
        Layout::TwoParallelOneOpposite => rows(count, spacing, |arm| usize::from(arm % 3 == 2)),
        Layout::Opposed | Layout::Explicit => rows(count, spacing, |arm| arm % 2),
    };
    let centred = |(stand, robot): (Pose, &RobotModel)| {
        let aside = robot.tool_chain().tool_pose(&robot.home).translation.y;
        stand * Pose::translation(0.0, -aside, 0.0)
    };
    Ok(stands.into_iter().zip(robots).map(centred).collect())
}

/// Arms in a row on each side; side 0 at −x faces +x, side 1 at +x faces −x.
fn rows(count: usize, spacing: Spacing, side_of: impl Fn(usize) -> usize) -> Vec<Pose> {
    let row = |side: usize| (0..count).filter(|&arm| side_of(arm) == side).collect::<Vec<usize>>();
    let sides = [row(0), row(1)];
    let stand = |arm: usize| {
        let side = side_of(arm);
        let place = sides[side].iter().position(|&other| other == arm).unwrap_or(0);
        let across = (place as f64 - (sides[side].len() as f64 - 1.0) / 2.0) * spacing.between;
        let (x, turn) = if side == 0 { (-spacing.distance, 0.0) } else { (spacing.distance, PI) };
        Pose::new(Vector3::new(x, across, 0.0), Vector3::z() * turn)
    };
    (0..count).map(stand).collect()
}

fn ring(count: usize, radius: f64) -> Vec<Pose> {
    let stand = |arm: usize| {
        let angle = PI + TAU * arm as f64 / count as f64;
        Pose::new(Vector3::new(angle.cos(), angle.sin(), 0.0) * radius, Vector3::z() * (angle + PI))
    };
    (0..count).map(stand).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use vmao_core::robots::{panda, sawyer};

    const SPACING: Spacing = Spacing { distance: 0.6, between: 0.7 };

    fn stands(layout: Layout, robots: &[RobotModel]) -> Vec<[f64; 3]> {
        let poses = base_poses(layout, SPACING, &[], robots).unwrap();
        poses.iter().map(|pose| [pose.translation.x, pose.translation.y, pose.rotation.euler_angles().2]).collect()
    }

    #[track_caller]
    fn check(found: &[[f64; 3]], expected: &[[f64; 3]]) {
        let turn = |a: f64, b: f64| ((a - b) / TAU - ((a - b) / TAU).round()).abs();
        let same =
            |a: &[f64; 3], b: &[f64; 3]| (a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9 && turn(a[2], b[2]) < 1e-9;
        assert!(found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| same(a, b)), "{found:?} {expected:?}");
    }

    #[test]
    fn rows_stand_where_their_names_say() {
        let three = [panda(), panda(), panda()];
        check(&stands(Layout::Opposed, &three), &[[-0.6, -0.35, 0.0], [0.6, 0.0, PI], [-0.6, 0.35, 0.0]]);
        check(&stands(Layout::SideBySide, &three), &[[-0.6, -0.7, 0.0], [-0.6, 0.0, 0.0], [-0.6, 0.7, 0.0]]);
        check(&stands(Layout::TwoParallelOneOpposite, &three), &[[-0.6, -0.35, 0.0], [-0.6, 0.35, 0.0], [0.6, 0.0, PI]]);
        check(&stands(Layout::Opposed, &three[..1]), &[[-0.6, 0.0, 0.0]]);
    }

    #[test]
    fn a_ring_is_even_and_faces_its_centre() {
        for count in 1..=MAX_ARMS {
            let robots = vec![panda(); count];
            let poses = base_poses(Layout::Ring, SPACING, &[], &robots).unwrap();
            for (arm, pose) in poses.iter().enumerate() {
                assert!((pose.translation.vector.norm() - 0.6).abs() < 1e-9);
                let ahead = pose * nalgebra::Point3::new(0.6, 0.0, 0.0);
                assert!(ahead.coords.norm() < 1e-9, "arm {arm} of {count} looks past the centre: {ahead}");
                let gap = (pose.translation.vector - poses[(arm + 1) % count].translation.vector).norm();
                assert!((gap - 1.2 * (PI / count as f64).sin().abs()).abs() < 1e-9, "{count} arms: {gap}");
            }
        }
    }

    #[test]
    fn hands_at_home_face_the_centre_line_whatever_the_robot() {
        for layout in [Layout::Opposed, Layout::Ring, Layout::SideBySide] {
            let mixed = [panda(), sawyer(2)];
            let aligned = base_poses(layout, SPACING, &[], &[panda(), panda()]).unwrap();
            for (arm, (pose, robot)) in base_poses(layout, SPACING, &[], &mixed).unwrap().iter().zip(&mixed).enumerate() {
                let hand = pose * robot.tool_chain().tool_pose(&robot.home);
                let aside = aligned[arm].inverse_transform_vector(&(hand.translation.vector - aligned[arm].translation.vector));
                assert!(aside.y.abs() < 1e-9, "{layout:?}, arm {arm}: {aside}");
            }
        }
    }

    #[test]
    fn explicit_bases_stand_where_they_are_put() {
        let base = BasePlacement { position: [0.1, -0.2, 0.05], yaw_deg: 90.0 };
        let poses = base_poses(Layout::Explicit, SPACING, &[base], &[sawyer(2)]).unwrap();
        assert!((poses[0] * nalgebra::Point3::new(1.0, 0.0, 0.0) - nalgebra::Point3::new(0.1, 0.8, 0.05)).norm() < 1e-9);
    }

    #[test]
    fn wrong_numbers_are_refused_in_words() {
        let base = BasePlacement { position: [0.0; 3], yaw_deg: 0.0 };
        let refused = |layout, bases: &[BasePlacement], count: usize| {
            base_poses(layout, SPACING, bases, &vec![panda(); count]).unwrap_err().to_string()
        };
        assert!(refused(Layout::Ring, &[], 0).contains("0 arms, expected 1 to 6"));
        assert!(refused(Layout::Ring, &[], 7).contains("7 arms, expected 1 to 6"));
        assert!(refused(Layout::Explicit, &[base], 2).contains("1 bases for 2 arms"));
        assert!(refused(Layout::Opposed, &[base], 2).contains("only the layout `explicit`"));
    }
}
