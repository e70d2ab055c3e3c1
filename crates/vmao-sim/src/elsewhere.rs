//! Contacts and a way to them; where there is none, the arms that hold the object bring it elsewhere and look again.

use crate::approach::Approach;
use crate::attempt::Attempt;
use crate::failure::Failure;
use crate::grasping::Grasp;
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::ops::Range;
use vmao_core::contact_model::ContactModel;
use vmao_core::geometry::Pose;
use vmao_core::object::ObjectGoal;
use vmao_core::outcome::FailureStage;

/// Where else the object is brought in turn: turned about the vertical by the first number (rad), raised by the second (m).
const PLACES: [[f64; 2]; 5] = [[0.5, 0.0], [-0.5, 0.0], [0.0, 0.07], [0.5, 0.07], [-0.5, 0.07]];

impl Attempt<'_> {
    /// Looks, asks the model for the contacts of the grasps `step`, and answers grasps on them with a way there.
    ///
    /// While other arms hold the object it is where they hold it: if the next see nothing to touch or find no way to it, they
    /// bring it to a few other places, and the first from which there is a way is taken. Recorded are the contacts of the last
    /// look that had any, and without a way this fails as they do.
    pub(crate) fn find_grasps(
        &mut self,
        model: &dyn ContactModel,
        step: Range<usize>,
    ) -> Result<(Vec<Grasp>, Approach), Failure> {
        let arms = self.arms.clone();
        let mut failure = match self.look_for_grasps(model, step.clone()) {
            Err(failure) if !self.held.is_empty() => failure,
            found => return found,
        };
        for goal in self.other_places() {
            self.note("no way to the next grasp: bring the object elsewhere".to_owned());
            let steps = self.simulation.steps;
            match self.bring(goal) {
                Ok(()) => {}
                Err(blocked) if matches!(blocked.stage, FailureStage::NoPlan | FailureStage::Unreachable) => {
                    // Half of a way that was broken off is another place, too.
                    if self.simulation.steps == steps {
                        continue;
                    }
                }
                Err(lost) => return Err(lost),
            }
            let before = self.forget_contacts();
            // A look does not depend on what was tried at the place before.
            self.arms.clone_from(&arms);
            match self.look_for_grasps(model, step.clone()) {
                Err(unseen) if unseen.stage == FailureStage::NoContact => self.recall_contacts(before),
                Err(still) => failure = still,
                found => return found,
            }
        }
        Err(failure)
    }

    fn look_for_grasps(&mut self, model: &dyn ContactModel, step: Range<usize>) -> Result<(Vec<Grasp>, Approach), Failure> {
        let proposals = self.propose_contacts(model, step)?;
        self.first_feasible(&proposals)
    }

    /// The step's place of the object, displaced about its middle.
    fn other_places(&self) -> [ObjectGoal; PLACES.len()] {
        let goal = self.step_goal(self.held.len());
        let parts = self.simulation.object_state().world_from_parts;
        let middle = parts.iter().map(|part| part.translation.vector).sum::<Vector3<f64>>() / parts.len() as f64;
        let displaced = |[turn, rise]: [f64; 2]| {
            let about = Translation3::from(middle)
                * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn)
                * Translation3::from(-middle);
            let by = Pose::translation(0.0, 0.0, rise) * about;
            ObjectGoal { world_from_root: by * goal.world_from_root, ..goal.clone() }
        };
        PLACES.map(displaced)
    }
}
