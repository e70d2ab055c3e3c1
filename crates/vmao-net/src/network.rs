//! Prediction: a trained network on plain slices, normalisations folded away, no automatic differentiation.

use crate::augment::View;
use crate::batch::{Prepared, read};
use crate::checkpoint::Checkpoint;
use crate::cloud::{check_cloud, features, label_maps, map_means, posterior_features};
use crate::config::{LatentPlacement, ModelKind, NetworkConfig};
use crate::cvae::{Cvae, LOG_VARIANCE_LIMIT};
use crate::error::Error;
use crate::kernels::cross_entropy::{FINGERS, softmax};
use crate::kernels::max_pool::max_pool;
use crate::layers::{Folded, FoldedGroup, FoldedModulated, FoldedUpConv, Head, SetAbstraction};
use crate::parameters::Parameters;
use crate::pyramid::{Flow, Pyramid};
use vmao_core::contact::ContactMap;

/// A trained network: from a coloured cloud and a latent code to the contact map of a gripper's two fingers.
#[derive(Debug, Clone)]
pub struct ContactNetwork {
    config: NetworkConfig,
    latent_size: usize,
    scene: Encoder,
    posterior: Option<(Encoder, Head, Head)>,
    decoder: Vec<FoldedUpConv>,
    head: Folded,
    context: Head,
    logits: FoldedModulated,
}

/// q(z | scene, contacts): a normal distribution of independent numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct CodeDistribution {
    /// Z numbers.
    pub mean: Vec<f32>,
    /// Z numbers.
    pub log_variance: Vec<f32>,
}

type Encoder = Vec<(FoldedGroup, usize)>;

/// A cloud that went through the scene encoder once, ready for any number of latent codes.
#[derive(Debug, Clone)]
pub struct EncodedScene {
    pyramid: Pyramid,
    points: Vec<[f32; 3]>,
    features: Vec<f32>,
    levels: Vec<Vec<f32>>,
}

impl ContactNetwork {
    /// Folds a checkpoint's weights.
    pub fn load(checkpoint: &Checkpoint) -> Self {
        let (_, cvae) = checkpoint.kind.layers(&checkpoint.network);
        Self::fold(&cvae, &checkpoint.network, &checkpoint.parameters)
    }

    pub(crate) fn fold(cvae: &Cvae, config: &NetworkConfig, parameters: &Parameters) -> Self {
        let encoder = |layers: &[SetAbstraction]| layers.iter().map(|layer| layer.fold(parameters)).collect::<Encoder>();
        Self {
            config: config.clone(),
            latent_size: cvae.latent_size(),
            scene: encoder(&cvae.scene),
            posterior: cvae
                .posterior
                .as_ref()
                .map(|p| (encoder(&p.encoder), p.mean.fold(parameters), p.log_variance.fold(parameters))),
            decoder: cvae.decoder.iter().map(|layer| layer.fold(parameters)).collect(),
            head: cvae.head.fold(parameters),
            context: cvae.context.fold(parameters),
            logits: cvae.logits.fold(parameters),
        }
    }

    /// With or without latent code.
    pub fn kind(&self) -> ModelKind {
        if self.latent_size > 0 { ModelKind::Vmao } else { ModelKind::Top1 }
    }

    /// Z: how long a latent code is; zero for [`ModelKind::Top1`].
    pub fn latent_size(&self) -> usize {
        self.latent_size
    }

    /// The fewest points that a cloud may have.
    pub fn fewest_points(&self) -> usize {
        self.config.fewest_points()
    }

    /// The contact map of a world-frame cloud (m) with colours in [0, 1] for one latent code; one value per point and finger.
    ///
    /// Fails on a cloud that is too small or not finite, and on a latent code of the wrong length.
    pub fn map(&self, points: &[[f32; 3]], colors: &[[f32; 3]], latent: &[f32]) -> Result<ContactMap, Error> {
        self.decode(&self.encode(points, colors)?, latent)
    }

    /// The part of [`ContactNetwork::map`] that does not depend on the latent code.
    pub fn encode(&self, points: &[[f32; 3]], colors: &[[f32; 3]]) -> Result<EncodedScene, Error> {
        check_cloud(points, colors, self.fewest_points())?;
        let (pyramid, cloud) = read(points, colors, &self.config);
        Ok(self.encode_ordered(pyramid, cloud))
    }

    /// The part of [`ContactNetwork::map`] that depends on the latent code.
    pub fn decode(&self, scene: &EncodedScene, latent: &[f32]) -> Result<ContactMap, Error> {
        self.check_latent(latent)?;
        let probabilities = softmax(&self.logits(scene, latent));
        let mut fingers = [0, 1].map(|_| vec![0.0; scene.points.len()]);
        for (row, &place) in probabilities.chunks_exact(FINGERS).zip(&scene.pyramid.order) {
            (0..FINGERS).for_each(|finger| fingers[finger][place as usize] = row[finger]);
        }
        Ok(ContactMap { fingers })
    }

    /// The logarithms of [`ContactNetwork::decode`]'s probabilities, which do not underflow; a value per finger and point.
    pub fn log_probabilities(&self, scene: &EncodedScene, latent: &[f32]) -> Result<[Vec<f64>; FINGERS], Error> {
        self.check_latent(latent)?;
        let logits = self.logits(scene, latent);
        let mut fingers = [0, 1].map(|_| vec![0.0; scene.points.len()]);
        for (finger, logs) in fingers.iter_mut().enumerate() {
            let own = || logits.iter().skip(finger).step_by(FINGERS).map(|&x| f64::from(x));
            let largest = own().fold(f64::NEG_INFINITY, f64::max);
            let total = largest + own().map(|x| (x - largest).exp()).sum::<f64>().ln();
            own().zip(&scene.pyramid.order).for_each(|(logit, &place)| logs[place as usize] = logit - total);
        }
        Ok(fingers)
    }

    /// q(z | scene, contacts); none without latent code.
    ///
    /// `points` is the cloud that was encoded, `contacts` where the two fingers touch: world frame (m). Fails on contacts that
    /// are not finite and on a cloud of another length.
    pub fn recognise(
        &self,
        scene: &EncodedScene,
        points: &[[f32; 3]],
        contacts: &[[f32; 3]; FINGERS],
    ) -> Result<Option<CodeDistribution>, Error> {
        let refuse = |what: &str, found, expected| Err(Error::Input { what: what.to_owned(), found, expected });
        if points.len() != scene.points.len() {
            return refuse("cloud", format!("{} points", points.len()), format!("{}, as were encoded", scene.points.len()));
        }
        if contacts.iter().flatten().any(|x| !x.is_finite()) {
            return refuse("contacts", format!("{contacts:?}"), "finite numbers".to_owned());
        }
        let maps = label_maps(&scene.pyramid.sort(points), contacts, self.config.label_sigma);
        Ok(self.posterior(scene, &maps).map(|(mean, log_variance)| CodeDistribution { mean, log_variance }))
    }

    fn check_latent(&self, latent: &[f32]) -> Result<(), Error> {
        if latent.len() == self.latent_size && latent.iter().all(|z| z.is_finite()) {
            return Ok(());
        }
        Err(Error::Input {
            what: "latent code".to_owned(),
            found: format!("{latent:?}"),
            expected: format!("{} finite numbers", self.latent_size),
        })
    }

    fn encode_ordered(&self, pyramid: Pyramid, cloud: View) -> EncodedScene {
        let features = features(&cloud.points, &cloud.colors, &cloud.outward, &self.config);
        let levels = run(&self.scene, &features, &pyramid, &cloud.points);
        EncodedScene { pyramid, points: cloud.points, features, levels }
    }

    /// A prepared example, not augmented.
    pub(crate) fn encode_prepared(&self, example: &Prepared) -> EncodedScene {
        self.encode_ordered(example.pyramid.clone(), example.cloud.clone())
    }

    /// Mean and log variance of q(z | scene, maps); maps in the order of the scene's points.
    pub(crate) fn posterior(&self, scene: &EncodedScene, maps: &[f32]) -> Option<(Vec<f32>, Vec<f32>)> {
        let (encoder, mean, log_variance) = self.posterior.as_ref()?;
        let rows = posterior_features(&scene.features, maps);
        let levels = run(encoder, &rows, &scene.pyramid, &scene.points);
        let top = &levels[levels.len() - 1];
        let k = scene.pyramid.counts[levels.len()];
        let mut pooled = max_pool(top, k, top.len() / k).0;
        pooled.extend(map_means(&scene.points, maps, &self.config));
        let clamp = |v: f32| v.clamp(-LOG_VARIANCE_LIMIT, LOG_VARIANCE_LIMIT);
        Some((mean.apply(&pooled), log_variance.apply(&pooled).into_iter().map(clamp).collect()))
    }

    /// Logits in the order of the scene's points, points × 2.
    pub(crate) fn logits(&self, scene: &EncodedScene, latent: &[f32]) -> Vec<f32> {
        let levels = scene.levels.len();
        let common = if self.config.latent_placement == LatentPlacement::EveryLevel { latent } else { &[] };
        let count = scene.pyramid.counts[levels];
        let top = &scene.levels[levels - 1];
        let mut coarse = Vec::with_capacity(top.len() + count * latent.len());
        for row in top.chunks_exact(top.len() / count) {
            coarse.extend_from_slice(row);
            coarse.extend_from_slice(latent);
        }
        for (i, layer) in self.decoder.iter().enumerate() {
            let fine = levels - 1 - i;
            let skip = if fine == 0 { &scene.features } else { &scene.levels[fine - 1] };
            let mut pairs = (Vec::new(), Vec::new());
            scene.pyramid.pairs(&scene.points, fine, Flow::Up, 0, &mut pairs);
            coarse = layer.apply(&coarse, skip, common, &pairs.0, &pairs.1);
        }
        let mut hidden = Vec::new();
        self.head.apply(&coarse, &mut hidden);
        let mut modulators = self.context.apply(&max_pool(top, count, top.len() / count).0);
        modulators.extend_from_slice(latent);
        self.logits.apply(&hidden, &modulators)
    }
}

fn run(encoder: &Encoder, features: &[f32], pyramid: &Pyramid, points: &[[f32; 3]]) -> Vec<Vec<f32>> {
    let mut out: Vec<Vec<f32>> = Vec::with_capacity(encoder.len());
    for (level, (layer, k)) in encoder.iter().enumerate() {
        let mut pairs = (Vec::new(), Vec::new());
        pyramid.pairs(points, level, Flow::Down, 0, &mut pairs);
        let finer = out.last().map_or(features, |finer| finer);
        out.push(layer.apply(finer, &pairs.0, &pairs.1, *k));
    }
    out
}
