//! From ranked proposals to grasps with a way to them: the first that can be made is taken.

use crate::approach::Approach;
use crate::attempt::{Attempt, Draw};
use crate::failure::Failure;
use crate::grasping::Grasp;
use crate::profile::{Stage, time};
use vmao_core::contact_model::FingerPoints;

/// Combinations of proposals that are tried after the best one failed; each costs a search for grasps and a plan.
const TRIED: usize = 8;

impl Attempt<'_> {
    /// The first proposals, best first, that all arms can reach, carry and plan to; `proposals` holds a list for each grasp.
    ///
    /// Fails as the best proposals fail. With one proposal for each grasp nothing else is tried.
    pub(crate) fn first_feasible(&mut self, proposals: &[Vec<FingerPoints>]) -> Result<(Vec<Grasp>, Approach), Failure> {
        let best: Vec<FingerPoints> = proposals.iter().map(|ranked| ranked[0]).collect();
        let failure = match self.grasps_at(&best) {
            Ok(found) => return Ok(found),
            Err(failure) => failure,
        };
        if proposals.iter().all(|ranked| ranked.len() == 1) {
            return Err(failure);
        }
        let graspable = time(Stage::Grasping, || self.graspable(proposals));
        let lengths: Vec<usize> = graspable.iter().map(Vec::len).collect();
        for ranks in by_rank(&lengths, TRIED) {
            let contacts: Vec<FingerPoints> = ranks.iter().zip(&graspable).map(|(&rank, ranked)| ranked[rank]).collect();
            if contacts == best {
                continue;
            }
            self.note_contacts(&contacts);
            if let Ok(found) = self.grasps_at(&contacts) {
                return Ok(found);
            }
        }
        self.note_contacts(&best);
        Err(failure)
    }

    fn grasps_at(&mut self, contacts: &[FingerPoints]) -> Result<(Vec<Grasp>, Approach), Failure> {
        let choices = self.choose_grasps(contacts)?;
        self.plan_approach(choices)
    }

    /// Of each grasp's proposals those that its arm alone can reach and carry, still best first.
    fn graspable(&self, proposals: &[Vec<FingerPoints>]) -> Vec<Vec<FingerPoints>> {
        let first = self.held.len();
        let motion = self.waypoints(&self.trajectory(self.step_goal(first + proposals.len())));
        let mut stream = self.stream(Draw::Reach);
        let mut kept = Vec::with_capacity(proposals.len());
        for (ranked, &part) in proposals.iter().zip(&self.sequence[first..]) {
            let arm = self.arms[usize::from(part.0)];
            let cloud = self.cloud_on(part);
            let mut possible = |fingers: &&FingerPoints| {
                let found = self.within_reach((arm, part), (&cloud, fingers), &motion, &mut stream);
                found.is_ok_and(|grasps| !grasps.is_empty())
            };
            kept.push(ranked.iter().filter(|fingers| possible(fingers)).copied().collect());
        }
        kept
    }

    /// Notes that these contacts were chosen instead of those noted when the model was asked.
    fn note_contacts(&mut self, contacts: &[FingerPoints]) {
        let first = self.held.len();
        for (record, fingers) in self.grasps[first..].iter_mut().zip(contacts) {
            record.contact.fingers = fingers.map(|point| record.world_from_part.inverse_transform_point(&point));
        }
        if let Some(recorder) = &mut self.simulation.recorder {
            for (noted, fingers) in recorder.rollout.contacts[first..].iter_mut().zip(contacts) {
                noted.fingers = fingers.map(Into::into);
            }
        }
    }
}

/// The first `count` choices of one place in each list: by the sum of the places, then by the first list's, and so on.
fn by_rank(lengths: &[usize], count: usize) -> Vec<Vec<usize>> {
    let largest = lengths.iter().map(|length| length.saturating_sub(1)).sum();
    let mut found = Vec::new();
    if lengths.contains(&0) {
        return found;
    }
    for sum in 0..=largest {
        extend(&mut found, &mut Vec::new(), lengths, sum, count);
        if found.len() >= count {
            break;
        }
    }
    found
}

/// Appends the choices that begin with `chosen` and whose other places add up to `left`.
fn extend(found: &mut Vec<Vec<usize>>, chosen: &mut Vec<usize>, lengths: &[usize], left: usize, count: usize) {
    let Some(&length) = lengths.get(chosen.len()) else {
        if left == 0 && found.len() < count {
            found.push(chosen.clone());
        }
        return;
    };
    for place in 0..length.min(left + 1) {
        chosen.push(place);
        extend(found, chosen, lengths, left - place, count);
        chosen.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn better_ranks_come_first_and_none_is_outside_its_list() {
        let all = by_rank(&[2, 3], 99);
        assert_eq!(all, [vec![0, 0], vec![0, 1], vec![1, 0], vec![0, 2], vec![1, 1], vec![1, 2]]);
        assert_eq!(by_rank(&[2, 3], 3), all[..3]);
        assert_eq!(by_rank(&[16; 6], 4).len(), 4);
        assert!(by_rank(&[2, 0], 5).is_empty());
    }
}
