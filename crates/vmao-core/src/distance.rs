//! Signed distance between solids.
//!
//! Every solid is a core grown by a radius. The core of a primitive is a zonotope (centre plus generators): a ball has no
//! generator, a capsule one, a box three, a cylinder the seven of the 12-sided prism around it; a convex hull is its own.
//! The difference of two cores is the sum of all their generators and hulls, so one routine serves all pairs:
//! separating axes give the depth when the cores overlap, the Gilbert-Johnson-Keerthi (1988) iteration gives the distance
//! when they do not.

mod difference;

use crate::{convex_hull::ConvexHull, geometry::Pose, shape::Shape};
use difference::Difference;
use nalgebra::{Matrix3, Vector3};

/// Most generators of one solid: the prism around a cylinder.
const MAX_GENERATORS: usize = 7;
/// Half the number of sides of the prism around a cylinder; it sticks out by 1/cos(π/12) − 1 = 3.5 % of the radius.
const PRISM_GENERATORS: usize = 6;

/// How near two solids are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Nearness {
    /// At least as far apart as asked for.
    Clear,
    /// In between.
    Near,
    /// Closer than the margin.
    Hit,
}

/// A convex solid: { centre + Σ aᵢ gᵢ, |aᵢ| ≤ 1 } or a hull, grown by a radius (m).
#[derive(Debug, Clone)]
pub struct Convex {
    center: Vector3<f64>,
    generators: [Vector3<f64>; MAX_GENERATORS],
    count: usize,
    radius: f64,
    bound: f64,
    /// The capsule around the solid: half its axis (m) and its radius (m).
    spine: Vector3<f64>,
    girth: f64,
    /// Lengths of a box's generators (m).
    lengths: [f64; BOX],
    /// A hull, which has no generators.
    hull: Option<PlacedHull>,
}

/// A hull whose capsule's middle lies at the centre of its [`Convex`].
#[derive(Debug, Clone)]
struct PlacedHull {
    hull: ConvexHull,
    rotation: Matrix3<f64>,
}

impl PlacedHull {
    /// The vertex furthest along `direction`, from the centre (m).
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let local = self.rotation.tr_mul(direction);
        self.rotation * (self.hull.support(&local).coords - self.hull.capsule().middle)
    }

    /// Least and greatest reach from the centre along `direction` (m times its length).
    fn range(&self, direction: &Vector3<f64>) -> (f64, f64) {
        let local = self.rotation.tr_mul(direction);
        let middle = self.hull.capsule().middle.dot(&local);
        let along = self.hull.vertices().iter().map(|vertex| vertex.coords.dot(&local) - middle);
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    }
}

/// Number of generators of a box; no other solid has as many.
const BOX: usize = 3;

impl Convex {
    /// The solid of `shape` with its own frame at `frame_from_shape`; cylinders become the 12-sided prism around them.
    pub fn new(shape: &Shape, frame_from_shape: &Pose) -> Self {
        let mut local = Self {
            center: Vector3::zeros(),
            generators: [Vector3::zeros(); MAX_GENERATORS],
            count: 0,
            radius: 0.0,
            bound: 0.0,
            spine: Vector3::zeros(),
            girth: 0.0,
            lengths: [0.0; BOX],
            hull: None,
        };
        match *shape {
            Shape::Sphere { radius } => (local.radius, local.girth) = (radius, radius),
            Shape::Capsule { radius, half_length } => {
                (local.radius, local.girth) = (radius, radius);
                local.spine = Vector3::z() * half_length;
                local.push(Vector3::z() * half_length);
            }
            Shape::Cylinder { radius, half_length } => {
                let angle = std::f64::consts::PI / PRISM_GENERATORS as f64;
                for side in 0..PRISM_GENERATORS {
                    let (sine, cosine) = (angle * side as f64).sin_cos();
                    local.push(Vector3::new(cosine, sine, 0.0) * (radius * (angle / 2.0).tan()));
                }
                local.push(Vector3::z() * half_length);
                (local.spine, local.girth) = (Vector3::z() * half_length, radius / (angle / 2.0).cos());
                local.bound = half_length.hypot(radius / (angle / 2.0).cos());
            }
            Shape::Box { half_extents: [x, y, z] } => {
                local.push(Vector3::x() * x);
                local.push(Vector3::y() * y);
                local.push(Vector3::z() * z);
                (local.bound, local.lengths) = (Vector3::new(x, y, z).norm(), [x, y, z]);
                let longest = local.generators[..local.count].iter().copied().max_by(|a, b| a.norm().total_cmp(&b.norm()));
                local.spine = longest.unwrap_or_default();
                local.girth = (local.bound * local.bound - local.spine.norm_squared()).max(0.0).sqrt();
            }
            Shape::Convex(ref hull) => {
                let capsule = hull.capsule();
                (local.center, local.spine) = (capsule.middle, capsule.spine);
                (local.girth, local.bound) = (capsule.girth, capsule.bound);
                local.hull = Some(PlacedHull { hull: hull.clone(), rotation: Matrix3::identity() });
            }
        }
        if local.bound == 0.0 {
            local.bound = local.generators[..local.count].iter().map(Vector3::norm).sum::<f64>() + local.radius;
        }
        let mut placed = local.clone();
        placed.place(&local, frame_from_shape.rotation.to_rotation_matrix().matrix(), &frame_from_shape.translation.vector);
        placed
    }

    /// Makes this `local` seen from a frame in which local's own frame has this `rotation` and `origin`.
    ///
    /// Both must come from the same shape: only what the motion changes is written.
    pub fn place(&mut self, local: &Self, rotation: &Matrix3<f64>, origin: &Vector3<f64>) {
        self.center = rotation * local.center + origin;
        for (to, from) in self.generators.iter_mut().zip(&local.generators).take(local.count) {
            *to = rotation * from;
        }
        self.spine = rotation * local.spine;
        if let (Some(to), Some(from)) = (&mut self.hull, &local.hull) {
            to.rotation = rotation * from.rotation;
        }
    }

    /// Radius of a ball around the centre that holds the whole solid (m).
    pub fn bound(&self) -> f64 {
        self.bound
    }

    /// Centre of symmetry, or of the capsule around a hull (m).
    pub fn center(&self) -> &Vector3<f64> {
        &self.center
    }

    /// Signed distance to the half-space z ≤ `height`, negative when inside (m).
    pub fn height_above(&self, height: f64) -> f64 {
        self.center.z - self.reach(&-Vector3::z()) - self.radius - height
    }

    /// Signed distance between two solids (m): negative is the shortest translation that separates them.
    pub fn signed_distance(&self, other: &Self) -> f64 {
        let radius = self.radius + other.radius;
        if self.is_segment() && other.is_segment() {
            let offset = self.center - other.center;
            return segment_distance(&offset, &self.spine, &other.spine) - radius;
        }
        Difference::new(self, other).signed_distance() - radius
    }

    /// Whether the two solids come closer than `margin` (m); cheaper than the distance.
    pub fn closer_than(&self, other: &Self, margin: f64) -> bool {
        let reach = self.bound + other.bound + margin;
        if reach <= 0.0 || (self.center - other.center).norm_squared() >= reach * reach {
            return false;
        }
        let cores = margin + self.radius + other.radius;
        if cores <= 0.0 { self.signed_distance(other) < margin } else { self.gap(other, margin) < margin }
    }

    /// The distance of the solids if it is less than `enough` (m), otherwise anything that is not less.
    ///
    /// Where the cores inside the radii meet it is minus both radii, however deep. `enough` must be more than that.
    fn gap(&self, other: &Self, enough: f64) -> f64 {
        match self.rough_gap(other, enough) {
            Ok(gap) => gap,
            Err(least) if least >= enough => least,
            Err(_) => self.fine_gap(other, enough),
        }
    }

    /// Whether the solids are closer than `margin` (m, > 0), at least `enough` apart, or in between.
    ///
    /// While `enough` is large, solids that are not closer than `margin` may count as in between though they are further.
    pub(crate) fn nearness(&self, other: &Self, margin: f64, enough: f64) -> Nearness {
        const LARGE: f64 = 0.05; // m; not worth the iteration, a shorter interval will ask again
        let gap = match self.rough_gap(other, enough) {
            Ok(gap) => gap,
            Err(least) if least >= enough || (least >= margin && enough > LARGE) => least,
            Err(_) => self.fine_gap(other, enough),
        };
        match gap {
            _ if gap >= enough => Nearness::Clear,
            _ if gap >= margin => Nearness::Near,
            _ => Nearness::Hit,
        }
    }

    /// The gap from capsules around both solids or around one beside a box; the error is a lower bound of it.
    fn rough_gap(&self, other: &Self, enough: f64) -> Result<f64, f64> {
        let offset = self.center - other.center;
        let (a_is_box, b_is_box) = (self.count == BOX, other.count == BOX);
        let gap = match (a_is_box, b_is_box) {
            (false, false) => segment_distance(&offset, &self.spine, &other.spine) - self.girth - other.girth,
            (true, _) if !b_is_box || self.bound >= other.bound => {
                self.box_to_segment(&-offset, &other.spine, enough + other.girth) - other.girth
            }
            _ => other.box_to_segment(&offset, &self.spine, enough + self.girth) - self.girth,
        };
        let exact = (self.is_segment() || a_is_box) && (other.is_segment() || b_is_box) && !(a_is_box && b_is_box);
        if exact { Ok(gap) } else { Err(gap) }
    }

    fn fine_gap(&self, other: &Self, enough: f64) -> f64 {
        let radius = self.radius + other.radius;
        if self.faces_separate(other, enough + radius) || other.faces_separate(self, enough + radius) {
            return enough;
        }
        Difference::new(self, other).distance(enough + radius) - radius
    }

    /// Whether a face of this box shows that the cores are at least `cores` apart (m); never for other solids.
    fn faces_separate(&self, other: &Self, cores: f64) -> bool {
        let offset = self.center - other.center;
        self.count == BOX
            && self.generators[..BOX].iter().zip(self.lengths).any(|(normal, length)| {
                let along = offset.dot(normal);
                let reach = other.reach(&if along < 0.0 { -normal } else { *normal });
                along.abs() - reach >= (cores + length) * length
            })
    }

    /// Distance from this box to the segment `middle` ± `half` (m; from its centre) if less than `enough`; 0 if they meet.
    ///
    /// Half the square's derivative along the segment is piecewise linear and never falls: its zero lies between the last
    /// bend or end where it is negative and the first where it is not.
    fn box_to_segment(&self, middle: &Vector3<f64>, half: &Vector3<f64>, enough: f64) -> f64 {
        let lengths = &self.lengths;
        let (mut m, mut d) = ([0.0; BOX], [0.0; BOX]);
        for axis in 0..BOX {
            m[axis] = middle.dot(&self.generators[axis]) / lengths[axis];
            d[axis] = half.dot(&self.generators[axis]) / lengths[axis];
            let beyond = m[axis].abs() - d[axis].abs() - lengths[axis];
            if beyond >= enough {
                return beyond;
            }
        }
        let outside = |axis: usize, t: f64| {
            let x = m[axis] + d[axis] * t;
            x - x.clamp(-lengths[axis], lengths[axis])
        };
        let slope = |t: f64| (0..BOX).map(|axis| d[axis] * outside(axis, t)).sum::<f64>();
        let distance = |t: f64| (0..BOX).map(|axis| outside(axis, t).powi(2)).sum::<f64>().sqrt();
        let (mut low, mut high) = ((-1.0, slope(-1.0)), (1.0, slope(1.0)));
        if low.1 >= 0.0 {
            return distance(-1.0);
        }
        if high.1 <= 0.0 {
            return distance(1.0);
        }
        for axis in 0..BOX {
            for face in [-lengths[axis], lengths[axis]] {
                let t = (face - m[axis]) / d[axis]; // infinite or NaN along the face: no bend
                if t > low.0 && t < high.0 {
                    let at = (t, slope(t));
                    if at.1 < 0.0 { low = at } else { high = at }
                }
            }
        }
        distance(low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1))
    }

    fn push(&mut self, generator: Vector3<f64>) {
        if generator != Vector3::zeros() {
            self.generators[self.count] = generator;
            self.count += 1;
        }
    }

    /// Whether the core is a point or a line.
    fn is_segment(&self) -> bool {
        self.count <= 1 && self.hull.is_none()
    }

    /// How far the core reaches from the centre along `direction` (m times its length).
    fn reach(&self, direction: &Vector3<f64>) -> f64 {
        let generators: f64 = self.generators[..self.count].iter().map(|g| g.dot(direction).abs()).sum();
        self.hull.as_ref().map_or(generators, |hull| generators + hull.range(direction).1)
    }
}

/// Distance between two segments (or points) { ±g } and { ±h } whose middles are `offset` apart (m).
///
/// The least of the interior pair and the four ends against the other.
fn segment_distance(offset: &Vector3<f64>, g: &Vector3<f64>, h: &Vector3<f64>) -> f64 {
    let (gg, hh, gh) = (g.norm_squared(), h.norm_squared(), g.dot(h));
    let (og, oh) = (offset.dot(g), offset.dot(h));
    let determinant = gg * hh - gh * gh;
    if determinant > 1e-14 * gg * hh {
        let s = (gh * oh - hh * og) / determinant;
        let t = (gg * oh - gh * og) / determinant;
        if s.abs() <= 1.0 && t.abs() <= 1.0 {
            return (offset + g * s - h * t).norm();
        }
    }
    let best = |fixed: Vector3<f64>, along: &Vector3<f64>, square: f64| {
        let t = if square > 0.0 { (fixed.dot(along) / square).clamp(-1.0, 1.0) } else { 0.0 };
        (fixed - along * t).norm_squared()
    };
    let ends = [best(offset + g, h, hh), best(offset - g, h, hh), best(-offset + h, g, gg), best(-offset - h, g, gg)];
    ends.into_iter().fold(f64::INFINITY, f64::min).sqrt()
}
