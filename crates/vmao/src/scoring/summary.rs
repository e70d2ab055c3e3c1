//! From scenes to numbers with intervals, as rows for programs and as tables for people.

use super::bootstrap::{Estimate, bootstrap, mean_of};
use super::calibration::{Rank, calibration_error};
use super::execution::Executed;
use super::grips::{Comparison, modes};
use super::measure::{Likelihoods, SceneScore, Scored};
use super::samplers::Sampler;
use crate::reference::{SETS, set_name};
use crate::results::aligned;
use crate::score_config::ScoreConfig;
use nalgebra::Point3;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use vmao_core::contact_model::FingerPoints;
use vmao_net::ModelKind;

/// Variance of a posterior mean over scenes from which on a number of the code counts as used (Burda et al. 2016).
const ACTIVE: f64 = 0.01;

/// One number.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// `train`, `held-out`, or `both`.
    pub sizes: &'static str,
    /// Which part is grasped, from one.
    pub grasp: usize,
    /// What is measured.
    pub measure: &'static str,
    /// Whose; "A − B" is the difference on the same scenes.
    pub method: String,
    /// K, where it depends on that.
    pub samples: Option<usize>,
    /// The number and its interval over scenes.
    #[serde(flatten)]
    pub estimate: Estimate,
}

/// Comparisons of the table: like with like.
const DIFFERENCES: [(Sampler, Sampler); 2] = [(Sampler::VmaoPeak, Sampler::Top1Peaks), (Sampler::VmaoDraw, Sampler::Top1Draw)];

/// A number that a scene may have.
type Number<T> = (&'static str, fn(&T) -> Option<f64>);

const COMPARED: [Number<Comparison>; 4] = [
    ("hit rate", |c| Some(c.hits)),
    ("mode coverage", |c| Some(c.coverage)),
    ("precision", |c| c.precision),
    ("diversity (m)", |c| c.diversity),
];

const LIKELIHOODS: [(&str, Number<Likelihoods>); 6] = [
    ("V-MAO, prior codes", ("negative log-likelihood (nats)", |l| l.vmao_prior)),
    ("V-MAO, posterior codes", ("negative log-likelihood (nats)", |l| l.vmao_bound)),
    ("Top-1", ("negative log-likelihood (nats)", |l| l.top1)),
    ("V-MAO, prior codes − Top-1", ("negative log-likelihood (nats)", |l| Some(l.vmao_prior? - l.top1?))),
    ("uniform", ("negative log-likelihood (nats)", |l| Some(l.uniform))),
    ("uniform on the part", ("negative log-likelihood (nats)", |l| Some(l.uniform_on_part))),
];

/// Collects the rows of one table.
struct Rows<'a> {
    rows: Vec<Row>,
    sizes: &'static str,
    grasp: usize,
    config: &'a ScoreConfig,
    seed: u64,
}

impl Rows<'_> {
    fn push(&mut self, measure: &'static str, method: &str, samples: Option<usize>, estimate: Option<Estimate>) {
        let (sizes, grasp, method) = (self.sizes, self.grasp, method.to_owned());
        self.rows.extend(estimate.map(|estimate| Row { sizes, grasp, measure, method, samples, estimate }));
    }

    fn mean(&mut self, measure: &'static str, method: &str, samples: Option<usize>, values: &[Option<f64>]) {
        self.push(measure, method, samples, mean_of(values, self.config.resamples, self.seed));
    }

    fn scenes(&mut self, scenes: &[&SceneScore]) {
        self.mean("successes", "reference", None, &each(scenes, |s| Some(s.successes as f64)));
        self.mean("modes", "reference", None, &each(scenes, |s| Some(s.modes as f64)));
        self.mean("precision of left-out successes", "reference", None, &each(scenes, |s| s.left_out));
        for (method, (measure, number)) in LIKELIHOODS {
            self.mean(measure, method, None, &each(scenes, |s| average(s.likelihoods.iter().filter_map(number))));
        }
        let information = each(scenes, |s| s.information);
        self.mean("code information (nats)", "V-MAO", None, &information);
        let divergence = each(scenes, |s| average(s.likelihoods.iter().filter_map(|l| l.divergence)));
        self.mean("KL of the posterior (nats)", "V-MAO", None, &divergence);
        let active = |picked: &[usize]| active_units(picked.iter().flat_map(|&i| &scenes[i].posterior_means));
        self.push("active units", "V-MAO", None, bootstrap(scenes.len(), self.config.resamples, self.seed, &active));
        for kind in ModelKind::ALL {
            let ranks = |i: usize| scenes[i].ranks.get(kind.name()).map_or(&[][..], Vec::as_slice);
            let error =
                |picked: &[usize]| calibration_error(&picked.iter().flat_map(|&i| ranks(i)).copied().collect::<Vec<Rank>>());
            let estimate = bootstrap(scenes.len(), self.config.resamples, self.seed, &error);
            self.push("calibration error", kind.title(), None, estimate);
        }
        for (k, &samples) in self.config.samples.clone().iter().enumerate() {
            let of = |scene: &SceneScore, sampler| scene.comparisons.get(&sampler).and_then(|all| all.get(k)).copied();
            for (measure, number) in COMPARED {
                for sampler in Sampler::ALL {
                    let values = each(scenes, |s| number(&of(s, sampler)?));
                    self.mean(measure, sampler.title(), Some(samples), &values);
                }
                for (one, other) in DIFFERENCES {
                    let values = each(scenes, |s| Some(number(&of(s, one)?)? - number(&of(s, other)?)?));
                    self.mean(measure, &format!("{} − {}", one.title(), other.title()), Some(samples), &values);
                }
            }
        }
    }

    fn executed(&mut self, scenes: &[&Scored], executed: &[Executed]) {
        let count = executed.iter().map(|e| e.number + 1).max();
        let samplers: BTreeSet<Sampler> = executed.iter().map(|e| e.sampler).collect();
        let shares: Vec<BTreeMap<Sampler, [f64; 2]>> =
            scenes.iter().map(|scene| carried_out(scene, executed, self.config)).collect();
        for (at, measure) in ["executed: success", "executed: mode coverage"].into_iter().enumerate() {
            let number = |share: &BTreeMap<Sampler, [f64; 2]>, sampler| share.get(&sampler).map(|both| both[at]);
            for &sampler in &samplers {
                let values: Vec<Option<f64>> = shares.iter().map(|share| number(share, sampler)).collect();
                self.mean(measure, sampler.title(), count, &values);
            }
            for (one, other) in DIFFERENCES {
                let difference = |share| Some(number(share, one)? - number(share, other)?);
                let values: Vec<Option<f64>> = shares.iter().map(difference).collect();
                self.mean(measure, &format!("{} − {}", one.title(), other.title()), count, &values);
            }
        }
    }
}

/// In one scene and for one part, by sampler: share of the samples that succeeded, and of all known modes those that they reached.
///
/// The modes are those of the explored successes together with all samples that succeeded.
fn carried_out(scene: &Scored, executed: &[Executed], config: &ScoreConfig) -> BTreeMap<Sampler, [f64; 2]> {
    let (place, part) = (scene.score.place, scene.score.part);
    let here: Vec<&Executed> = executed.iter().filter(|e| e.set == set_name(place.set) && e.scene == place.index).collect();
    let good: Vec<(Sampler, FingerPoints)> = here
        .iter()
        .filter(|e| e.outcome.is_success())
        .filter_map(|e| Some((e.sampler, e.contacts.get(part)?.map(Point3::from))))
        .collect();
    let mut grips = scene.references.clone();
    grips.extend(good.iter().map(|(_, fingers)| *fingers));
    let mode_of = modes(&grips, config.mode_distance, config.mode_angle_deg.to_radians());
    let count = mode_of.iter().max().map_or(1, |last| last + 1) as f64;
    let of = |sampler: Sampler| {
        let tried = here.iter().filter(|e| e.sampler == sampler).count();
        let reached = good.iter().zip(&mode_of[scene.references.len()..]).filter(|((s, _), _)| *s == sampler);
        let succeeded = reached.clone().count();
        let reached: BTreeSet<usize> = reached.map(|(_, &mode)| mode).collect();
        [succeeded as f64 / tried.max(1) as f64, reached.len() as f64 / count]
    };
    here.iter().map(|e| (e.sampler, of(e.sampler))).collect()
}

fn each(scenes: &[&SceneScore], number: impl Fn(&SceneScore) -> Option<f64>) -> Vec<Option<f64>> {
    scenes.iter().map(|scene| number(scene)).collect()
}

fn average(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// How many numbers of the code differ between contacts: variance of the posterior mean above [`ACTIVE`].
fn active_units<'a>(means: impl Iterator<Item = &'a Vec<f32>>) -> Option<f64> {
    let means: Vec<&Vec<f32>> = means.collect();
    let count = means.len() as f64;
    let variance = |unit: usize| {
        let mean = means.iter().map(|m| f64::from(m[unit])).sum::<f64>() / count;
        means.iter().map(|m| (f64::from(m[unit]) - mean).powi(2)).sum::<f64>() / count
    };
    let units = means.first()?.len();
    Some((0..units).filter(|&unit| variance(unit) > ACTIVE).count() as f64)
}

/// All numbers: for the sizes explored, those kept back, and both; for each part.
pub fn summarise(scored: &[Scored], executed: &[Executed], config: &ScoreConfig, seed: u64) -> Vec<Row> {
    let parts = scored.iter().map(|scene| scene.score.part + 1).max().unwrap_or(0);
    let mut rows = Vec::new();
    let choices = [Some(SETS[0]), Some(SETS[1]), None];
    for (set, part) in choices.into_iter().flat_map(|set| (0..parts).map(move |part| (set, part))) {
        let chosen: Vec<&Scored> =
            scored.iter().filter(|s| s.score.part == part && set.is_none_or(|set| s.score.place.set == set)).collect();
        if chosen.is_empty() {
            continue;
        }
        let scores: Vec<&SceneScore> = chosen.iter().map(|scene| &scene.score).collect();
        let mut own = Rows { rows: Vec::new(), sizes: set.map_or("both", set_name), grasp: part + 1, config, seed };
        own.scenes(&scores);
        if !executed.is_empty() {
            own.executed(&chosen, executed);
        }
        rows.extend(own.rows);
    }
    rows
}

/// The tables for people: one for each sizes and grasp, a line for each method of a measure, a column for each K.
pub fn table(rows: &[Row], samples: &[usize]) -> String {
    let mut text = String::new();
    let mut blocks: Vec<(&str, usize)> = Vec::new();
    for row in rows {
        if !blocks.contains(&(row.sizes, row.grasp)) {
            blocks.push((row.sizes, row.grasp));
        }
    }
    for (sizes, grasp) in blocks {
        let own: Vec<&Row> = rows.iter().filter(|row| row.sizes == sizes && row.grasp == grasp).collect();
        let scenes = own.first().map_or(0, |row| row.estimate.scenes);
        text += &format!("Sizes: {sizes}; grasp {grasp}; {scenes} scenes\n");
        let mut single = vec![vec!["measure".to_owned(), "method".to_owned(), "K".to_owned(), "value [95 %]".to_owned()]];
        let mut by_count = vec![["measure", "method"].map(str::to_owned).to_vec()];
        by_count[0].extend(samples.iter().map(|k| format!("K = {k}")));
        for row in &own {
            if row.samples.is_none() || row.measure.starts_with("executed") {
                let k = row.samples.map_or_else(String::new, |k| k.to_string());
                single.push(vec![row.measure.to_owned(), row.method.clone(), k, words(&row.estimate)]);
                continue;
            }
            let known = by_count.iter().any(|line| line[0] == row.measure && line[1] == row.method);
            if !known {
                let entry = |&k: &usize| {
                    let same = |r: &&&Row| r.measure == row.measure && r.method == row.method && r.samples == Some(k);
                    own.iter().find(same).map_or_else(|| "–".to_owned(), |row| words(&row.estimate))
                };
                let mut line = vec![row.measure.to_owned(), row.method.clone()];
                line.extend(samples.iter().map(entry));
                by_count.push(line);
            }
        }
        by_count[1..].sort_by_key(|line| COMPARED.iter().position(|(measure, _)| line[0] == *measure));
        text += &aligned(&single, 2);
        text.push('\n');
        text += &aligned(&by_count, 2);
        text.push('\n');
    }
    text
}

/// "0.52 [0.41, 0.63]", with as many digits as the size asks for.
fn words(estimate: &Estimate) -> String {
    let [low, high] = estimate.interval95;
    let digits = if estimate.value.abs() < 0.1 && low.abs().max(high.abs()) < 0.2 { 3 } else { 2 };
    format!("{:.digits$} [{low:.digits$}, {high:.digits$}]", estimate.value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_that_never_move_are_not_active() {
        let means = [vec![0.0, 1.0, 0.5], vec![0.05, -1.0, 0.5]];
        assert_eq!(active_units(means.iter()), Some(1.0), "variances 0.000625, 1 and 0");
        assert_eq!(active_units([].iter()), None);
    }

    #[test]
    fn tables_have_a_line_for_each_method_and_a_column_for_each_count() {
        let estimate = |value: f64| Estimate { value, interval95: [value - 0.25, value + 0.25], scenes: 3 };
        let row = |measure, method: &str, samples, value| Row {
            sizes: "both",
            grasp: 1,
            measure,
            method: method.to_owned(),
            samples,
            estimate: estimate(value),
        };
        let rows = [
            row("modes", "reference", None, 3.0),
            row("hit rate", "uniform", Some(1), 0.5),
            row("hit rate", "uniform", Some(4), 0.75),
        ];
        let expected = "\
Sizes: both; grasp 1; 3 scenes
measure  method     K       value [95 %]
─────────────────────────────────────────
modes    reference     3.00 [2.75, 3.25]

measure   method               K = 1              K = 4
────────────────────────────────────────────────────────
hit rate  uniform  0.50 [0.25, 0.75]  0.75 [0.50, 1.00]

";
        let found = table(&rows, &[1, 4]);
        let squeezed =
            |text: &str| text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect::<Vec<_>>();
        let plain = |lines: Vec<String>| lines.into_iter().filter(|line| !line.starts_with('─')).collect::<Vec<_>>();
        assert_eq!(plain(squeezed(&found)), plain(squeezed(expected)), "{found}");
    }
}
