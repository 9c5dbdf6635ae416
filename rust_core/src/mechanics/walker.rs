//! Hybrid dynamics of the walker in absolute segment angles (section 3, Table 1).
//!
//! Forward-dynamics joints: trunk travel and height, hip, knee, ankle. Inverse-dynamics joints: trunk rotation (prescribed)
//! and the two tube-sensor joints (locked), whose forces are the load-cell readings. With the angles of thigh, shank and
//! foot to the vertical as coordinates, the mass matrix is a sum of dot products of segment vectors:
//! `M_ij = L_i . S_j`, L_i the link of the proximal segment and S_j the first moment of all that hangs below segment j.
//! Torques of the relative joints 4, 5, 8 act on these coordinates as differences.

use crate::mechanics::body::Body;
use crate::mechanics::equations::{Equations, Planar, dot};
use crate::mechanics::motion::{Acceleration, Kinematics, Loads, Motion, Point, PointForce, Prescribed};
use crate::numerics::lanes::lanes;
use crate::numerics::math::{FusedSum, sin_cos};
use crate::signals::GRAVITY;

/// Segment vectors of a posture.
#[inline(always)]
pub fn kinematics(body: &Body, motion: &Motion, trunk_angle: f64) -> Kinematics {
    let (trunk_sin, trunk_cos) = sin_cos(trunk_angle);
    let (thigh_sin, thigh_cos) = sin_cos(motion.thigh);
    let (shank_sin, shank_cos) = sin_cos(motion.shank);
    let (foot_sin, foot_cos) = sin_cos(motion.foot);
    Kinematics {
        trunk_mx: -body.trunk_moment_y * trunk_sin,
        trunk_my: body.trunk_moment_y * trunk_cos,
        thigh_x: body.thigh_length * thigh_sin,
        thigh_y: -body.thigh_length * thigh_cos,
        shank_x: body.shank_length * shank_sin,
        shank_y: -body.shank_length * shank_cos,
        thigh_mx: (body.thigh_moment_x * thigh_cos).minus(body.thigh_moment_y, thigh_sin),
        thigh_my: (body.thigh_moment_x * thigh_sin).plus(body.thigh_moment_y, thigh_cos),
        shank_mx: (body.shank_moment_x * shank_cos).minus(body.shank_moment_y, shank_sin),
        shank_my: (body.shank_moment_x * shank_sin).plus(body.shank_moment_y, shank_cos),
        foot_mx: (body.foot_moment_x * foot_cos).minus(body.foot_moment_y, foot_sin),
        foot_my: (body.foot_moment_x * foot_sin).plus(body.foot_moment_y, foot_cos),
        heel_x: (body.heel_x * foot_cos).minus(body.sole_y, foot_sin),
        heel_y: (body.heel_x * foot_sin).plus(body.sole_y, foot_cos),
        ball_x: (body.ball_x * foot_cos).minus(body.sole_y, foot_sin),
        ball_y: (body.ball_x * foot_sin).plus(body.sole_y, foot_cos),
    }
}

/// Motion of the foot point at `(arm_x, arm_y)` from the ankle, world axes.
///
/// Also gives its acceleration without the centripetal part, if `motion`'s rates are accelerations.
#[inline(always)]
pub fn foot_point(motion: &Motion, kin: &Kinematics, arm_x: f64, arm_y: f64) -> Point {
    Point {
        x: motion.hip_x + kin.thigh_x + kin.shank_x + arm_x,
        y: motion.hip_y + kin.thigh_y + kin.shank_y + arm_y,
        vx: motion
            .hip_vx
            .minus(motion.thigh_rate, kin.thigh_y)
            .minus(motion.shank_rate, kin.shank_y)
            .minus(motion.foot_rate, arm_y),
        vy: motion
            .hip_vy
            .plus(motion.thigh_rate, kin.thigh_x)
            .plus(motion.shank_rate, kin.shank_x)
            .plus(motion.foot_rate, arm_x),
    }
}

/// Motion of the knee.
#[inline(always)]
pub fn knee_point(motion: &Motion, kin: &Kinematics) -> Point {
    Point {
        x: motion.hip_x + kin.thigh_x,
        y: motion.hip_y + kin.thigh_y,
        vx: motion.hip_vx.minus(motion.thigh_rate, kin.thigh_y),
        vy: motion.hip_vy.plus(motion.thigh_rate, kin.thigh_x),
    }
}

/// Mean acceleration over a linearly implicit step of length `step`; with `step = 0` the acceleration itself.
///
/// Solves `(M + h D + h^2 K) a = f - h K v`, D and K the damping and stiffness of joints and contacts. `LEVEL` promises
/// that the contacts' surfaces are level, which saves turning them.
#[inline(always)]
pub fn acceleration<const LEVEL: bool>(
    body: &Body,
    kin: &Kinematics,
    motion: &Motion,
    trunk: &Prescribed,
    loads: &Loads,
    step: f64,
) -> Acceleration {
    let (w1, w2, w3) = (motion.thigh_rate, motion.shank_rate, motion.foot_rate);
    let (c1, c2, c3) = (w1 * w1, w2 * w2, w3 * w3);

    // (z x L_i) . S_j = L_i x S_j: centripetal coupling of two segments.
    let thigh_shank = (kin.thigh_x * kin.shank_my).minus(kin.thigh_y, kin.shank_mx);
    let thigh_foot = (kin.thigh_x * kin.foot_my).minus(kin.thigh_y, kin.foot_mx);
    let shank_foot = (kin.shank_x * kin.foot_my).minus(kin.shank_y, kin.foot_mx);

    // Torques less the part that stiffness will take back over the step.
    let hip = loads.hip.torque.minus(step * loads.hip.stiffness, loads.hip_error_rate);
    let knee = loads.knee.torque.minus(step * loads.knee.stiffness, w2 - w1);
    let ankle = loads.ankle.torque.minus(step * loads.ankle.stiffness, w3 - w2);
    let implicit = |damping: f64, stiffness: f64| step * damping.plus(step, stiffness);
    let hip_implicit = implicit(loads.hip.damping, loads.hip.stiffness);
    let knee_implicit = implicit(loads.knee.damping, loads.knee.stiffness);
    let ankle_implicit = implicit(loads.ankle.damping, loads.ankle.stiffness);

    // How the foot's contact points move with thigh, shank and foot: the normals of the segment vectors.
    let (thigh, shank) = ([-kin.thigh_y, kin.thigh_x], [-kin.shank_y, kin.shank_x]);
    let contact = |point: &PointForce, arm_x: f64, arm_y: f64| {
        let velocity = foot_point(motion, kin, arm_x, arm_y);
        let stiffness = Planar::turned::<LEVEL>(point.stiffness_x, point.stiffness_y, point.sin, point.cos);
        let [back_x, back_y] = stiffness.apply::<LEVEL>([velocity.vx, velocity.vy]);
        let damping = Planar::turned::<LEVEL>(
            implicit(point.damping_x, point.stiffness_x),
            implicit(point.damping_y, point.stiffness_y),
            point.sin,
            point.cos,
        );
        ([-arm_y, arm_x], [point.x.minus(step, back_x), point.y.minus(step, back_y)], damping)
    };
    let (heel_arm, heel_force, heel) = contact(&loads.heel, kin.heel_x, kin.heel_y);
    let (ball_arm, ball_force, ball) = contact(&loads.ball, kin.ball_x, kin.ball_y);
    // Both points move alike with hip, thigh and shank: there only their sums count.
    let both = Planar { xx: heel.xx + ball.xx, xy: heel.xy + ball.xy, yy: heel.yy + ball.yy };
    let ground = [heel_force[0] + ball_force[0], heel_force[1] + ball_force[1]];
    let (with_thigh, with_shank) = (both.apply::<LEVEL>(thigh), both.apply::<LEVEL>(shank));
    let (heel_foot, ball_foot) = (heel.apply::<LEVEL>(heel_arm), ball.apply::<LEVEL>(ball_arm));
    let with_foot = [heel_foot[0] + ball_foot[0], heel_foot[1] + ball_foot[1]];

    let trunk_centripetal = trunk.rate * trunk.rate;
    Equations {
        // Mass matrix, implicit shares of joints and contacts.
        xx: body.mass + both.xx,
        yx: both.xy,
        yy: body.mass + both.yy,
        tx: with_thigh[0] - kin.thigh_my,
        ty: with_thigh[1] + kin.thigh_mx,
        tt: (body.thigh_inertia + hip_implicit + knee_implicit).plus_dot(with_thigh, thigh),
        sx: with_shank[0] - kin.shank_my,
        sy: with_shank[1] + kin.shank_mx,
        st: dot([kin.thigh_x, kin.thigh_y], [kin.shank_mx, kin.shank_my]).plus_dot(with_shank, thigh) - knee_implicit,
        ss: (body.shank_inertia + knee_implicit + ankle_implicit).plus_dot(with_shank, shank),
        fx: with_foot[0] - kin.foot_my,
        fy: with_foot[1] + kin.foot_mx,
        ft: dot([kin.thigh_x, kin.thigh_y], [kin.foot_mx, kin.foot_my]).plus_dot(with_foot, thigh),
        fs: dot([kin.shank_x, kin.shank_y], [kin.foot_mx, kin.foot_my]).plus_dot(with_foot, shank) - ankle_implicit,
        ff: (body.foot_inertia + ankle_implicit).plus_dot(heel_foot, heel_arm).plus_dot(ball_foot, ball_arm),
        // Forces and centripetal terms.
        x: (loads.trunk_x + loads.knee_x + ground[0])
            .plus(trunk.acceleration, kin.trunk_my)
            .plus(trunk_centripetal, kin.trunk_mx)
            .plus(c1, kin.thigh_mx)
            .plus(c2, kin.shank_mx)
            .plus(c3, kin.foot_mx),
        y: (loads.trunk_y + loads.knee_y + ground[1])
            .minus(body.mass, GRAVITY)
            .minus(trunk.acceleration, kin.trunk_mx)
            .plus(trunk_centripetal, kin.trunk_my)
            .plus(c1, kin.thigh_my)
            .plus(c2, kin.shank_my)
            .plus(c3, kin.foot_my),
        t: (hip - knee)
            .minus(GRAVITY, kin.thigh_mx)
            .minus(kin.thigh_y, loads.knee_x)
            .plus(kin.thigh_x, loads.knee_y)
            .plus_dot(ground, thigh)
            .plus(c2, thigh_shank)
            .plus(c3, thigh_foot),
        s: (knee - ankle)
            .minus(GRAVITY, kin.shank_mx)
            .plus_dot(ground, shank)
            .minus(c1, thigh_shank)
            .plus(c3, shank_foot),
        f: ankle
            .minus(GRAVITY, kin.foot_mx)
            .plus_dot(heel_force, heel_arm)
            .plus_dot(ball_force, ball_arm)
            .minus(c1, thigh_foot)
            .minus(c2, shank_foot),
    }
    .solve::<LEVEL>()
}

lanes! {
    /// Forces of the inverse-dynamics joints, N and N m, signs of section 1 of the paper's chain (tau_3, tau_6, tau_7).
    pub struct Reactions, ReactionsLanes {
        /// Torque that prescribes the trunk's rotation, N m.
        trunk_torque: f64,
        /// Tube extension force tau_6, N; compression is negative.
        tube_force: f64,
        /// Tube bending torque tau_7, N m.
        tube_torque: f64,
    }
}

/// Inverse dynamics of trunk rotation and tube joints from the forward solution.
#[inline(always)]
pub fn reactions(
    body: &Body,
    kin: &Kinematics,
    motion: &Motion,
    trunk: &Prescribed,
    loads: &Loads,
    acceleration: &Acceleration,
) -> Reactions {
    let (c1, c2, c3) = (
        motion.thigh_rate * motion.thigh_rate,
        motion.shank_rate * motion.shank_rate,
        motion.foot_rate * motion.foot_rate,
    );
    let ankle_ax = acceleration.hip_x
        - acceleration.thigh * kin.thigh_y
        - c1 * kin.thigh_x
        - acceleration.shank * kin.shank_y
        - c2 * kin.shank_x;
    let ankle_ay = acceleration.hip_y + acceleration.thigh * kin.thigh_x - c1 * kin.thigh_y
        + acceleration.shank * kin.shank_x
        - c2 * kin.shank_y;
    // Force of the tube on the foot: m a = R + m g + contacts.
    let rx =
        body.foot_mass * ankle_ax - acceleration.foot * kin.foot_my - c3 * kin.foot_mx - loads.heel.x - loads.ball.x;
    let ry = body.foot_mass * (ankle_ay + GRAVITY) + acceleration.foot * kin.foot_mx
        - c3 * kin.foot_my
        - loads.heel.y
        - loads.ball.y;
    let (axis_x, axis_y) = (-kin.shank_x / body.shank_length, -kin.shank_y / body.shank_length);
    let (arm_x, arm_y) = (-axis_x * body.tube_length, -axis_y * body.tube_length);
    Reactions {
        trunk_torque: loads.hip.torque + body.trunk_inertia * trunk.acceleration - kin.trunk_my * acceleration.hip_x
            + kin.trunk_mx * (acceleration.hip_y + GRAVITY),
        tube_force: rx * axis_x + ry * axis_y,
        tube_torque: loads.ankle.torque + arm_x * ry - arm_y * rx,
    }
}

lanes! {
    /// Mechanical energy, J.
    pub struct Energy, EnergyLanes {
        /// Kinetic energy of all segments, trunk rotation included.
        kinetic: f64,
        /// Potential energy, zero at hip height zero with all segments level.
        potential: f64,
    }
}

/// Mechanical energy of the segments.
pub fn energy(body: &Body, kin: &Kinematics, motion: &Motion, trunk: &Prescribed) -> Energy {
    let (vx, vy) = (motion.hip_vx, motion.hip_vy);
    let (w0, w1, w2, w3) = (trunk.rate, motion.thigh_rate, motion.shank_rate, motion.foot_rate);
    // Momentum of the first moments: sum of w_i (z x S_i).
    let px = -(w0 * kin.trunk_my + w1 * kin.thigh_my + w2 * kin.shank_my + w3 * kin.foot_my);
    let py = w0 * kin.trunk_mx + w1 * kin.thigh_mx + w2 * kin.shank_mx + w3 * kin.foot_mx;
    let coupling = w1 * w2 * (kin.thigh_x * kin.shank_mx + kin.thigh_y * kin.shank_my)
        + w1 * w3 * (kin.thigh_x * kin.foot_mx + kin.thigh_y * kin.foot_my)
        + w2 * w3 * (kin.shank_x * kin.foot_mx + kin.shank_y * kin.foot_my);
    let rotation = body.trunk_inertia * w0 * w0
        + body.thigh_inertia * w1 * w1
        + body.shank_inertia * w2 * w2
        + body.foot_inertia * w3 * w3;
    Energy {
        kinetic: 0.5 * (body.mass * (vx * vx + vy * vy) + rotation) + vx * px + vy * py + coupling,
        potential: GRAVITY * (body.mass * motion.hip_y + kin.trunk_my + kin.thigh_my + kin.shank_my + kin.foot_my),
    }
}
