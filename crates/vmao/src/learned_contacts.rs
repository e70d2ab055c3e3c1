//! The learned contact models: V-MAO samples a latent code for each grasp, best-of-K several, Top-1 takes its one map.

use crate::config::EvaluateConfig;
use crate::results::Method;
use nalgebra::Point3;
use vmao_core::contact_model::{ContactModel, ContactQuery, FingerPoints};
use vmao_core::random::Stream;
use vmao_net::{ContactNetwork, ModelKind};

/// One network for each part: p(c₁..c_N) = Π p(cᵢ | the scene after the grasps before). With the first part as root, part i
/// is grasp i.
#[derive(Debug)]
pub struct LearnedContacts {
    /// The network of each part.
    pub networks: Vec<ContactNetwork>,
    /// Latent codes drawn for each grasp: one in the paper's method; with more the trial takes the best that it can make.
    pub samples: usize,
}

/// The configured methods whose networks are among `models`.
pub fn methods(config: &EvaluateConfig, models: &[(ModelKind, Vec<ContactNetwork>)]) -> Vec<(Method, LearnedContacts)> {
    let with_model = |&method: &Method| {
        let (_, networks) = models.iter().find(|(kind, _)| *kind == method.model())?;
        let samples = if method == Method::BestOfK { config.best_of } else { 1 };
        Some((method, LearnedContacts { networks: networks.clone(), samples }))
    };
    config.methods.iter().filter_map(with_model).collect()
}

impl LearnedContacts {
    /// A latent code z ~ N(0, I) for the network of `part`; empty for Top-1.
    pub fn latent(&self, part: usize, stream: &mut Stream) -> Vec<f32> {
        (0..self.networks[part].latent_size()).map(|_| stream.normal() as f32).collect()
    }
}

impl ContactModel for LearnedContacts {
    /// The peaks of `samples` maps, the most probable first. Sees the cloud and its colours only: neither labels nor poses.
    fn propose(&self, query: &ContactQuery<'_>, stream: &mut Stream) -> Vec<FingerPoints> {
        let part = usize::from(query.part.0);
        let Some(network) = self.networks.get(part) else { return Vec::new() };
        let seen = query.observation;
        // A cloud too small for the network is a scene in which it sees nowhere to touch.
        let Ok(scene) = network.encode(&seen.points, &seen.colors) else { return Vec::new() };
        let mut ranked: Vec<(f32, [usize; 2])> = Vec::with_capacity(self.samples);
        for _ in 0..self.samples {
            let Ok(map) = network.decode(&scene, &self.latent(part, stream)) else { continue };
            let peaks = map.peaks();
            let probability = map.fingers[0][peaks[0]] * map.fingers[1][peaks[1]];
            if ranked.iter().all(|(_, other)| *other != peaks) {
                ranked.push((probability, peaks));
            }
        }
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let place = |index: usize| Point3::from(seen.points[index].map(f64::from));
        ranked.into_iter().map(|(_, peaks)| peaks.map(place)).collect()
    }
}
