//! The one place where MuJoCo's conventions meet ours: quaternion order, twist order, array layouts.

use mujoco_rs::wrappers::mj_data::MjData;
use mujoco_rs::wrappers::mj_logging::{log_config, set_log_config};
use mujoco_rs::wrappers::mj_model::MjModel;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::fmt::Write;
use std::sync::{Arc, Once};
use vmao_core::convex_hull::ConvexHull;
use vmao_core::geometry::{Pose, pose, position_quaternion};
use vmao_core::osc::{Jacobian, JointVector, MassMatrix};
use vmao_core::robots::Inertial;
use vmao_core::shape::Shape;

/// The simulator's state type used throughout this crate.
pub(crate) type Data = MjData<Arc<MjModel>>;

static QUIET: Once = Once::new();

/// The compiled model of a scene; the simulator's words if it refuses.
///
/// The simulator's warnings are read from its state ([`warning`]), so it shall not also write them to a file of its own.
#[expect(unsafe_code, reason = "the simulator's log is a global of the library")]
pub(crate) fn compile(mjcf: &str) -> Result<MjModel, String> {
    QUIET.call_once(|| {
        // SAFETY: every use of the simulator begins with a model from here, and all callers wait for this first one.
        unsafe { set_log_config(log_config().with_logto_file(false)) }
    });
    MjModel::from_xml_string(mjcf).map_err(|cause| cause.to_string())
}

/// What the simulator has warned of since its state was made: a step that counts for nothing.
pub(crate) fn warning(data: &Data) -> Option<String> {
    // In the order of mjtWarning.
    const NAMES: [&str; 7] = [
        "an inertia that cannot be inverted",
        "more contacts than there is room for",
        "more constraints than there is room for",
        "a position that is not finite or too large",
        "a velocity that is not finite or too large",
        "an acceleration that is not finite or too large",
        "a torque that is not finite",
    ];
    let raised = data.warning().iter().zip(NAMES).find(|(warning, _)| warning.number > 0);
    raised.map(|(warning, name)| format!("{name} (number {})", warning.lastinfo))
}

/// World pose of body `body`.
pub(crate) fn body_pose(data: &Data, body: usize) -> Pose {
    pose(data.xpos()[body], data.xquat()[body])
}

/// Our poses as the seven numbers of a MuJoCo free joint: position, then quaternion w, x, y, z.
pub(crate) fn free_joint_position(pose: &Pose) -> [f64; 7] {
    let ([x, y, z], [qw, qx, qy, qz]) = position_quaternion(pose);
    [x, y, z, qw, qx, qy, qz]
}

/// Our rotation as the four numbers of a MuJoCo ball joint: the quaternion w, x, y, z.
pub(crate) fn ball_joint_position(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    let q = rotation.quaternion();
    [q.w, q.i, q.j, q.k]
}

/// Jacobian at a world point of a chain of hinges with these MuJoCo joint ids: linear rows, then angular.
pub(crate) fn hinge_jacobian(data: &Data, joints: &[usize], point: &Vector3<f64>) -> Jacobian {
    let mut jacobian = Jacobian::zeros();
    for (column, &joint) in joints.iter().enumerate() {
        let axis = Vector3::from(data.xaxis()[joint]);
        let linear = axis.cross(&(point - Vector3::from(data.xanchor()[joint])));
        jacobian.fixed_view_mut::<3, 1>(0, column).copy_from(&linear);
        jacobian.fixed_view_mut::<3, 1>(3, column).copy_from(&axis);
    }
    jacobian
}

/// The arm's block of MuJoCo's full mass matrix (row-major, `nv` × `nv`), whose dofs start at `first`.
pub(crate) fn mass_block(full: &[f64], nv: usize, first: usize) -> MassMatrix {
    MassMatrix::from_fn(|row, column| full[(first + row) * nv + first + column])
}

/// Seven consecutive numbers of a MuJoCo array.
pub(crate) fn joint_vector(values: &[f64], first: usize) -> JointVector {
    JointVector::from_iterator(values[first..first + 7].iter().copied())
}

/// MJCF attributes of a pose.
pub(crate) fn pose_attributes(pose: &Pose) -> String {
    let ([x, y, z], [qw, qx, qy, qz]) = position_quaternion(pose);
    format!(r#"pos="{x} {y} {z}" quat="{qw} {qx} {qy} {qz}""#)
}

/// MJCF attributes of a shape; a hull is the mesh asset `mesh`. MuJoCo's capsules and cylinders lie along z, as ours.
pub(crate) fn shape_attributes(shape: &Shape, mesh: &str) -> String {
    match *shape {
        Shape::Convex(_) => format!(r#"type="mesh" mesh="{mesh}""#),
        Shape::Sphere { radius } => format!(r#"type="sphere" size="{radius}""#),
        Shape::Capsule { radius, half_length } => format!(r#"type="capsule" size="{radius} {half_length}""#),
        Shape::Cylinder { radius, half_length } => format!(r#"type="cylinder" size="{radius} {half_length}""#),
        Shape::Box { half_extents: [x, y, z] } => format!(r#"type="box" size="{x} {y} {z}""#),
    }
}

/// MJCF element of a mesh asset. MuJoCo moves a mesh's frame to its centre of mass and corrects the geoms that use it.
pub(crate) fn hull_element(name: &str, hull: &ConvexHull) -> String {
    let mut xml = format!(r#"<mesh name="{name}" inertia="convex" vertex=""#);
    for vertex in hull.vertices() {
        let _infallible = write!(xml, "{} {} {} ", vertex.x, vertex.y, vertex.z);
    }
    xml.push_str(r#"" face=""#);
    for [a, b, c] in hull.faces() {
        let _infallible = write!(xml, "{a} {b} {c} ");
    }
    xml.push_str(r#""/>"#);
    xml
}

/// MJCF element of mass properties. MuJoCo orders full inertias xx yy zz xy xz yz.
pub(crate) fn inertial_element(inertial: &Inertial) -> String {
    let Inertial { mass, center, inertia } = inertial;
    let m: &Matrix3<f64> = inertia;
    format!(
        r#"<inertial mass="{mass}" pos="{} {} {}" fullinertia="{} {} {} {} {} {}"/>"#,
        center.x,
        center.y,
        center.z,
        m[(0, 0)],
        m[(1, 1)],
        m[(2, 2)],
        m[(0, 1)],
        m[(0, 2)],
        m[(1, 2)]
    )
}
