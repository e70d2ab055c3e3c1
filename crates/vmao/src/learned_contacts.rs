//! The learned contact models: V-MAO samples a latent code for each grasp, Top-1 takes its one map.

use nalgebra::Point3;
use vmao_core::contact_model::{ContactModel, ContactQuery};
use vmao_core::random::Stream;
use vmao_net::ContactNetwork;

/// One network for each part: p(c₁..c_N) = Π p(cᵢ | the scene after the grasps before). With the first part as root, part i
/// is grasp i.
#[derive(Debug)]
pub struct LearnedContacts {
    /// The network of each part.
    pub networks: Vec<ContactNetwork>,
}

impl LearnedContacts {
    /// A latent code z ~ N(0, I) for the network of `part`; empty for Top-1.
    pub fn latent(&self, part: usize, stream: &mut Stream) -> Vec<f32> {
        (0..self.networks[part].latent_size()).map(|_| stream.normal() as f32).collect()
    }
}

impl ContactModel for LearnedContacts {
    /// The peaks of one sampled map. Sees the cloud and its colours only: neither labels nor the part's pose.
    fn propose(&self, query: &ContactQuery<'_>, stream: &mut Stream) -> Option<[Point3<f64>; 2]> {
        let part = usize::from(query.part.0);
        let network = self.networks.get(part)?;
        let latent = self.latent(part, stream);
        // A cloud too small for the network is a scene in which it sees nowhere to touch.
        let map = network.map(&query.observation.points, &query.observation.colors, &latent).ok()?;
        Some(map.peaks().map(|point| Point3::from(query.observation.points[point].map(f64::from))))
    }
}
