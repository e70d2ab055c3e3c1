//! The configuration of a run. The shipped file is the experiment: there are no defaults anywhere else.
//!
//! To add a constant: one commented line in `configs/demo.toml`, one field here, one line in `Config::check`.

use crate::{
    config_bounds::{at_least_one, check_cameras, check_control, ensure, positive, range, within},
    config_layers::{self, Layer},
    inputs::{Inputs, is_path},
    learned_contacts::Draw,
    provenance::sha256_hex,
    results::Method,
    score_config::ScoreConfig,
};
use serde::{Deserialize, Serialize};
use std::path::Path;
use vmao_core::{
    catalogue::{self, CatalogueItem, InstanceSet},
    order::GraspOrder,
    osc::OscGains,
    robots::SLOTS,
};
use vmao_net::{NetworkConfig, TrainingConfig};
use vmao_sim::{
    CameraConfig, GoalConfig, GraspConfig, MAX_ARMS, MotionConfig, SceneConfig, StartConfig, Thresholds, TrialConfig,
};

/// The configuration shipped with the program.
pub const SHIPPED: &str = include_str!("../../../configs/demo.toml");

/// A configuration that cannot be used; the message says where it came from.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{origin}: {message}")]
pub struct ConfigError {
    /// The file and place, or the option.
    pub origin: String,
    /// What was found, what was expected, what exists.
    pub message: String,
}

/// A complete configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// What is manipulated.
    pub object: ObjectConfig,
    /// Who manipulates.
    pub robots: RobotsConfig,
    /// How a trial goes.
    pub trial: OrderConfig,
    /// Placement of the arms and physics.
    pub scene: SceneConfig,
    /// Where objects start.
    pub start: StartConfig,
    /// Where goals are drawn from.
    pub goal: GoalConfig,
    /// What counts as having reached a goal.
    pub thresholds: Thresholds,
    /// What is seen.
    pub cameras: CameraConfig,
    /// How grasps are chosen.
    pub grasp: GraspConfig,
    /// How fast things move.
    pub motion: MotionConfig,
    /// The controller's gains.
    pub osc: OscGains,
    /// Algorithm 1.
    pub explore: ExploreConfig,
    /// The network.
    pub network: NetworkConfig,
    /// Its training.
    pub train: TrainingConfig,
    /// The cells of the table.
    pub evaluate: EvaluateConfig,
    /// How well a learned distribution is measured.
    pub score: ScoreConfig,
    /// The files that it names.
    #[serde(skip)]
    pub inputs: Inputs,
}

/// What is manipulated.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectConfig {
    /// A name of the catalogue, or the path of an object file or of its folder (with a `/`).
    pub name: String,
    /// Further object files that are explored: other sizes of the same object.
    pub sizes: Vec<String>,
    /// Object files that are kept back for evaluation; none for those explored.
    pub held_out: Vec<String>,
    /// The dependency root: `first`, a part's name, or `auto`.
    pub root: String,
}

/// Where Algorithm 1 starts from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Demonstrations {
    /// The object's own; of objects without any, found from their shape.
    Own,
    /// Found from the object's shape.
    Found,
    /// From a file.
    File(String),
}

/// Who manipulates.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotsConfig {
    /// One arm each.
    pub names: Vec<String>,
    /// Slot that the fingers of Sawyers' grippers are screwed to.
    pub sawyer_slot: u8,
}

/// How a trial goes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrderConfig {
    /// The grasp order.
    pub order: GraspOrder,
}

/// Algorithm 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExploreConfig {
    /// Neighbourhood that new contacts are drawn from (m).
    pub radius: f64,
    /// Trials that share one frozen label set.
    pub round_size: u64,
    /// Successes wanted.
    pub successes: u64,
    /// Trials at most.
    pub max_trials: u64,
    /// Grasp orders, taken in turn by the trials; empty stands for `trial.order`.
    pub orders: Vec<GraspOrder>,
    /// `own`, `found`, or the path of a file (with a `/` or an ending).
    pub demonstrations: String,
    /// Tuples whose contacts are all closer than this are near-duplicates (m).
    pub near_distance: f64,
    /// A trial in which a part turns further in its hand is not accepted (degrees).
    pub most_turn_deg: f64,
    /// What the label set does with accepted near-duplicates.
    pub near_duplicates: NearDuplicates,
}

/// What the label set does with an accepted tuple that is near one accepted before; the data set has it either way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NearDuplicates {
    /// It joins the label set, as in Algorithm 1.
    Keep,
    /// It is left out, so that the label set does not crowd.
    LeaveOut,
}

/// The cells of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluateConfig {
    /// Trials of each cell.
    pub trials: u64,
    /// The grasp orders compared.
    pub orders: Vec<GraspOrder>,
    /// Sizes of the object: those explored, or those kept back.
    pub instances: InstanceSet,
    /// The methods compared.
    pub methods: Vec<Method>,
    /// K, latent codes that best-of-K draws for each grasp.
    pub best_of: usize,
    /// How finger points are taken from contact maps.
    pub draw: Draw,
    /// Within which the probability about a peak is counted (m).
    pub peak_radius: f64,
}

impl Config {
    /// The shipped configuration, changed by a file and then by `section.key=value` settings in turn.
    pub fn load(file: Option<&Path>, settings: &[String]) -> Result<Self, ConfigError> {
        Self::load_over(None, file, settings)
    }

    /// The same over one of the further shipped configurations, (name, text).
    pub fn load_over(base: Option<(&str, &str)>, file: Option<&Path>, settings: &[String]) -> Result<Self, ConfigError> {
        let mut layers: Vec<Layer> = base.map(|(name, text)| Layer::File(name.to_owned(), text.to_owned())).into_iter().collect();
        if let Some(path) = file {
            layers.push(Layer::file(path)?);
        }
        for setting in settings {
            layers.push(Layer::Setting(setting.clone()));
        }
        let refuse = |message: String| ConfigError { origin: "configuration".to_owned(), message };
        let shipped: toml::Table = SHIPPED.parse().map_err(|error: toml::de::Error| refuse(error.to_string()))?;
        let merged = config_layers::merge(shipped, &layers)?;
        let mut config: Self = serde_path_to_error::deserialize(merged)
            .map_err(|error| refuse(format!("{}: {}", error.path(), error.inner().message().trim())))?;
        config.check().map_err(refuse)?;
        Inputs::resolve(&mut config)?;
        config.check_sizes().map_err(refuse)?;
        config.check_demonstrations().map_err(refuse)?;
        Ok(config)
    }

    /// The configuration as TOML text, the same for equal configurations.
    pub fn to_toml(&self) -> Result<String, ConfigError> {
        let refuse = |error: toml::ser::Error| ConfigError { origin: "configuration".to_owned(), message: error.to_string() };
        toml::to_string(self).map_err(refuse)
    }

    /// SHA-256 of [`Config::to_toml`]: that of the `config.toml` beside an output.
    pub fn sha256(&self) -> Result<String, ConfigError> {
        self.to_toml().map(|text| sha256_hex(text.as_bytes()))
    }

    /// The same of an explored trial, whose success is to be worth learning from.
    pub fn explored_trial_config(&self) -> TrialConfig {
        TrialConfig { most_turn: self.explore.most_turn_deg.to_radians(), ..self.trial_config() }
    }

    /// What the simulator needs to know of a trial.
    pub fn trial_config(&self) -> TrialConfig {
        TrialConfig {
            start: self.start.clone(),
            goal: self.goal.clone(),
            thresholds: self.thresholds.clone(),
            cameras: self.cameras.clone(),
            grasp: self.grasp.clone(),
            motion: self.motion.clone(),
            osc: self.osc,
            most_turn: f64::INFINITY,
        }
    }

    /// Where Algorithm 1 starts from.
    pub fn demonstrations(&self) -> Demonstrations {
        match self.explore.demonstrations.as_str() {
            "own" => Demonstrations::Own,
            "found" => Demonstrations::Found,
            path => Demonstrations::File(path.to_owned()),
        }
    }

    /// The object's own name, also where it is from a file.
    pub fn object_name(&self) -> &str {
        self.inputs.object(&self.object.name).map_or(&self.object.name, |item| &item.object.name)
    }

    /// The orders that exploration takes in turn.
    pub fn explored_orders(&self) -> Vec<GraspOrder> {
        if self.explore.orders.is_empty() { vec![self.trial.order] } else { self.explore.orders.clone() }
    }

    /// Refuses sizes of an object that do not have the same parts and joints.
    fn check_sizes(&self) -> Result<(), String> {
        let ObjectConfig { name, sizes, held_out, .. } = &self.object;
        let others = || sizes.iter().chain(held_out);
        let Some(first) = self.inputs.object(name) else {
            let none = others().next().is_none();
            return ensure(none, "object", "sizes or held_out for an object of the catalogue, which has its own", "none");
        };
        let parts = |item: &CatalogueItem| -> Vec<String> { item.object.parts.iter().map(|part| part.name.clone()).collect() };
        for other in others() {
            let item = self.inputs.object(other).ok_or_else(|| format!("object: {other} is no path, expected object files"))?;
            let (found, expected) = (parts(item).join(", "), parts(first).join(", "));
            let same = found == expected && item.object.joints.len() == first.object.joints.len();
            ensure(same, other, &format!("parts {found}"), &format!("those of {name}: {expected}"))?;
        }
        Ok(())
    }

    /// Refuses a file of demonstrations that is not of the object.
    fn check_demonstrations(&self) -> Result<(), String> {
        let name = &self.explore.demonstrations;
        let Some(file) = self.inputs.demonstrations(name) else { return Ok(()) };
        let known = self.inputs.object(&self.object.name).cloned();
        let item = known.or_else(|| catalogue::item(&self.object.name, InstanceSet::Train, 0));
        item.map_or(Ok(()), |item| {
            file.tuples(&item).map(drop).map_err(|error| format!("explore.demonstrations: {name}: {error}"))
        })
    }

    fn check(&self) -> Result<(), String> {
        let Self { object, robots, scene, start, goal, thresholds, cameras, grasp, motion, osc, explore, evaluate, .. } = self;
        ensure(!object.name.is_empty(), "object.name", "an empty name", "a name of the catalogue")?;
        ensure(!object.root.is_empty(), "object.root", "an empty name", "first, auto, or the name of a part")?;
        let arms = robots.names.len();
        ensure((1..=MAX_ARMS).contains(&arms), "robots.names", &format!("{arms} arms"), &format!("1 to {MAX_ARMS}"))?;
        within("robots.sawyer_slot", robots.sawyer_slot.into(), (*SLOTS.start()).into(), (*SLOTS.end()).into())?;
        ensure(scene.bases.len() <= MAX_ARMS, "scene.bases", &scene.bases.len().to_string(), &format!("at most {MAX_ARMS}"))?;
        for base in &scene.bases {
            for value in base.position {
                within("scene.bases.position", value, -10.0, 10.0)?;
            }
            within("scene.bases.yaw_deg", base.yaw_deg, -360.0, 360.0)?;
        }
        within("scene.base_distance", scene.base_distance, 0.2, 2.0)?;
        within("scene.base_spacing", scene.base_spacing, 0.2, 2.0)?;
        within("scene.timestep", scene.timestep, 1e-4, 5e-3)?;
        within("scene.noslip_pad_width", scene.noslip_pad_width, 0.0, 1.0)?;
        within("scene.noslip_tolerance", scene.noslip_tolerance, 0.0, 1.0)?;
        within("scene.sleep_tolerance", scene.sleep_tolerance, 0.0, 0.1)?;
        within("scene.friction_impedance_ratio", scene.friction_impedance_ratio, 1.0, 1000.0)?;
        for (key, friction) in [
            ("scene.pad_friction", scene.pad_friction),
            ("scene.object_friction", scene.object_friction),
            ("scene.table_friction", scene.table_friction),
            ("scene.link_friction", scene.link_friction),
        ] {
            // Honest physics: nothing stickier than rubber on wood.
            within(&format!("{key}.sliding"), friction.sliding, 0.0, 1.0)?;
            within(&format!("{key}.torsional"), friction.torsional, 0.0, 0.003)?;
            within(&format!("{key}.rolling"), friction.rolling, 0.0, 0.001)?;
        }
        within("start.half_width", start.half_width, 0.0, 1.0)?;
        range("goal.lift", goal.lift, 0.0, 2.0)?;
        within("goal.sideways", goal.sideways, 0.0, 2.0)?;
        within("goal.yaw_deg", goal.yaw_deg, 0.0, 180.0)?;
        within("goal.tilt_deg", goal.tilt_deg, 0.0, 90.0)?;
        within("goal.joint_change_share", goal.joint_change_share, 0.0, 1.0)?;
        within("goal.joint_change_deg", goal.joint_change_deg, 0.0, 360.0)?;
        positive("thresholds.position", thresholds.position)?;
        positive("thresholds.rotation_deg", thresholds.rotation_deg)?;
        positive("thresholds.joint_deg", thresholds.joint_deg)?;
        positive("thresholds.joint_m", thresholds.joint_m)?;
        within("thresholds.hold_seconds", thresholds.hold_seconds, 0.0, 60.0)?;
        check_cameras(cameras)?;
        check_control(grasp, motion, osc)?;
        positive("explore.radius", explore.radius)?;
        at_least_one("explore.round_size", explore.round_size)?;
        at_least_one("explore.successes", explore.successes)?;
        at_least_one("explore.max_trials", explore.max_trials)?;
        within("explore.near_distance", explore.near_distance, 0.0, 1.0)?;
        within("explore.most_turn_deg", explore.most_turn_deg, 0.0, 180.0)?;
        let known = self.demonstrations();
        let usable = !matches!(&known, Demonstrations::File(name) if !is_path(name));
        ensure(usable, "explore.demonstrations", &explore.demonstrations, "own, found, or a path")?;
        at_least_one("evaluate.trials", evaluate.trials)?;
        ensure(!evaluate.orders.is_empty(), "evaluate.orders", "no orders", "at least one")?;
        ensure(!evaluate.methods.is_empty(), "evaluate.methods", "no methods", "at least one")?;
        within("evaluate.peak_radius", evaluate.peak_radius, 1e-6, 1.0)?;
        ensure((1..=1000).contains(&evaluate.best_of), "evaluate.best_of", &evaluate.best_of.to_string(), "1 to 1000")?;
        self.network.validate().map_err(|error| format!("network: {error}"))?;
        self.train.validate().map_err(|error| format!("train: {error}"))?;
        self.score.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(settings: &[&str]) -> Result<Config, String> {
        let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
        Config::load(None, &settings).map_err(|error| error.to_string())
    }

    #[test]
    fn the_shipped_configuration_is_the_documented_experiment() {
        let config = set(&[]).unwrap();
        assert_eq!(config.robots.names, ["panda", "panda"]);
        assert_eq!((config.goal.lift, config.thresholds.position), ([0.08, 0.20], 0.02));
    }

    #[test]
    fn every_shipped_constant_says_where_it_comes_from() {
        let mut section_reason = false;
        for line in SHIPPED.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#')) {
            let sourced = line
                .split_once('#')
                .is_some_and(|(_, why)| ["§", "appendix", "ours, because", "D"].iter().any(|s| why.contains(s)));
            if line.starts_with('[') {
                section_reason = sourced;
            } else {
                assert!(sourced || (section_reason && line.contains('#')), "{line}");
            }
        }
    }

    #[test]
    fn settings_apply_in_turn_and_bare_words_are_strings() {
        let config = set(&[
            "trial.order=parallel",
            "robots.names=[\"sawyer\"]",
            "goal.lift=[0, 0.1]",
            "object.name=sticks-4",
            "thresholds.position=1",
            "thresholds.position = 0.5",
        ])
        .unwrap();
        assert_eq!((config.trial.order, config.goal.lift), (GraspOrder::Parallel, [0.0, 0.1]));
        assert_eq!((&*config.object.name, config.thresholds.position), ("sticks-4", 0.5));
    }

    #[test]
    fn resolved_text_reads_back_and_its_hash_follows_the_values() {
        let config = set(&["explore.radius=0.03"]).unwrap();
        let back: Config = toml::from_str(&config.to_toml().unwrap()).unwrap();
        assert_eq!(back, config);
        assert_eq!(config.sha256().unwrap(), sha256_hex(config.to_toml().unwrap().as_bytes()));
        assert_ne!(config.sha256().unwrap(), set(&[]).unwrap().sha256().unwrap());
    }

    #[test]
    fn values_out_of_range_are_refused_with_what_is_expected() {
        for (setting, message) in [
            ("goal.lift=[0.2, 0.1]", "configuration: goal.lift: [0.2, 0.1], expected [low, high] with 0 ≤ low ≤ high ≤ 2"),
            ("goal.tilt_deg=nan", "goal.tilt_deg: NaN, expected 0 to 90"),
            ("scene.pad_friction.sliding=1.5", "scene.pad_friction.sliding: 1.5, expected 0 to 1"),
            ("thresholds.position=-0.1", "thresholds.position: -0.1, expected a positive finite number"),
            ("thresholds.joint_deg=inf", "thresholds.joint_deg: inf, expected a positive finite number"),
            ("explore.round_size=0", "explore.round_size: 0, expected at least 1"),
            ("explore.round_size=-1", "explore.round_size: invalid value: integer `-1`, expected u64"),
            ("goal.lift=[1.0]", "goal.lift: invalid length 1, expected an array of length 2"),
            (
                "trial.order=backwards",
                "unknown variant `backwards`, expected one of `parallel`, `sequential-parallel`, `sequential`",
            ),
            ("evaluate.methods=[]", "evaluate.methods: no methods, expected at least one"),
        ] {
            let error = set(&[setting]).unwrap_err();
            assert!(error.contains(message), "{setting}: {error}");
        }
    }
}
