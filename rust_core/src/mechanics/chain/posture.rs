//! A posture of a chain: frames and velocities of all bodies at once, for those who look at many points.

use crate::mechanics::chain::model::{Chain, finite};
use crate::mechanics::chain::planar::{Frame, Twist, Vector};
use crate::schema::error::Result;

/// Where the bodies of a chain are and how they move; filled by [`Chain::assume`].
#[derive(Clone, Debug, Default)]
pub struct Posture {
    worlds: Vec<Frame>,
    velocities: Vec<Twist>,
}

impl Posture {
    /// Position in the world of a point of a body, m.
    pub fn position(&self, body: usize, point: Vector) -> Vector {
        self.worlds[body].point(point)
    }

    /// Velocity along the world's axes of a point of a body, m/s.
    pub fn velocity(&self, body: usize, point: Vector) -> Vector {
        self.worlds[body].rotate(self.velocities[body].at(point))
    }
}

impl Chain {
    /// Fills `posture` for the given positions and velocities; an error leaves it as it is.
    pub fn assume(&self, q: &[f64], qd: &[f64], posture: &mut Posture) -> Result<()> {
        self.check("q", q)?;
        self.check("qd", qd)?;
        posture.worlds.clear();
        posture.velocities.clear();
        for body in self.outwards(q, Some(qd)) {
            posture.worlds.push(body.world);
            posture.velocities.push(body.velocity);
        }
        Ok(())
    }

    /// Jacobian of a point of a body in a posture of this chain: per joint, the velocity of the point along the world's axes.
    pub fn jacobian_in(&self, posture: &Posture, body: usize, point: Vector, columns: &mut Vec<Vector>) {
        let target = posture.position(body, point);
        columns.clear();
        for (i, joint) in self.joints.iter().enumerate() {
            columns.push(if i <= body { joint.carries(&posture.worlds[i], target) } else { [0.0; 2] });
        }
    }

    /// Acceleration less gravity of a point of a body along the body's axes, m/s^2: what an accelerometer there senses.
    pub fn specific_force(&self, q: &[f64], qd: &[f64], qdd: &[f64], body: usize, point: Vector) -> Result<Vector> {
        for (name, values) in [("q", q), ("qd", qd), ("qdd", qdd)] {
            self.check(name, values)?;
        }
        for coordinate in point {
            finite(|| "point".to_owned(), coordinate)?;
        }
        let mut acceleration = Twist { angular: 0.0, linear: self.gravity.map(|g| -g) };
        for (i, carrier) in self.outwards(q, Some(qd)).enumerate().take(body + 1) {
            let axis = carrier.joint.axis();
            acceleration =
                carrier.frame.local_twist(acceleration) + axis * qdd[i] + carrier.velocity.cross(axis * qd[i]);
            if i == body {
                // The spatial acceleration is that of the frame's passing points; a point of the body turns with it as well.
                let [ax, ay] = acceleration.at(point);
                let ([vx, vy], turn) = (carrier.velocity.at(point), carrier.velocity.angular);
                return Ok([ax - turn * vy, ay + turn * vx]);
            }
        }
        Err(self.no_such_body("body", body))
    }
}
