//! Chains: their joints, and what follows from positions and velocities alone.

use std::ops::Add;

use serde::{Deserialize, Serialize};

use crate::mechanics::chain::joint::Joint;
use crate::mechanics::chain::planar::{Frame, Inertia, Twist, Vector, Wrench};
use crate::schema::error::{Error, Result};

/// Joints of a chain, at most: work and memory grow with their square and cube.
pub const MOST_JOINTS: usize = 1000;

/// A force on a point of a body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExternalForce {
    /// Index of the body.
    pub body: usize,
    /// Point of application in the body's frame, m.
    pub point: Vector,
    /// Force along the world's axes, N.
    pub force: Vector,
}

/// Immutable model of a chain. Joints, bodies and the entries of q are counted from 0 at the ground.
///
/// Positions `q`, velocities `qd`, accelerations `qdd` and forces `tau` are in m and N for prismatic joints, in rad and
/// N m for revolute ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    pub(super) joints: Vec<Joint>,
    pub(super) gravity: Vector,
}

/// A body met on the way outwards.
pub(super) struct Moving<'a> {
    pub(super) joint: &'a Joint,
    /// In its parent.
    pub(super) frame: Frame,
    /// In the world.
    pub(super) world: Frame,
    pub(super) velocity: Twist,
}

impl Chain {
    /// A chain from the ground outwards, in a field of `gravity` (m/s^2, world axes).
    pub fn new(joints: Vec<Joint>, gravity: Vector) -> Result<Self> {
        if joints.is_empty() {
            return Err(Error::Invalid("joints: a chain needs at least one".to_owned()));
        }
        if joints.len() > MOST_JOINTS {
            return Err(Error::Invalid(format!(
                "joints: a chain has {}, may have at most {MOST_JOINTS}",
                joints.len()
            )));
        }
        for (i, joint) in joints.iter().enumerate() {
            joint.validate(&format!("joints[{i}]"))?;
        }
        all_finite("gravity", &gravity)?;
        Ok(Self { joints, gravity })
    }

    /// The joints.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Forward kinematics: frame of every body in the world.
    pub fn frames(&self, q: &[f64], frames: &mut [Frame]) -> Result<()> {
        self.check("q", q)?;
        self.check_length("frames", frames.len(), self.joints.len())?;
        for (frame, body) in frames.iter_mut().zip(self.outwards(q, None)) {
            *frame = body.world;
        }
        Ok(())
    }

    /// Position in the world of a point of a body, m.
    pub fn point_position(&self, q: &[f64], body: usize, point: Vector) -> Result<Vector> {
        self.check("q", q)?;
        all_finite("point", &point)?;
        Ok(self.body(q, None, body)?.world.point(point))
    }

    /// Velocity along the world's axes of a point of a body, m/s.
    pub fn point_velocity(&self, q: &[f64], qd: &[f64], body: usize, point: Vector) -> Result<Vector> {
        self.check("q", q)?;
        all_finite("point", &point)?;
        self.check("qd", qd)?;
        let body = self.body(q, Some(qd), body)?;
        Ok(body.world.rotate(body.velocity.at(point)))
    }

    /// Jacobian J of a point of a body, `v = J qd`: the row of x, then the row of y.
    pub fn point_jacobian(&self, q: &[f64], body: usize, point: Vector, jacobian: &mut [f64]) -> Result<()> {
        self.check("q", q)?;
        all_finite("point", &point)?;
        let n = self.joints.len();
        self.check_length("jacobian", jacobian.len(), 2 * n)?;
        let target = self.body(q, None, body)?.world.point(point);
        jacobian.fill(0.0);
        for (i, carrier) in self.outwards(q, None).enumerate().take(body + 1) {
            [jacobian[i], jacobian[n + i]] = carrier.joint.carries(&carrier.world, target);
        }
        Ok(())
    }

    /// Kinetic energy, J.
    pub fn kinetic_energy(&self, q: &[f64], qd: &[f64]) -> Result<f64> {
        self.check("q", q)?;
        self.check("qd", qd)?;
        let energy = |body: Moving| 0.5 * body.joint.inertia().momentum(body.velocity).dot(body.velocity);
        Ok(self.outwards(q, Some(qd)).map(energy).sum())
    }

    /// Potential energy in the field of gravity, J; zero with the centre of mass at the world's origin.
    pub fn potential_energy(&self, q: &[f64]) -> Result<f64> {
        self.check("q", q)?;
        let [x, y] = self.total_inertia(q).first_moment;
        Ok(-(self.gravity[0] * x + self.gravity[1] * y))
    }

    /// Centre of mass in the world, m.
    pub fn center_of_mass(&self, q: &[f64]) -> Result<Vector> {
        self.check("q", q)?;
        let Inertia { mass, first_moment, .. } = self.total_inertia(q);
        if mass > 0.0 {
            return Ok(first_moment.map(|moment| moment / mass));
        }
        Err(Error::Invalid("joints: without any mass, a chain has no centre of mass".to_owned()))
    }

    /// Angular momentum about the world's origin (kg m^2/s), then linear momentum along x and y (kg m/s).
    pub fn momentum(&self, q: &[f64], qd: &[f64]) -> Result<[f64; 3]> {
        self.check("q", q)?;
        self.check("qd", qd)?;
        let momentum = |body: Moving| body.world.wrench(body.joint.inertia().momentum(body.velocity));
        let total = self.outwards(q, Some(qd)).map(momentum).fold(Wrench::ZERO, Wrench::add);
        Ok([total.moment, total.force[0], total.force[1]])
    }

    /// The bodies from the ground outwards, at rest if no velocities are given.
    pub(super) fn outwards(&self, q: &[f64], qd: Option<&[f64]>) -> impl Iterator<Item = Moving<'_>> {
        let ground = (Frame::IDENTITY, Twist::ZERO);
        self.joints.iter().enumerate().scan(ground, move |(world, velocity), (i, joint)| {
            let frame = joint.frame(q[i]);
            *world = world.compose(&frame);
            *velocity = frame.local_twist(*velocity) + joint.axis() * qd.map_or(0.0, |qd| qd[i]);
            Some(Moving { joint, frame, world: *world, velocity: *velocity })
        })
    }

    /// Inertia of all bodies together, about the world's origin.
    fn total_inertia(&self, q: &[f64]) -> Inertia {
        self.outwards(q, None).map(|body| body.world.inertia(body.joint.inertia())).fold(Inertia::NONE, Inertia::add)
    }

    fn body(&self, q: &[f64], qd: Option<&[f64]>, body: usize) -> Result<Moving<'_>> {
        self.outwards(q, qd).nth(body).ok_or_else(|| self.no_such_body("body", body))
    }

    pub(super) fn no_such_body(&self, key: &str, body: usize) -> Error {
        let range = format!("[0, {}]", self.joints.len() - 1);
        Error::OutOfRange { key: key.to_owned(), value: body.to_string(), range }
    }

    pub(super) fn check_external_forces(&self, external_forces: &[ExternalForce]) -> Result<()> {
        for (i, load) in external_forces.iter().enumerate() {
            if load.body >= self.joints.len() {
                return Err(self.no_such_body(&format!("external_forces[{i}].body"), load.body));
            }
            all_finite(&format!("external_forces[{i}].point"), &load.point)?;
            all_finite(&format!("external_forces[{i}].force"), &load.force)?;
        }
        Ok(())
    }

    pub(super) fn check(&self, name: &str, values: &[f64]) -> Result<()> {
        self.check_length(name, values.len(), self.joints.len())?;
        all_finite(name, values)
    }

    pub(super) fn check_length(&self, name: &str, length: usize, expected: usize) -> Result<()> {
        if length == expected {
            return Ok(());
        }
        let joints = self.joints.len();
        Err(Error::Invalid(format!("{name} has {length} values, a chain of {joints} joints needs {expected}")))
    }
}

fn all_finite(name: &str, values: &[f64]) -> Result<()> {
    values.iter().enumerate().try_for_each(|(i, &value)| finite(|| format!("{name}[{i}]"), value))
}

pub(super) fn finite(key: impl Fn() -> String, value: f64) -> Result<()> {
    if value.is_finite() {
        return Ok(());
    }
    Err(Error::OutOfRange { key: key(), value: value.to_string(), range: "(-inf, inf)".to_owned() })
}
