//! Figure 4: the second grasp's contact maps before and after the first gripper has lifted the object, and what changes.

use crate::contact_maps::latent_maps;
use crate::evaluation::Evaluation;
use crate::failure::Failure;
use crate::learned_contacts::LearnedContacts;
use crate::picture::{Cloud, eye_of, sheet};
use crate::report::LatentMap;
use crate::results::{Method, aligned, wilson95};
use crate::scoring::{Estimate, mean_of};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::FRAC_1_SQRT_2;
use vmao_core::geometry::Pose;
use vmao_core::observation::{Observation, PointLabel};
use vmao_core::order::GraspOrder;
use vmao_core::rays::{normal, span};
use vmao_core::record::GraspRecord;
use vmao_core::shape::Solid;
use vmao_sim::Recording;

/// The grasp that is looked at, from zero.
const GRASP: usize = 1;
/// Codes shown, as in the supplement.
const SHOWN: usize = 5;
const TILE: [usize; 2] = [200, 150];
/// From where clouds are seen (rad).
const DIRECTION: [f64; 2] = [-1.05, 0.62];
/// Trials tried for each scene that is wanted: some fail before the second grasp.
const MOST_TRIALS_FOR_A_SCENE: u64 = 3;
/// Draws of the scenes for intervals.
const RESAMPLES: usize = 2000;

/// The scene before the second grasp, once as it lies on the table and once lifted.
#[derive(Debug)]
pub(crate) struct LiftedScene {
    pub(crate) index: u64,
    states: [State; 2],
}

/// What the second network sees and says, and how the hand came.
#[derive(Debug)]
struct State {
    seen: Observation,
    maps: Vec<LatentMap>,
    measures: [Option<f64>; MEASURES.len()],
}

/// What is measured of each state: its name, and in words.
const MEASURES: [(&str, &str); 7] = [
    ("mass-up", "map mass on upper surfaces"),
    ("mass-side", "map mass on side surfaces"),
    ("mass-down", "map mass on lower surfaces"),
    ("steep-axis", "codes whose closing axis is steeper than 45°"),
    ("axis-height", "height of the closing axis' direction, 0 level, 1 upright"),
    ("from-the-side", "executed grasps from more than 45° off the vertical"),
    ("approach-angle", "angle of executed approaches to the vertical, degrees"),
];

/// The measure that is a yes or a no of each scene.
const COUNTED: &str = "from-the-side";

/// A measure before and after lifting, with 95 % intervals over scenes.
#[derive(Debug, Serialize)]
pub(crate) struct Change {
    name: &'static str,
    measure: &'static str,
    before: Option<Estimate>,
    after: Option<Estimate>,
    /// After less before, in the scenes that have both.
    difference: Option<Estimate>,
}

/// The first `count` trials of V-MAO that come to the second grasp in sequential order, each with `codes` maps.
pub(crate) fn lifted_scenes(
    evaluation: &Evaluation<'_>,
    (count, codes): (u64, u64),
    seed: u64,
    looked: &(dyn Fn() + Sync),
) -> Result<Vec<LiftedScene>, Failure> {
    let Some(model) = evaluation.model(Method::Vmao) else { return Ok(Vec::new()) };
    let mut scenes = Vec::new();
    let mut next = 0;
    while (scenes.len() as u64) < count && next < count * MOST_TRIALS_FOR_A_SCENE {
        let wanted = count - scenes.len() as u64;
        let found = (next..next + wanted).into_par_iter().map(|index| {
            let scene = lifted_scene(evaluation, model, index, codes, seed)?;
            looked();
            Ok(scene)
        });
        let found: Vec<Option<LiftedScene>> = found.collect::<Result<_, Failure>>()?;
        scenes.extend(found.into_iter().flatten());
        next += wanted;
    }
    Ok(scenes)
}

fn lifted_scene(
    evaluation: &Evaluation<'_>,
    model: &LearnedContacts,
    index: u64,
    codes: u64,
    seed: u64,
) -> Result<Option<LiftedScene>, Failure> {
    let after = evaluation.trial_by(model, GraspOrder::Sequential, index, Recording::Off).record;
    let Some(second) = after.grasps.get(GRASP) else { return Ok(None) };
    let part = usize::from(second.contact.part.0);
    // Both orders meet the same start and goal; in parallel order the second hand comes while the object lies.
    let before = evaluation.trial_by(model, GraspOrder::Parallel, index, Recording::Off).record;
    let scene = evaluation.scene(index);
    let (solids, span) = (&scene.object.parts[part].solids, scene.robots[usize::from(second.arm.0)].gripper.span());
    let state = |seen: &Observation, world_from_part: &Pose, grasp: Option<&GraspRecord>| {
        let maps = latent_maps(model, part, seen, span, seed, codes)?;
        let surfaces = Surfaces::new(seen, part, solids, world_from_part);
        let measures = measures(seen, &maps, &surfaces, grasp);
        Ok::<State, Failure>(State { seen: seen.clone(), maps, measures })
    };
    let lying = state(&after.grasps[0].observation, &after.start.world_from_parts[part], before.grasps.get(GRASP))?;
    let lifted = state(&second.observation, &second.world_from_part, Some(second))?;
    Ok(Some(LiftedScene { index, states: [lying, lifted] }))
}

/// Which way the surface of the part faces at each point of a cloud; none elsewhere.
struct Surfaces {
    up: Vec<Option<f64>>,
}

impl Surfaces {
    fn new(seen: &Observation, part: usize, solids: &[Solid], world_from_part: &Pose) -> Self {
        let own = PointLabel::Part(part as u16);
        let up = |(point, label): (&[f32; 3], &PointLabel)| {
            if *label != own {
                return None;
            }
            let point = world_from_part.inverse_transform_point(&Point3::from(point.map(f64::from)));
            let facing = |solid: &Solid| {
                let local = solid.carrier_from_solid.inverse_transform_point(&point);
                let outward = normal(&solid.shape, &local.coords);
                // On its surface the line outward leaves the solid at once.
                let [_, leave] = span(&solid.shape, &local.coords, &outward)?;
                Some((leave.abs(), (world_from_part.rotation * (solid.carrier_from_solid.rotation * outward)).z))
            };
            solids.iter().filter_map(facing).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, up)| up)
        };
        Self { up: seen.points.iter().zip(&seen.labels).map(up).collect() }
    }

    /// Shares of a map's mass on the part that lie on surfaces which face up, sideways, down; none without mass.
    fn shares(&self, map: &LatentMap) -> Option<[f64; 3]> {
        let mut mass = [0.0; 3];
        for (up, (first, second)) in self.up.iter().zip(map.finger1.iter().zip(&map.finger2)) {
            let Some(up) = up else { continue };
            let side = if *up > FRAC_1_SQRT_2 {
                0
            } else if *up < -FRAC_1_SQRT_2 {
                2
            } else {
                1
            };
            mass[side] += f64::from(first + second);
        }
        let all: f64 = mass.iter().sum();
        (all > 0.0).then(|| mass.map(|mass| mass / all))
    }
}

fn measures(
    seen: &Observation,
    maps: &[LatentMap],
    surfaces: &Surfaces,
    grasp: Option<&GraspRecord>,
) -> [Option<f64>; MEASURES.len()] {
    let mean = |values: Vec<f64>| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
    let mass = |side: usize| mean(maps.iter().filter_map(|map| surfaces.shares(map)).map(|shares| shares[side]).collect());
    let height = |map: &LatentMap| {
        let [first, second] = map.peaks.map(|point| Vector3::from(seen.points[point]).map(f64::from));
        (second - first).try_normalize(1e-9).map(|axis| axis.z.abs())
    };
    let heights: Vec<f64> = maps.iter().filter_map(height).collect();
    let steep = heights.iter().map(|height| f64::from(u8::from(*height > FRAC_1_SQRT_2))).collect();
    // The tool's z is the approach; straight down is zero.
    let approach =
        |grasp: &GraspRecord| grasp.world_from_gripper.map(|tool| (-(tool.rotation * Vector3::z()).z).clamp(-1.0, 1.0).acos());
    let angle = grasp.and_then(approach).map(f64::to_degrees);
    let from_the_side = angle.map(|angle| f64::from(u8::from(angle > 45.0)));
    [mass(0), mass(1), mass(2), mean(steep), mean(heights), from_the_side, angle]
}

/// Every measure over these scenes.
pub(crate) fn changes(scenes: &[LiftedScene], seed: u64) -> Vec<Change> {
    let change = |(measure, &(name, words)): (usize, &(&'static str, &'static str))| {
        let of = |state: usize| scenes.iter().map(move |scene| scene.states[state].measures[measure]);
        let estimate = |values: Vec<Option<f64>>| {
            let found = mean_of(&values, RESAMPLES, seed)?;
            Some(if name == COUNTED { Estimate { interval95: counted(&values), ..found } } else { found })
        };
        let both: Vec<Option<f64>> = of(0).zip(of(1)).map(|(before, after)| Some(after? - before?)).collect();
        let difference = mean_of(&both, RESAMPLES, seed);
        let (before, after) = (estimate(of(0).collect()), estimate(of(1).collect()));
        Change { name, measure: words, before, after, difference }
    };
    MEASURES.iter().enumerate().map(change).collect()
}

/// Wilson's interval where every scene is a yes, 1, or a no: drawing scenes again says nothing of what never happened.
fn counted(values: &[Option<f64>]) -> [f64; 2] {
    let known = || values.iter().flatten();
    wilson95(known().filter(|value| **value > 0.5).count() as u64, known().count() as u64)
}

/// The changes for people.
pub(crate) fn table(changes: &[Change]) -> String {
    let words = |estimate: &Option<Estimate>| match estimate {
        None => "–".to_owned(),
        Some(Estimate { value, interval95: [low, high], .. }) => format!("{value:.3} ({low:.3} to {high:.3})"),
    };
    let scenes = |change: &Change| change.difference.as_ref().map_or(0, |estimate| estimate.scenes).to_string();
    let mut rows = vec![["measure", "lying", "lifted", "change", "scenes"].map(str::to_owned).to_vec()];
    let row = |change: &Change| {
        vec![change.measure.to_owned(), words(&change.before), words(&change.after), words(&change.difference), scenes(change)]
    };
    rows.extend(changes.iter().map(row));
    aligned(&rows, 1)
}

/// Two rows for each scene, lying and lifted: the cloud, then the maps of the first codes.
pub(crate) fn maps_picture(scenes: &[LiftedScene]) -> vmao_sim::Picture {
    let row = |state: &State| {
        let eye = eye_of(&[&state.seen], DIRECTION, TILE[0] as f64 / TILE[1] as f64);
        let cloud = Cloud { seen: &state.seen, eye, size: TILE };
        let maps = state.maps.iter().take(SHOWN).map(|map| cloud.picture(Some([&map.finger1, &map.finger2])));
        std::iter::once(cloud.picture(None)).chain(maps).collect()
    };
    sheet(&scenes.iter().flat_map(|scene| scene.states.iter().map(row)).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use vmao_core::shape::Shape;

    /// A block of 4 × 2 × 1 cm, a point on each of three sides.
    fn block() -> (Observation, Vec<Solid>) {
        let shape = Shape::Box { half_extents: [0.02, 0.01, 0.005] };
        let solids = vec![Solid { shape, carrier_from_solid: Pose::identity(), color: [0.5; 3] }];
        let points = vec![[0.0, 0.003, 0.005], [0.0, 0.01, 0.001], [0.0, 0.0, -0.005], [0.3, 0.0, 0.0]];
        let part = PointLabel::Part(0);
        (Observation { colors: vec![[0.5; 3]; 4], points, labels: vec![part, part, part, PointLabel::Table] }, solids)
    }

    fn map(finger1: [f32; 4], finger2: [f32; 4]) -> LatentMap {
        let peak = |channel: [f32; 4]| (0..4).max_by(|&a, &b| channel[a].total_cmp(&channel[b])).unwrap();
        let peaks = [peak(finger1), peak(finger2)];
        LatentMap { finger1: finger1.to_vec(), finger2: finger2.to_vec(), peaks, ..LatentMap::default() }
    }

    #[test]
    fn mass_is_counted_by_the_way_the_surface_faces_in_the_world() {
        let (seen, solids) = block();
        let map = map([0.5, 0.25, 0.0, 0.25], [0.1, 0.2, 0.3, 0.4]);
        let shares = Surfaces::new(&seen, 0, &solids, &Pose::identity()).shares(&map).unwrap();
        let expected = [0.6 / 1.35, 0.45 / 1.35, 0.3 / 1.35];
        assert!(shares.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{shares:?}");
        // Upside down, what faced up faces down.
        let over = Pose::rotation(Vector3::x() * std::f64::consts::PI);
        let mut turned = seen.clone();
        turned.points =
            seen.points.iter().map(|point| (over * Point3::from(*point).map(f64::from)).map(|x| x as f32).into()).collect();
        let turned = Surfaces::new(&turned, 0, &solids, &over).shares(&map).unwrap();
        assert!((turned[2] - shares[0]).abs() < 1e-6 && (turned[1] - shares[1]).abs() < 1e-6);
        assert!(Surfaces::new(&seen, 1, &solids, &Pose::identity()).shares(&map).is_none(), "no mass on a part that is not seen");
    }

    #[test]
    fn what_never_happened_has_wilsons_interval() {
        assert_eq!(counted(&[Some(0.0), None, Some(0.0)]), wilson95(0, 2));
        assert_eq!(counted(&[Some(0.0), Some(1.0), None]), wilson95(1, 2));
        assert!(MEASURES.iter().any(|(name, _)| *name == COUNTED));
    }

    #[test]
    fn a_closing_axis_from_top_to_bottom_is_steep_and_a_hand_from_the_side_comes_from_the_side() {
        let (seen, solids) = block();
        let surfaces = Surfaces::new(&seen, 0, &solids, &Pose::identity());
        let upright = map([0.9, 0.1, 0.0, 0.0], [0.0, 0.1, 0.9, 0.0]);
        let level = map([0.0, 0.0, 0.9, 0.1], [0.0, 0.0, 0.1, 0.9]);
        let grasp = |tool: Pose| GraspRecord {
            arm: vmao_core::contact::ArmId(0),
            contact: vmao_core::contact::Contact { part: vmao_core::contact::PartId(0), fingers: [Point3::origin(); 2] },
            observation: Observation::default(),
            world_from_part: Pose::identity(),
            world_from_gripper: Some(tool),
        };
        let level_hand = grasp(Pose::rotation(Vector3::y() * std::f64::consts::FRAC_PI_2));
        let found = measures(&seen, &[upright, level], &surfaces, Some(&level_hand));
        assert_eq!(found[3], Some(0.5));
        assert_eq!(found[5], Some(1.0));
        assert!((found[6].unwrap() - 90.0).abs() < 1e-9);
        let above = grasp(Pose::rotation(Vector3::x() * std::f64::consts::PI));
        assert_eq!(measures(&seen, &[], &surfaces, Some(&above))[5..], [Some(0.0), Some(0.0)]);
        assert_eq!(measures(&seen, &[], &surfaces, None), [None; 7]);
    }
}
