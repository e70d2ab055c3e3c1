//! The repair report: what was put right on the way from a file to an object that can be simulated.

use serde::Serialize;

/// The most repairs of one kind that are told one by one.
const MOST_OF_A_KIND: usize = 40;

/// What kind of thing was put right; docs/import.md explains each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Quirk {
    /// A limit without the effort and velocity that the URDF standard asks for.
    IncompleteLimit,
    /// A link without shape between two joints.
    HelperLink,
    /// A mass that is missing or absurd.
    Mass,
    /// A size that is not in metres.
    Size,
    /// An up axis that is not z.
    UpAxis,
    /// A place that is not on the table.
    Place,
    /// A root that is fixed to the world.
    FixedToWorld,
    /// A joint that does not move.
    FixedJoint,
    /// Limits that are missing, empty or not finite.
    Limits,
    /// Limits that do not hold zero.
    ZeroOutsideLimits,
    /// Names that are missing, used twice, or not usable everywhere.
    Name,
    /// A shape that is not convex.
    NotConvex,
    /// A mesh that is flat or has too few vertices.
    FlatMesh,
    /// A mesh with faces that enclose nothing, or vertices that no face uses.
    BrokenMesh,
    /// A colour or texture that the simulator does not read.
    Colour,
    /// A texture in a format that the simulator does not read.
    Texture,
    /// A path in a form that only some programs understand.
    Path,
    /// Parts that overlap and are not neighbours.
    Overlap,
    /// An axis that is missing or not of unit length.
    Axis,
    /// Friction or damping that is missing or absurd.
    Resistance,
    /// More hulls or vertices than a simulation needs.
    Count,
    /// Something that an object has no place for.
    Ignored,
}

/// Something that was put right.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Repair {
    /// Its kind.
    pub quirk: Quirk,
    /// Where: a link, joint or file; empty for the whole object.
    pub subject: String,
    /// What was found, and what was done.
    pub what: String,
}

/// All that was put right, in the order in which it was found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Repairs {
    list: Vec<Repair>,
    /// By kind: how many more than are told.
    untold: std::collections::BTreeMap<Quirk, usize>,
}

impl Repairs {
    /// Adds one.
    pub fn add(&mut self, quirk: Quirk, subject: &str, what: impl Into<String>) {
        if self.list.iter().filter(|repair| repair.quirk == quirk).count() >= MOST_OF_A_KIND {
            *self.untold.entry(quirk).or_default() += 1;
            return;
        }
        // Subjects and reasons may quote hostile files: short, and nothing that spoils a terminal.
        let subject = vmao_core::wording::quoted(subject).trim_matches('`').to_owned();
        self.list.push(Repair { quirk, subject, what: what.into() });
    }

    /// Adds all of `other`.
    pub fn extend(&mut self, other: Self) {
        for repair in other.list {
            self.add(repair.quirk, &repair.subject, repair.what);
        }
        for (quirk, count) in other.untold {
            *self.untold.entry(quirk).or_default() += count;
        }
    }

    /// The report.
    pub fn into_list(self) -> Vec<Repair> {
        let mut list = self.list;
        let more = |(quirk, count)| Repair { quirk, subject: String::new(), what: format!("{count} more of this kind") };
        list.extend(self.untold.into_iter().map(more));
        list
    }
}
