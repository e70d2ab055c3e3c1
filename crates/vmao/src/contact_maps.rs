//! Contact maps of one scene for several latent codes, for pictures and other programs.

use crate::failure::Failure;
use crate::learned_contacts::{LearnedContacts, latent};
use crate::report::{ContactMapFigure, LatentMap};
use std::io::{self, Write};
use vmao_core::observation::Observation;
use vmao_core::random::Stream;

/// Names the stream of the latent codes that are shown.
const SHOWN_LATENTS: u64 = 1 << 35;

/// The maps of `codes` latent codes for `part` on one observation, with the points that a gripper of this `span` (m) is sent to.
///
/// The seed decides the codes, so that code 2 of one scene can be compared with code 2 of another (supplement, Figure 4).
pub(crate) fn latent_maps(
    model: &LearnedContacts,
    part: usize,
    seen: &Observation,
    span: [f64; 2],
    seed: u64,
    codes: u64,
) -> Result<Vec<LatentMap>, Failure> {
    let network = &model.networks[part];
    let scene = network.encode(&seen.points, &seen.colors)?;
    let map = |code| {
        let latent = latent(network, &mut Stream::new(seed, &[SHOWN_LATENTS, code]));
        let map = network.decode(&scene, &latent)?;
        let peaks = map.peaks(&seen.points, model.peak_radius as f32, span.map(|width| width as f32));
        let [finger1, finger2] = map.fingers;
        Ok(LatentMap { latent, finger1, finger2, peaks, executed: None })
    };
    (0..codes).map(map).collect()
}

impl ContactMapFigure {
    /// The figure of one observation and its maps.
    pub(crate) fn new(title: String, caption: String, seen: &Observation, maps: Vec<LatentMap>) -> Self {
        let Observation { points, colors, labels } = seen.clone();
        Self { title, caption, points, colors, labels, maps }
    }
}

/// Writes a map as PLY: world positions (m), colours, and the probability of each point for finger 1 and for finger 2.
pub(crate) fn ply(out: &mut impl Write, seen: &Observation, map: &LatentMap) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\ncomment latent code {:?}", map.latent)?;
    writeln!(out, "element vertex {}", seen.points.len())?;
    for (kind, names) in [("float", "x y z"), ("uchar", "red green blue"), ("float", "finger1 finger2")] {
        names.split(' ').try_for_each(|name| writeln!(out, "property {kind} {name}"))?;
    }
    writeln!(out, "end_header")?;
    for (((point, color), finger1), finger2) in seen.points.iter().zip(&seen.colors).zip(&map.finger1).zip(&map.finger2) {
        point.iter().try_for_each(|x| out.write_all(&x.to_le_bytes()))?;
        out.write_all(&color.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8))?;
        [finger1, finger2].iter().try_for_each(|p| out.write_all(&p.to_le_bytes()))?;
    }
    Ok(())
}
