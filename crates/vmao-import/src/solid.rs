//! What a part collides with: primitives as they are, everything else as convex hulls.

use crate::{
    description::Form,
    hull::{Hull, Thickness, around},
    mesh::{GREY, Material, tessellated},
};
use nalgebra::{Point3, Vector3};
use vmao_core::{
    convex_hull::ConvexHull,
    geometry::Pose,
    shape::{Shape, Solid},
};

/// A convex solid in the object's frame.
#[derive(Debug, Clone)]
pub(crate) struct SolidDraft {
    /// A primitive that core knows, and where it is; none for a hull.
    pub(crate) primitive: Option<(Shape, Pose)>,
    /// Its hull; of a primitive, inscribed.
    pub(crate) hull: Hull,
    /// Red, green, blue.
    pub(crate) color: [f32; 3],
}

const NO_COLOR: [f32; 3] = [GREY[0], GREY[1], GREY[2]];

impl SolidDraft {
    /// A hull.
    pub(crate) fn of_hull(hull: Hull) -> Self {
        Self { primitive: None, hull, color: NO_COLOR }
    }

    /// A primitive that core has a word for; none for others.
    pub(crate) fn of_form(form: &Form, object_from_form: &Pose) -> Option<Self> {
        let shape = match *form {
            Form::Box { half_extents } => Shape::Box { half_extents },
            Form::Cylinder { radius, half_length } => Shape::Cylinder { radius, half_length },
            Form::Capsule { radius, half_length } => Shape::Capsule { radius, half_length },
            Form::Ellipsoid { radii: [x, y, z] } if x == y && y == z => Shape::Sphere { radius: x },
            Form::Ellipsoid { .. } | Form::Mesh { .. } => return None,
        };
        let mesh = tessellated(form, Material::plain("", GREY))?;
        let vertices: Vec<Point3<f64>> = mesh.vertices.iter().map(|vertex| object_from_form * vertex).collect();
        match around(&vertices)? {
            (hull, Thickness::Own) => Some(Self { primitive: Some((shape, *object_from_form)), hull, color: NO_COLOR }),
            // A sheet is better off as what it is made of: a box with a thickness.
            (hull, Thickness::Given) => Some(Self::of_hull(hull)),
        }
    }

    /// Its volume (m³).
    pub(crate) fn volume(&self) -> f64 {
        self.primitive.as_ref().map_or_else(|| self.hull.volume(), |(shape, _)| shape.volume())
    }

    /// Least and greatest extent along a unit direction.
    pub(crate) fn extent(&self, direction: &Vector3<f64>) -> [f64; 2] {
        let Some((shape, pose)) = &self.primitive else { return self.hull.extent(direction) };
        let reach = shape.extent_along(&pose.inverse_transform_vector(direction));
        let middle = pose.translation.vector.dot(direction);
        [middle - reach, middle + reach]
    }

    /// The same, about the origin made `factor` times as large, then moved.
    #[must_use]
    pub(crate) fn scaled(&self, factor: f64, moved: &Vector3<f64>) -> Self {
        let place = |point: &Point3<f64>| Point3::from(point.coords * factor + moved);
        let primitive = self.primitive.as_ref().map(|(shape, pose)| {
            let translation = pose.translation.vector * factor + moved;
            (scaled_shape(shape, factor), Pose::from_parts(translation.into(), pose.rotation))
        });
        Self { primitive, hull: self.hull.mapped(place), color: self.color }
    }

    /// What is left of it where `normal · x <= offset`.
    pub(crate) fn cut(&self, normal: &Vector3<f64>, offset: f64) -> Option<Self> {
        let [_, high] = self.hull.extent(normal);
        if high <= offset {
            return Some(self.clone());
        }
        self.hull.cut(normal, offset).map(|hull| Self { primitive: None, hull, color: self.color })
    }

    /// As core has it; fails if core does not take its hull.
    pub(crate) fn to_core(&self) -> Result<Solid, String> {
        let (shape, carrier_from_solid) = match &self.primitive {
            Some((shape, pose)) => (shape.clone(), *pose),
            None => {
                let count = self.hull.vertices.len().max(1) as f64;
                let middle = self.hull.vertices.iter().map(|vertex| vertex.coords).sum::<Vector3<f64>>() / count;
                let about = self.hull.mapped(|vertex| vertex - middle);
                let hull = ConvexHull::new(about.vertices, about.faces).map_err(|error| error.to_string())?;
                (Shape::Convex(hull), Pose::from_parts(middle.into(), nalgebra::UnitQuaternion::identity()))
            }
        };
        Ok(Solid { shape, carrier_from_solid, color: self.color })
    }
}

fn scaled_shape(shape: &Shape, factor: f64) -> Shape {
    match shape {
        Shape::Sphere { radius } => Shape::Sphere { radius: radius * factor },
        Shape::Capsule { radius, half_length } => Shape::Capsule { radius: radius * factor, half_length: half_length * factor },
        Shape::Cylinder { radius, half_length } => Shape::Cylinder { radius: radius * factor, half_length: half_length * factor },
        Shape::Box { half_extents } => Shape::Box { half_extents: half_extents.map(|edge| edge * factor) },
        Shape::Convex(hull) => Shape::Convex(hull.clone()),
    }
}
