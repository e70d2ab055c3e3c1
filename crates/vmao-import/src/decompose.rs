//! Convex decomposition of a part's collision meshes: hulls that are there already, or V-HACD (Mamou 2016, through parry).

use crate::{
    hull::{Hull, Thickness, around, contained},
    mesh::{Mesh, area_vector},
};
use nalgebra::{Point3, Vector3};
use parry3d_f64::{
    math::Vector,
    transformation::vhacd::{VHACD, VHACDParameters},
};
use std::collections::BTreeMap;

/// Voxels along the longest edge; the most for which a part takes about a second.
pub const RESOLUTION: u32 = 64;
/// How concave a piece may stay, as a share of the whole's volume; parry's default.
pub const CONCAVITY: f64 = 0.01;

/// What decomposition made of a part.
#[derive(Debug, Clone, PartialEq)]
pub struct Decomposition {
    /// Its hulls, at least one.
    pub hulls: Vec<Hull>,
    /// How many of them are thin boxes in place of something flat.
    pub thickened: usize,
    /// Whether the shapes were convex to begin with.
    pub convex: bool,
}

/// A triangle soup with welded vertices, brought to the unit cube, and the way back.
#[derive(Debug, Clone, PartialEq)]
pub struct Soup {
    /// Vertices in [-1, 1].
    pub vertices: Vec<Point3<f64>>,
    /// Triangles with an area.
    pub triangles: Vec<[u32; 3]>,
    center: Point3<f64>,
    scale: f64,
}

impl Soup {
    /// All triangles of the meshes; none if there is not one with an area.
    pub fn of<'a>(meshes: impl IntoIterator<Item = (&'a Mesh, Option<u32>)>) -> Option<Self> {
        let mut corners: Vec<Point3<f64>> = Vec::new();
        for (mesh, group) in meshes {
            let faces = mesh.faces.iter().filter(|face| group.is_none_or(|group| face.group == group));
            corners.extend(faces.flat_map(|face| mesh.triangle(face)));
        }
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = Vector3::repeat(f64::NEG_INFINITY);
        for corner in &corners {
            low = low.inf(&corner.coords);
            high = high.sup(&corner.coords);
        }
        let scale = (high - low).max() / 2.0;
        if !(scale.is_finite() && scale > 1e-9) {
            return None;
        }
        let center = Point3::from((low + high) / 2.0);
        let mut vertices = Vec::new();
        let mut known: BTreeMap<[i64; 3], u32> = BTreeMap::new();
        let mut index = |corner: &Point3<f64>| {
            let unit = Point3::from((corner - center) / scale);
            // A millionth of the extent apart is the same vertex.
            let key = [unit.x, unit.y, unit.z].map(|x| (x * 1e6).round() as i64);
            *known.entry(key).or_insert_with(|| {
                vertices.push(unit);
                vertices.len() as u32 - 1
            })
        };
        let indexed: Vec<[u32; 3]> =
            corners.chunks_exact(3).map(|face| [index(&face[0]), index(&face[1]), index(&face[2])]).collect();
        let triangle = |face: &[u32; 3]| face.map(|corner| vertices[corner as usize]);
        let triangles: Vec<[u32; 3]> = indexed.into_iter().filter(|face| area_vector(&triangle(face)).norm() > 1e-12).collect();
        (!triangles.is_empty()).then_some(Self { vertices, triangles, center, scale })
    }

    fn back(&self, hull: &Hull) -> Hull {
        hull.mapped(|vertex| self.center + vertex.coords * self.scale)
    }

    fn triangle(&self, face: &[u32; 3]) -> [Point3<f64>; 3] {
        face.map(|corner| self.vertices[corner as usize])
    }

    /// Its hull, if it is the surface of it: every triangle on the hull's surface, and all of that surface covered.
    fn own_hull(&self) -> Option<Hull> {
        let (hull, thickness) = around(&self.vertices)?;
        let planes: Vec<_> = hull.planes().collect();
        let depth = |point: &Point3<f64>| planes.iter().map(|(n, d)| n.dot(&point.coords) - d).fold(f64::NEG_INFINITY, f64::max);
        // Corners and middle on the surface, up to what leaving out vertices takes away.
        let near = |point: &Point3<f64>| depth(point).abs() < 0.01;
        let on_surface = |face: &[u32; 3]| {
            let corners = self.triangle(face);
            corners.iter().all(near) && near(&Point3::from((corners[0].coords + corners[1].coords + corners[2].coords) / 3.0))
        };
        let area: f64 = self.triangles.iter().map(|face| area_vector(&self.triangle(face)).norm() / 2.0).sum();
        let covered = area > 0.95 * hull.area() && area < 1.05 * hull.area();
        (thickness == Thickness::Own && covered && self.triangles.iter().all(on_surface)).then_some(hull)
    }
}

/// Decomposes the meshes of one part into at most `most` hulls; none if nothing has an extent.
///
/// `stored` answers for a soup that was decomposed before, and keeps what is new.
pub fn decompose(
    meshes: &[&Mesh],
    most: usize,
    stored: impl FnOnce(&Soup, &dyn Fn(&Soup) -> Vec<Hull>) -> Vec<Hull>,
) -> Option<Decomposition> {
    if let Some(hulls) = already_convex(meshes).filter(|hulls| hulls.len() <= most) {
        return Some(Decomposition { hulls, thickened: 0, convex: true });
    }
    let corners = || meshes.iter().flat_map(|mesh| mesh.faces.iter().flat_map(|face| mesh.triangle(face))).collect::<Vec<_>>();
    let whole = |hull: Hull, thickness| Decomposition {
        hulls: vec![hull],
        thickened: usize::from(thickness == Thickness::Given),
        convex: false,
    };
    let Some(soup) = Soup::of(meshes.iter().map(|mesh| (*mesh, None))) else {
        return around(&corners()).map(|(hull, thickness)| whole(hull, thickness));
    };
    // Something flat encloses no voxels.
    if let Some((hull, Thickness::Given)) = around(&corners()) {
        return Some(whole(hull, Thickness::Given));
    }
    let pieces = stored(&soup, &|soup| vhacd(soup, most));
    let mut hulls = Vec::new();
    let mut thickened = 0;
    for piece in &pieces {
        if let Some((hull, thickness)) = around(&piece.vertices) {
            thickened += usize::from(thickness == Thickness::Given);
            hulls.push(soup.back(&hull));
        }
    }
    if hulls.is_empty() {
        return around(&corners()).map(|(hull, thickness)| whole(hull, thickness));
    }
    Some(Decomposition { hulls, thickened, convex: false })
}

/// One hull for each group of each mesh, if all groups are convex.
fn already_convex(meshes: &[&Mesh]) -> Option<Vec<Hull>> {
    let mut hulls = Vec::new();
    for mesh in meshes {
        let mut groups: Vec<u32> = mesh.faces.iter().map(|face| face.group).collect();
        groups.sort_unstable();
        groups.dedup();
        for group in groups {
            if hulls.len() > crate::description::MAX_LINKS {
                return None;
            }
            let soup = Soup::of([(*mesh, Some(group))])?;
            hulls.push(soup.back(&soup.own_hull()?));
        }
    }
    Some(hulls)
}

/// V-HACD at the unit's scale; one hull around all where it fails.
fn vhacd(soup: &Soup, most: usize) -> Vec<Hull> {
    let points: Vec<Vector> = soup.vertices.iter().map(|point| Vector::new(point.x, point.y, point.z)).collect();
    let parameters = VHACDParameters {
        resolution: RESOLUTION,
        concavity: CONCAVITY,
        max_convex_hulls: most as u32,
        ..VHACDParameters::default()
    };
    let pieces = contained(|| {
        let decomposition = VHACD::decompose(&parameters, &points, &soup.triangles, true);
        decomposition.compute_exact_convex_hulls(&points, &soup.triangles)
    });
    let hull = |(vertices, _): (Vec<Vector>, Vec<[u32; 3]>)| {
        let points: Vec<Point3<f64>> = vertices.iter().map(|point| Point3::new(point.x, point.y, point.z)).collect();
        around(&points).map(|(hull, _)| hull)
    };
    let mut hulls: Vec<Hull> = pieces.unwrap_or_default().into_iter().filter_map(hull).collect();
    // V-HACD splits in two at a time and may end above the number asked for; the smallest pieces go.
    hulls.sort_by(|a, b| b.volume().total_cmp(&a.volume()));
    hulls.truncate(most);
    if hulls.is_empty() { around(&soup.vertices).map(|(hull, _)| hull).into_iter().collect() } else { hulls }
}
