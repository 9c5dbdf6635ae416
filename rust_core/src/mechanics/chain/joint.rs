//! Joints and the bodies that move on them.

use serde::{Deserialize, Serialize};

use crate::mechanics::chain::planar::{Frame, Inertia, Twist, Vector};
use crate::schema::error::{Error, Result};

/// The one motion that a joint allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum JointKind {
    /// Shift along the x-axis of the joint's frame, m.
    #[serde(rename = "px")]
    PrismaticX,
    /// Shift along its y-axis, m.
    #[serde(rename = "py")]
    PrismaticY,
    /// Counter-clockwise rotation, rad.
    #[serde(rename = "r")]
    Revolute,
}

/// A joint and the body that moves on it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Type of joint.
    pub kind: JointKind,
    /// Origin of the body's frame in the parent body's frame at q = 0, m.
    #[serde(default)]
    pub offset: Vector,
    /// Angle of the body's frame in the parent body's frame at q = 0, rad.
    #[serde(default)]
    pub angle: f64,
    /// Mass of the body, kg; 0 for a body that only connects two joints.
    #[serde(default)]
    pub mass: f64,
    /// Centre of mass in the body's frame, m.
    #[serde(default)]
    pub com: Vector,
    /// Inertia of the body about its centre of mass, kg m^2.
    #[serde(default)]
    pub inertia: f64,
}

impl Joint {
    /// A massless body whose frame is that of its parent at q = 0.
    pub const fn massless(kind: JointKind) -> Self {
        Self { kind, offset: [0.0; 2], angle: 0.0, mass: 0.0, com: [0.0; 2], inertia: 0.0 }
    }

    /// Twist of the body relative to its parent per unit of joint velocity: S of Featherstone 2008, section 4.4.
    pub(super) fn axis(&self) -> Twist {
        match self.kind {
            JointKind::PrismaticX => Twist { angular: 0.0, linear: [1.0, 0.0] },
            JointKind::PrismaticY => Twist { angular: 0.0, linear: [0.0, 1.0] },
            JointKind::Revolute => Twist { angular: 1.0, linear: [0.0, 0.0] },
        }
    }

    /// Frame of the body in its parent at joint position `q`.
    pub(super) fn frame(&self, q: f64) -> Frame {
        match self.kind {
            JointKind::PrismaticX => Frame::new(self.offset, self.angle).shifted([q, 0.0]),
            JointKind::PrismaticY => Frame::new(self.offset, self.angle).shifted([0.0, q]),
            JointKind::Revolute => Frame::new(self.offset, self.angle + q),
        }
    }

    /// Velocity of the world's point `target` per unit of joint velocity, were it fixed to the body in frame `world`.
    pub(super) fn carries(&self, world: &Frame, target: Vector) -> Vector {
        world.rotate(self.axis().at(world.local_point(target)))
    }

    /// Inertia of the body about the origin of its frame.
    pub(super) fn inertia(&self) -> Inertia {
        Inertia::new(self.mass, self.com, self.inertia)
    }

    pub(super) fn validate(&self, path: &str) -> Result<()> {
        let anything = (f64::NEG_INFINITY, "(-inf, inf)");
        for (field, value, (lowest, range)) in [
            ("offset[0]", self.offset[0], anything),
            ("offset[1]", self.offset[1], anything),
            ("angle", self.angle, anything),
            ("mass", self.mass, (0.0, "[0, inf) kg")),
            ("com[0]", self.com[0], anything),
            ("com[1]", self.com[1], anything),
            ("inertia", self.inertia, (0.0, "[0, inf) kg m^2")),
        ] {
            if !(value.is_finite() && value >= lowest) {
                let (key, value) = (format!("{path}.{field}"), value.to_string());
                return Err(Error::OutOfRange { key, value, range: range.to_owned() });
            }
        }
        Ok(())
    }
}
