//! Where to touch: the one interface that exploration, V-MAO, Top-1 and demonstrations share.

use crate::contact::{ContactTuple, PartId};
use crate::geometry::Pose;
use crate::observation::{Observation, PointLabel};
use crate::random::Stream;
use nalgebra::Point3;

/// What a contact model is asked: the scene as it is before a grasp.
#[derive(Debug, Clone, Copy)]
pub struct ContactQuery<'a> {
    /// Which grasp of the trial this is, from zero.
    pub grasp: usize,
    /// The part to hold.
    pub part: PartId,
    /// The scene now, world frame.
    pub observation: &'a Observation,
    /// The least and the largest distance between two fingers' points that the gripper can hold (m).
    pub span: [f64; 2],
    /// Where the part is. Exploration knows it; learned models must not look.
    pub world_from_part: &'a Pose,
}

/// World points for finger 1 and finger 2 (m).
pub type FingerPoints = [Point3<f64>; 2];

/// Proposes where the two fingers of the next grasp shall touch.
pub trait ContactModel: Sync {
    /// What the trial shall try, best first; nothing if the model sees nowhere to touch.
    ///
    /// The trial takes the first proposal that a gripper can reach and carry. A model that is to be judged by one sample, as in
    /// the paper, makes one.
    fn propose(&self, query: &ContactQuery<'_>, stream: &mut Stream) -> Vec<FingerPoints>;
}

/// Algorithm 1's proposal: each point of a known tuple, moved to a random cloud point of the same part nearby.
#[derive(Debug, Clone)]
pub struct JitteredTuple {
    /// The tuple drawn from the successes so far.
    pub tuple: ContactTuple,
    /// Neighbourhood radius r (m).
    pub radius: f64,
}

impl ContactModel for JitteredTuple {
    fn propose(&self, query: &ContactQuery<'_>, stream: &mut Stream) -> Vec<FingerPoints> {
        self.jittered(query, stream).into_iter().collect()
    }
}

impl JitteredTuple {
    fn jittered(&self, query: &ContactQuery<'_>, stream: &mut Stream) -> Option<FingerPoints> {
        let contact = self.tuple.iter().find(|contact| contact.part == query.part)?;
        let mut fingers = [Point3::origin(); 2];
        for (finger, point) in fingers.iter_mut().zip(&contact.fingers) {
            let center = query.world_from_part * point;
            *finger = neighbour(query.observation, query.part, &center, self.radius, stream)?;
        }
        Some(fingers)
    }
}

/// A uniformly drawn point of `part` within `radius` of `center`; where that is hidden, the nearest within twice as far.
fn neighbour(
    observation: &Observation,
    part: PartId,
    center: &Point3<f64>,
    radius: f64,
    stream: &mut Stream,
) -> Option<Point3<f64>> {
    let seen: Vec<(f64, Point3<f64>)> = observation
        .points
        .iter()
        .zip(&observation.labels)
        .filter(|(_, label)| **label == PointLabel::Part(part.0))
        .map(|(point, _)| Point3::from(point.map(f64::from)))
        .map(|point| ((point - center).norm(), point))
        .filter(|(distance, _)| *distance < 2.0 * radius)
        .collect();
    let near: Vec<Point3<f64>> = seen.iter().filter(|(distance, _)| *distance < radius).map(|(_, point)| *point).collect();
    if near.is_empty() {
        return seen.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, point)| point);
    }
    Some(near[stream.index(near.len())])
}

/// A tuple used as it is: demonstrations, and recorded trials run again.
#[derive(Debug, Clone)]
pub struct FixedTuple(pub ContactTuple);

impl ContactModel for FixedTuple {
    fn propose(&self, query: &ContactQuery<'_>, _stream: &mut Stream) -> Vec<FingerPoints> {
        let contact = self.0.iter().find(|contact| contact.part == query.part);
        contact.map(|contact| contact.fingers.map(|point| query.world_from_part * point)).into_iter().collect()
    }
}
