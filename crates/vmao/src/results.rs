//! Success rates with intervals, failures by stage: `results.json` and the table on stdout.

use crate::provenance::{COMMIT, RunInfo, VERSION};
use crate::significance::{self, Comparison};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use vmao_core::{
    order::GraspOrder,
    outcome::{FailureStage, Reachability, TrialOutcome},
};
use vmao_net::ModelKind;
use vmao_sim::GoalReach;

/// Who chooses the contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Contacts drawn from the generative model.
    Vmao,
    /// Contacts drawn several times from the generative model, the most probable that can be made: an addition of ours.
    BestOfK,
    /// The most probable contacts of the deterministic model.
    Top1,
}

impl Method {
    /// The name used on the command line and in `results.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vmao => "vmao",
            Self::BestOfK => "best-of-k",
            Self::Top1 => "top1",
        }
    }

    /// The network that it asks.
    pub fn model(self) -> ModelKind {
        match self {
            Self::Vmao | Self::BestOfK => ModelKind::Vmao,
            Self::Top1 => ModelKind::Top1,
        }
    }

    /// The name used in tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::Vmao => "V-MAO",
            Self::BestOfK => "V-MAO best-of-K",
            Self::Top1 => "Top-1",
        }
    }
}

/// The 95 % score interval of a success rate (Wilson, JASA 22, 1927).
///
/// (p + z²/2n ± z √(p(1−p)/n + z²/4n²)) / (1 + z²/n), z = 1.959964; [0, 1] without trials.
pub fn wilson95(successes: u64, trials: u64) -> [f64; 2] {
    const Z: f64 = 1.959_963_984_540_054; // the 97.5 % quantile of the standard normal
    if trials == 0 {
        return [0.0, 1.0];
    }
    let (n, p) = (trials as f64, successes as f64 / trials as f64);
    let scale = 1.0 + Z * Z / n;
    let middle = (p + Z * Z / (2.0 * n)) / scale;
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt() / scale;
    // At no success and at nothing but success the closed form meets 0 and 1 up to rounding; say so exactly.
    let low = if successes == 0 { 0.0 } else { (middle - half).max(0.0) };
    let high = if successes == trials { 1.0 } else { (middle + half).min(1.0) };
    [low, high]
}

/// What was known of the goals of a cell's trials; the same for all methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalCounts {
    /// Goals that the arms reach.
    pub reachable: u64,
    /// Goals proven to be out of their reach.
    pub unreachable: u64,
    /// Goals of which neither was found.
    pub unknown: u64,
    /// Goals that were drawn anew because the configuration asks for it.
    pub redraws: u64,
}

impl GoalCounts {
    /// Counts the goals of trials.
    pub fn of(goals: impl IntoIterator<Item = GoalReach>) -> Self {
        let mut counts = Self::default();
        for goal in goals {
            counts.redraws += u64::from(goal.redraws);
            match goal.reachability {
                Reachability::Reachable => counts.reachable += 1,
                Reachability::Unreachable => counts.unreachable += 1,
                Reachability::Unknown => counts.unknown += 1,
            }
        }
        counts
    }

    /// "goals proven out of reach: 3 of 160"; what is zero otherwise is left out.
    pub fn sentence(&self) -> String {
        let total = self.reachable.saturating_add(self.unreachable).saturating_add(self.unknown);
        let mut text = format!("goals proven out of reach: {} of {total}", self.unreachable);
        if self.unknown > 0 {
            text += &format!(", undecided: {}", self.unknown);
        }
        if self.redraws > 0 {
            text += &format!(", drawn anew: {}", self.redraws);
        }
        text
    }
}

/// One cell of the table: `successes + sum(failures) == trials`, always.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "CellFields", into = "CellFields")]
pub struct Cell {
    object: String,
    robots: Vec<String>,
    order: GraspOrder,
    method: Method,
    successes: u64,
    failures: BTreeMap<FailureStage, u64>,
    goals: Option<GoalCounts>,
}

/// A cell as `results.json` writes it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CellFields {
    object: String,
    robots: Vec<String>,
    order: GraspOrder,
    method: Method,
    trials: u64,
    successes: u64,
    rate: f64,
    wilson95: [f64; 2],
    failures: BTreeMap<FailureStage, u64>,
    /// Not in files of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    goals: Option<GoalCounts>,
}

impl Cell {
    /// Counts the outcomes of trials.
    pub fn new(
        object: &str,
        robots: &[String],
        order: GraspOrder,
        method: Method,
        outcomes: impl IntoIterator<Item = TrialOutcome>,
    ) -> Self {
        let mut failures = FailureStage::ALL.map(|stage| (stage, 0)).into_iter().collect::<BTreeMap<_, u64>>();
        let mut successes = 0;
        for outcome in outcomes {
            match outcome {
                TrialOutcome::Success => successes += 1,
                TrialOutcome::Failed(stage) => *failures.entry(stage).or_default() += 1,
            }
        }
        Self { object: object.to_owned(), robots: robots.to_vec(), order, method, successes, failures, goals: None }
    }

    /// The same cell with what was known of its trials' goals.
    pub fn with_goals(self, goals: impl IntoIterator<Item = GoalReach>) -> Self {
        Self { goals: Some(GoalCounts::of(goals)), ..self }
    }

    /// What was known of its trials' goals, if that is known.
    pub fn goals(&self) -> Option<GoalCounts> {
        self.goals
    }

    /// The object's catalogue name.
    pub fn object(&self) -> &str {
        &self.object
    }

    /// The robots' names, by arm.
    pub fn robots(&self) -> &[String] {
        &self.robots
    }

    /// The grasp order.
    pub fn order(&self) -> GraspOrder {
        self.order
    }

    /// Who chose the contacts.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Number of trials.
    pub fn trials(&self) -> u64 {
        self.successes + self.failures.values().sum::<u64>()
    }

    /// Number of trials that met their goal.
    pub fn successes(&self) -> u64 {
        self.successes
    }

    /// Number of trials that failed first at `stage`.
    pub fn failures(&self, stage: FailureStage) -> u64 {
        self.failures.get(&stage).copied().unwrap_or(0)
    }

    /// Successes over trials; zero without trials.
    pub fn rate(&self) -> f64 {
        self.successes as f64 / self.trials().max(1) as f64
    }

    /// The interval of the rate, [`wilson95`].
    pub fn wilson95(&self) -> [f64; 2] {
        wilson95(self.successes, self.trials())
    }
}

impl From<Cell> for CellFields {
    fn from(cell: Cell) -> Self {
        let (trials, rate, wilson95) = (cell.trials(), cell.rate(), cell.wilson95());
        let Cell { object, robots, order, method, successes, failures, goals } = cell;
        Self { object, robots, order, method, trials, successes, rate, wilson95, failures, goals }
    }
}

impl TryFrom<CellFields> for Cell {
    type Error = String;

    fn try_from(fields: CellFields) -> Result<Self, String> {
        let CellFields { object, robots, order, method, trials, successes, rate, wilson95: _, failures, goals } = fields;
        let failed = failures.values().try_fold(0_u64, |sum, &count| sum.checked_add(count));
        let counted = failed.and_then(|failed| failed.checked_add(successes));
        if counted != Some(trials) {
            return Err(format!("{successes} successes and {failures:?} failures, expected {trials} trials in all"));
        }
        if let Some(counts) = goals {
            let all = [counts.reachable, counts.unreachable, counts.unknown];
            if all.iter().try_fold(0_u64, |sum, &count| sum.checked_add(count)) != Some(trials) {
                return Err(format!("goals {all:?}, expected {trials} in all"));
            }
        }
        let cell = Self { object, robots, order, method, successes, failures, goals };
        if (cell.rate() - rate).abs() > 1e-9 {
            return Err(format!("rate {rate}, expected {successes} / {trials} = {}", cell.rate()));
        }
        Ok(cell)
    }
}

/// `results.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Results {
    /// Version of this layout.
    pub schema: u32,
    /// Version of the program.
    pub version: String,
    /// Commit of the program.
    pub commit: String,
    /// SHA-256 of the `config.toml` beside it.
    pub config_sha256: String,
    /// Seed of the run.
    pub seed: u64,
    /// The cells of the table.
    pub cells: Vec<Cell>,
    /// Methods compared on the same trials; not in files of older versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub comparisons: Vec<Comparison>,
}

impl Results {
    /// The results of this run of this program.
    pub fn new(info: &RunInfo, cells: Vec<Cell>) -> Self {
        let (version, commit) = (VERSION.to_owned(), COMMIT.to_owned());
        Self {
            schema: 1,
            version,
            commit,
            config_sha256: info.config_sha256.clone(),
            seed: info.seed,
            cells,
            comparisons: Vec::new(),
        }
    }

    /// What was known of the goals of all cells; none if that is not known of every cell.
    pub fn goals(&self) -> Option<GoalCounts> {
        self.cells.iter().map(Cell::goals).try_fold(GoalCounts::default(), |sum, counts| {
            let counts = counts?;
            Some(GoalCounts {
                reachable: sum.reachable.saturating_add(counts.reachable),
                unreachable: sum.unreachable.saturating_add(counts.unreachable),
                unknown: sum.unknown.saturating_add(counts.unknown),
                redraws: sum.redraws.saturating_add(counts.redraws),
            })
        })
    }

    /// The table for people: a row for each cell, with its interval and where its failures began.
    pub fn table(&self) -> String {
        let mut rows: Vec<Vec<String>> = Vec::with_capacity(self.cells.len() + 1);
        let mut heading: Vec<String> =
            ["object", "robots", "order", "method", "success", "rate %", "95 % interval"].map(str::to_owned).to_vec();
        heading.extend(FailureStage::ALL.map(|stage| stage.name().to_owned()));
        rows.push(heading);
        for cell in &self.cells {
            let [low, high] = cell.wilson95().map(|bound| 100.0 * bound);
            let mut row = vec![
                cell.object.clone(),
                cell.robots.join(" + "),
                cell.order.name().to_owned(),
                cell.method.title().to_owned(),
                format!("{}/{}", cell.successes, cell.trials()),
                format!("{:.1}", 100.0 * cell.rate()),
                format!("{low:.1} to {high:.1}"),
            ];
            row.extend(FailureStage::ALL.map(|stage| match cell.failures(stage) {
                0 => "·".to_owned(),
                count => count.to_string(),
            }));
            rows.push(row);
        }
        let goals = self.goals().map_or_else(String::new, |counts| counts.sentence() + "\n");
        let compared = significance::table(&self.comparisons);
        let gap = if compared.is_empty() { "" } else { "\n" };
        aligned(&rows, 4) + &goals + gap + &compared
    }
}

/// Rows as text: the first `left` columns flush left, the others right; a rule under the first row.
pub(crate) fn aligned(rows: &[Vec<String>], left: usize) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for (index, row) in rows.iter().enumerate() {
        let mut line = String::new();
        for (column, (entry, &width)) in row.iter().zip(&widths).enumerate() {
            let gap = if column == 0 { "" } else { "  " };
            let entry = if column < left { format!("{entry:<width$}") } else { format!("{entry:>width$}") };
            line += gap;
            line += &entry;
        }
        text += line.trim_end();
        text.push('\n');
        if index == 0 {
            text += &"─".repeat(widths.iter().sum::<usize>() + 2 * (columns - 1));
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_intervals_are_the_published_ones() {
        // 81/263 and 15/148, 0/20, 1/29 without continuity correction: Newcombe, Stat. Med. 17 (1998), Table I.
        for (successes, trials, expected) in [
            (81, 263, [0.2553, 0.3662]),
            (15, 148, [0.0624, 0.1605]),
            (0, 20, [0.0, 0.1611]),
            (1, 29, [0.0061, 0.1718]),
            (40, 50, [0.6696, 0.8876]),
            (430, 500, [0.8268, 0.8877]),
        ] {
            let found = wilson95(successes, trials);
            for side in 0..2 {
                assert!((found[side] - expected[side]).abs() < 6e-5, "{successes}/{trials}: {found:?}");
            }
        }
        assert_eq!(wilson95(0, 0), [0.0, 1.0]);
        assert_eq!(wilson95(7, 7)[1], 1.0);
    }

    #[test]
    fn the_bounds_solve_the_score_equation() {
        for (successes, trials) in [(1, 3), (17, 40), (39, 40), (499, 1000)] {
            let p = successes as f64 / trials as f64;
            for bound in wilson95(successes, trials) {
                let score = (p - bound).abs() / (bound * (1.0 - bound) / trials as f64).sqrt();
                assert!((score - 1.959_963_984_540_054).abs() < 1e-9, "{successes}/{trials}: {score}");
            }
        }
    }

    fn cell() -> Cell {
        let mut outcomes = vec![TrialOutcome::Success; 34];
        outcomes.extend([TrialOutcome::Failed(FailureStage::Slip); 4]);
        outcomes.extend([TrialOutcome::Failed(FailureStage::NoPlan); 2]);
        Cell::new("pliers", &["panda".into(), "panda".into()], GraspOrder::Sequential, Method::Vmao, outcomes)
    }

    #[test]
    fn a_cell_is_written_as_documented_and_reads_back() {
        let json = serde_json::to_value(cell()).unwrap();
        let failures = r#"{"no-contact":0,"unreachable":0,"no-plan":2,"collision":0,"slip":4,"threshold":0,"timeout":0}"#;
        assert_eq!(json["failures"], serde_json::from_str::<serde_json::Value>(failures).unwrap());
        assert_eq!((json["trials"].as_u64(), json["rate"].as_f64()), (Some(40), Some(0.85)));
        assert_eq!((json["order"].as_str(), json["method"].as_str()), (Some("sequential"), Some("vmao")));
        assert_eq!(serde_json::from_value::<Cell>(json).unwrap(), cell());
    }

    fn goals() -> Vec<GoalReach> {
        let said = |reachability| GoalReach { reachability, redraws: 0 };
        let mut goals = vec![said(Reachability::Reachable); 37];
        goals.extend([said(Reachability::Unreachable), said(Reachability::Unreachable), said(Reachability::Unknown)]);
        goals
    }

    #[test]
    fn goals_are_counted_written_and_told() {
        let cell = cell().with_goals(goals());
        let counts = GoalCounts { reachable: 37, unreachable: 2, unknown: 1, redraws: 0 };
        assert_eq!(cell.goals(), Some(counts));
        assert_eq!(counts.sentence(), "goals proven out of reach: 2 of 40, undecided: 1");
        assert_eq!(
            GoalCounts { unknown: 0, redraws: 7, ..counts }.sentence(),
            "goals proven out of reach: 2 of 39, drawn anew: 7"
        );
        let json = serde_json::to_value(&cell).unwrap();
        assert_eq!(json["goals"]["unreachable"], 2);
        assert_eq!(serde_json::from_value::<Cell>(json).unwrap(), cell);
    }

    #[test]
    fn counts_that_do_not_add_up_are_refused() {
        let mut json = serde_json::to_value(cell().with_goals(goals())).unwrap();
        json["goals"]["unknown"] = u64::MAX.into();
        assert!(serde_json::from_value::<Cell>(json).unwrap_err().to_string().contains("expected 40 in all"));
        for (field, value) in [("trials", 41.into()), ("successes", u64::MAX.into()), ("rate", 0.9.into())] {
            let mut json = serde_json::to_value(cell()).unwrap();
            json[field] = value;
            assert!(serde_json::from_value::<Cell>(json).unwrap_err().to_string().contains("expected"), "{field}");
        }
    }

    #[test]
    fn the_table_lines_up() {
        let other = Cell::new("sticks-10", &["sawyer".into()], GraspOrder::Parallel, Method::Top1, []);
        let (version, commit, config_sha256) = (String::new(), String::new(), String::new());
        let results =
            Results { schema: 1, version, commit, config_sha256, seed: 0, cells: vec![cell(), other], comparisons: Vec::new() };
        let expected = "\
object     robots         order       method  success  rate %  95 % interval  no-contact  unreachable  no-plan  collision  slip  threshold  timeout
───────────────────────────────────────────────────────────────────────────────────────────────────────────────────────────────────────────────────
pliers     panda + panda  sequential  V-MAO     34/40    85.0   70.9 to 92.9           ·            ·        2          ·     4          ·        ·
sticks-10  sawyer         parallel    Top-1       0/0     0.0   0.0 to 100.0           ·            ·        ·          ·     ·          ·        ·
";
        assert_eq!(results.table(), expected);
    }
}
