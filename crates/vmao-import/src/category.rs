//! How large, heavy and stiff things of a kind are: for files that do not say.

/// A kind of thing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Category {
    /// PartNet-Mobility's name of it.
    pub name: &'static str,
    /// Its longest edge (m); ours, from everyday things.
    pub length: f64,
    /// Its mass at that size (kg); ours, likewise.
    pub mass: f64,
    /// How stiffly its joints turn.
    pub turning: Resistance,
}

/// Viscous damping (N·m·s/rad or N·s/m) and dry friction (N·m or N).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resistance {
    /// Viscous damping.
    pub damping: f64,
    /// Dry friction.
    pub friction: f64,
}

/// Of a pivot that a hand turns: the catalogue's pliers.
pub const PIVOT: Resistance = Resistance { damping: 0.01, friction: 0.03 };
/// Of a lid that stays where it is left: the catalogue's laptop.
pub const LID: Resistance = Resistance { damping: 0.02, friction: 0.08 };
/// Of something that slides: the catalogue's drawer.
pub const SLIDE: Resistance = Resistance { damping: 3.0, friction: 0.7 };
/// Of a ball in its socket; ours, between the two.
pub const BALL: Resistance = Resistance { damping: 0.005, friction: 0.01 };

/// The kinds that are known.
const CATEGORIES: [Category; 19] = [
    kind("Bottle", 0.25, 0.30, PIVOT),
    kind("Box", 0.25, 0.40, LID),
    kind("Bucket", 0.28, 0.50, PIVOT),
    kind("Dispenser", 0.20, 0.25, PIVOT),
    kind("Eyeglasses", 0.15, 0.04, PIVOT),
    kind("FoldingChair", 0.30, 0.50, LID),
    kind("Globe", 0.28, 0.60, PIVOT),
    kind("Kettle", 0.22, 0.60, PIVOT),
    kind("KitchenPot", 0.25, 0.70, PIVOT),
    kind("Knife", 0.20, 0.12, PIVOT),
    kind("Laptop", 0.33, 1.50, LID),
    kind("Lighter", 0.08, 0.05, PIVOT),
    kind("Pen", 0.14, 0.02, PIVOT),
    kind("Phone", 0.15, 0.20, PIVOT),
    kind("Pliers", 0.20, 0.25, PIVOT),
    kind("Scissors", 0.20, 0.10, PIVOT),
    kind("Stapler", 0.15, 0.20, PIVOT),
    kind("Suitcase", 0.30, 1.00, LID),
    kind("USB", 0.07, 0.03, PIVOT),
];

/// What everything else is taken for: as long as the catalogue's objects, as dense as household plastic with air in it.
pub const UNKNOWN_LENGTH: f64 = 0.25;
/// Mass of what has no category (kg/m³ of its solids).
pub const UNKNOWN_DENSITY: f64 = 400.0;
/// No density of a file is believed outside these (kg/m³): balsa wood to lead.
pub const DENSITIES: [f64; 2] = [10.0, 12_000.0];

const fn kind(name: &'static str, length: f64, mass: f64, turning: Resistance) -> Category {
    Category { name, length, mass, turning }
}

/// The category of this name, whatever its case.
pub fn named(name: &str) -> Option<Category> {
    CATEGORIES.into_iter().find(|category| category.name.eq_ignore_ascii_case(name))
}
