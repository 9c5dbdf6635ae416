//! Planar vectors and tensors: spatial algebra of rigid bodies in a plane, three numbers instead of six
//! (Featherstone 2008, section 2.16).
//!
//! Twists, wrenches and inertias are expressed at the origin of a body's frame and along its axes.

use std::ops::{Add, Mul, Sub};

/// A point or a free vector, m or N.
pub type Vector = [f64; 2];

/// Pose of a frame in its parent, or in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Origin, m.
    pub origin: Vector,
    cos: f64,
    sin: f64,
}

impl Frame {
    /// The parent itself.
    pub const IDENTITY: Self = Self { origin: [0.0; 2], cos: 1.0, sin: 0.0 };

    /// Frame at `origin` (m), turned by `angle` (rad).
    pub fn new(origin: Vector, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self { origin, cos, sin }
    }

    /// Orientation in (-pi, pi], rad.
    pub fn angle(&self) -> f64 {
        self.sin.atan2(self.cos)
    }

    /// The frame shifted along its own axes.
    pub fn shifted(self, shift: Vector) -> Self {
        Self { origin: self.point(shift), ..self }
    }

    /// A frame given in this one, as seen from the parent.
    pub fn compose(&self, child: &Self) -> Self {
        Self {
            origin: self.point(child.origin),
            cos: self.cos * child.cos - self.sin * child.sin,
            sin: self.sin * child.cos + self.cos * child.sin,
        }
    }

    /// A vector of this frame in the parent's axes.
    pub fn rotate(&self, [x, y]: Vector) -> Vector {
        [self.cos * x - self.sin * y, self.sin * x + self.cos * y]
    }

    /// A vector of the parent's axes in this frame.
    pub fn unrotate(&self, [x, y]: Vector) -> Vector {
        [self.cos * x + self.sin * y, self.cos * y - self.sin * x]
    }

    /// A point of this frame as seen from the parent.
    pub fn point(&self, point: Vector) -> Vector {
        let [x, y] = self.rotate(point);
        [self.origin[0] + x, self.origin[1] + y]
    }

    /// A point of the parent as seen from this frame.
    pub fn local_point(&self, [x, y]: Vector) -> Vector {
        self.unrotate([x - self.origin[0], y - self.origin[1]])
    }

    /// The parent's twist as seen from this frame.
    pub(super) fn local_twist(&self, twist: Twist) -> Twist {
        Twist { angular: twist.angular, linear: self.unrotate(twist.at(self.origin)) }
    }

    /// A wrench of this frame as seen from the parent.
    pub(super) fn wrench(&self, wrench: Wrench) -> Wrench {
        let force = self.rotate(wrench.force);
        Wrench { moment: wrench.moment + cross(self.origin, force), force }
    }

    /// An inertia of this frame as seen from the parent.
    pub(super) fn inertia(&self, inertia: Inertia) -> Inertia {
        let [x, y] = self.origin;
        let [hx, hy] = self.rotate(inertia.first_moment);
        Inertia {
            mass: inertia.mass,
            first_moment: [hx + inertia.mass * x, hy + inertia.mass * y],
            rotational: inertia.rotational + 2.0 * (x * hx + y * hy) + inertia.mass * (x * x + y * y),
        }
    }
}

/// Motion vector: angular velocity and velocity of the frame's origin, or the accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Twist {
    pub angular: f64,
    pub linear: Vector,
}

impl Twist {
    pub const ZERO: Self = Self { angular: 0.0, linear: [0.0; 2] };

    /// Velocity of the body's point at `point`.
    pub fn at(self, [x, y]: Vector) -> Vector {
        [self.linear[0] - self.angular * y, self.linear[1] + self.angular * x]
    }

    /// Rate of change of `moved`, which is fixed in a frame that moves with this twist: `v x m`.
    pub fn cross(self, moved: Self) -> Self {
        let ([vx, vy], [mx, my]) = (self.linear, moved.linear);
        let linear = [vy * moved.angular - self.angular * my, self.angular * mx - vx * moved.angular];
        Self { angular: 0.0, linear }
    }

    /// The same for a wrench: `v x* f`.
    pub fn cross_wrench(self, moved: Wrench) -> Wrench {
        let [fx, fy] = moved.force;
        Wrench { moment: cross(self.linear, moved.force), force: [-self.angular * fy, self.angular * fx] }
    }
}

impl Add for Twist {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let ([ax, ay], [bx, by]) = (self.linear, other.linear);
        Self { angular: self.angular + other.angular, linear: [ax + bx, ay + by] }
    }
}

impl Mul<f64> for Twist {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self { angular: factor * self.angular, linear: self.linear.map(|v| factor * v) }
    }
}

/// Force vector: moment about the frame's origin and force, or angular and linear momentum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wrench {
    pub moment: f64,
    pub force: Vector,
}

impl Wrench {
    pub const ZERO: Self = Self { moment: 0.0, force: [0.0; 2] };

    /// Of `force` on the body's point at `point`.
    pub fn of_force(point: Vector, force: Vector) -> Self {
        Self { moment: cross(point, force), force }
    }

    /// Power on a body that moves with `twist`; component along it, if it is a joint's axis.
    pub fn dot(self, twist: Twist) -> f64 {
        self.moment * twist.angular + self.force[0] * twist.linear[0] + self.force[1] * twist.linear[1]
    }
}

impl Add for Wrench {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let ([ax, ay], [bx, by]) = (self.force, other.force);
        Self { moment: self.moment + other.moment, force: [ax + bx, ay + by] }
    }
}

impl Sub for Wrench {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        let ([ax, ay], [bx, by]) = (self.force, other.force);
        Self { moment: self.moment - other.moment, force: [ax - bx, ay - by] }
    }
}

/// Inertia of a rigid body about the origin of its frame: mass, mass times centre of mass, and rotational inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Inertia {
    pub mass: f64,
    pub first_moment: Vector,
    pub rotational: f64,
}

impl Inertia {
    pub const NONE: Self = Self { mass: 0.0, first_moment: [0.0; 2], rotational: 0.0 };

    /// From the centre of mass and the inertia about it.
    pub fn new(mass: f64, com: Vector, about_com: f64) -> Self {
        let [x, y] = com;
        Self { mass, first_moment: [mass * x, mass * y], rotational: about_com + mass * (x * x + y * y) }
    }

    /// Momentum of the body.
    pub fn momentum(&self, twist: Twist) -> Wrench {
        let [x, y] = twist.linear;
        let [hx, hy] = self.first_moment;
        Wrench {
            moment: self.rotational * twist.angular + cross(self.first_moment, twist.linear),
            force: [self.mass * x - hy * twist.angular, self.mass * y + hx * twist.angular],
        }
    }
}

impl Add for Inertia {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let ([ax, ay], [bx, by]) = (self.first_moment, other.first_moment);
        Self {
            mass: self.mass + other.mass,
            first_moment: [ax + bx, ay + by],
            rotational: self.rotational + other.rotational,
        }
    }
}

fn cross([ax, ay]: Vector, [bx, by]: Vector) -> f64 {
    ax * by - ay * bx
}
