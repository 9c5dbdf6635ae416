//! Compliant ground: nonlinear spring-damper with Coulomb friction per contact point (section 3.3; Azad & Featherstone 2010).

use crate::numerics::lanes::lanes;
use crate::numerics::math::{FusedSum, max, select};
use crate::schema::params::{above, params, within};

params! {
    /// Ground and foot-sole compliance (section 3.3), and the ground's profile (the paper's is level).
    pub struct GroundParams {
        /// Normal and tangential stiffness K (section 3.3).
        stiffness_n_m15: f64 = 2e5, "N/m^1.5", above(0.0, 1e8);
        /// Normal and tangential damping D (section 3.3). It divides in the slip law.
        damping_ns_m15: f64 = 2e4, "N s/m^1.5", above(0.0, 1e7);
        /// Coulomb friction coefficient (section 3.3).
        friction: f64 = 0.5, "1", above(0.0, 10.0);
        /// Slope of the whole ground, uphill positive; it passes through the start.
        slope_deg: f64 = 0.0, "deg", within(-30.0, 30.0);
        /// Height of a single step; negative steps down.
        step_height_m: f64 = 0.0, "m", within(-1.0, 1.0);
        /// Place of the single step.
        step_x_m: f64 = 3.0, "m", within(-1e4, 1e4);
        /// Distance over which the single step and every stair rise, so that the height is continuous; long for a ramp.
        edge_m: f64 = 0.02, "m", within(1e-3, 1e3);
        /// Height of each stair; negative stairs lead down.
        stair_rise_m: f64 = 0.0, "m", within(-0.5, 0.5);
        /// Distance between two risers.
        stair_run_m: f64 = 0.3, "m", within(0.05, 100.0);
        /// Place of the first riser.
        stair_start_x_m: f64 = 3.0, "m", within(-1e4, 1e4);
        /// Number of stairs.
        stair_count: usize = 10, "", within(1.0, 10_000.0);
        /// Amplitude of the roughness, which no point of it exceeds.
        roughness_m: f64 = 0.0, "m", within(0.0, 0.5);
        /// Longest wavelength of the roughness; the other three are shorter by powers of the golden ratio, down to 0.24.
        roughness_length_m: f64 = 1.0, "m", within(0.1, 100.0);
        /// Seed of the roughness's phases: the same seed, the same ground.
        roughness_seed: usize = 0, "", within(0.0, 4_294_967_295.0);
    }
}

lanes! {
    /// Ground constants of one walker, SI.
    pub struct Ground, GroundLanes {
        /// K, N/m^1.5.
        stiffness: f64,
        /// D, N s/m^1.5.
        damping: f64,
        /// Coulomb friction coefficient.
        friction: f64,
    }
}

impl From<&GroundParams> for Ground {
    fn from(params: &GroundParams) -> Self {
        Self { stiffness: params.stiffness_n_m15, damping: params.damping_ns_m15, friction: params.friction }
    }
}

lanes! {
    /// Force of the ground on one point, and its derivatives for implicit steps.
    pub struct Contact, ContactLanes {
        /// Penetration depth, m; positive in the ground.
        depth: f64,
        /// Force up on the point, N; never negative.
        normal: f64,
        /// Force forward on the point, N.
        tangential: f64,
        /// Force forward over the root of the depth, N/m^0.5; 0 above ground.
        drag: f64,
        /// -d normal / d upward velocity, N s/m.
        normal_damping: f64,
        /// -d normal / d height, N/m.
        normal_stiffness: f64,
        /// -d tangential / d forward velocity while sticking, N s/m.
        tangential_damping: f64,
        /// -d tangential / d deformation while sticking, N/m.
        tangential_stiffness: f64,
    }
}

/// Contact force at a point of the given height above ground, velocity and tangential deformation (section 3.3).
///
/// On a slope all of them are those along and across the surface.
#[inline(always)]
pub fn contact(ground: &Ground, height: f64, vx: f64, vy: f64, deformation: f64) -> Contact {
    let depth = max(-height, 0.0);
    let root = depth.sqrt();
    // Forces over the root of the depth: K z - D y' and K u + D x'.
    let pressing = (ground.stiffness * depth).minus(ground.damping, vy);
    let pushes = (depth > 0.0) & (pressing > 0.0);
    let push = select(pushes, pressing, 0.0);
    let sticking = -(ground.stiffness * deformation).plus(ground.damping, vx);
    let limit = ground.friction * push;
    let slips = sticking.abs() > limit;
    let drag = select(slips, limit.copysign(sticking), sticking);
    Contact {
        depth,
        normal: root * push,
        tangential: root * drag,
        drag: select(depth > 0.0, drag, 0.0),
        normal_damping: select(pushes, root * ground.damping, 0.0),
        // The term -D vy / (2 root) of the exact derivative is left out: it is infinite at touch-down.
        normal_stiffness: select(pushes, 1.5 * ground.stiffness * root, 0.0),
        tangential_damping: select(slips, 0.0, root * ground.damping),
        tangential_stiffness: select(slips, 0.0, root * ground.stiffness),
    }
}

/// Rate of the tangential deformation: stick follows the point, slip and flight relax (Azad & Featherstone 2010).
///
/// `vx` is the point's forward velocity at the end of an implicit step of length `step` (0 for the plain derivative).
#[inline(always)]
pub fn deformation_rate(ground: &Ground, contact: &Contact, deformation: f64, vx: f64, step: f64) -> f64 {
    let sticks = contact.tangential_damping > 0.0;
    let relaxation = -contact.drag.plus(ground.stiffness, deformation) / ground.damping.plus(step, ground.stiffness);
    select(sticks, vx, relaxation)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ground() -> Ground {
        Ground::from(&GroundParams::default())
    }

    #[test]
    fn body_weight_sinks_fifteen_millimetres_over_two_points_as_the_paper_says() {
        // K z^1.5 = 375 N per point gives 15 mm (section 3.3: "approximately 1.5 cm").
        let per_point = contact(&ground(), -0.0152, 0.0, 0.0, 0.0).normal;
        assert!((per_point - 375.0).abs() < 5.0, "{per_point}");
    }

    #[test]
    fn ground_never_pulls_and_friction_stays_in_its_cone() {
        let ground = ground();
        for i in 0..2000 {
            let f = f64::from(i);
            let (height, vx, vy, u) =
                ((f * 0.7).sin() * 0.02, (f * 1.3).sin(), (f * 2.9).sin() * 2.0, (f * 0.37).sin() * 0.01);
            let c = contact(&ground, height, vx, vy, u);
            assert!(c.normal >= 0.0);
            assert!(c.tangential.abs() <= 0.5 * c.normal * (1.0 + 1e-15));
            assert!(height < 0.0 || c.normal == 0.0);
        }
    }

    #[test]
    fn derivatives_match_differences() {
        let ground = ground();
        let (height, vx, vy, u, e) = (-0.012, 0.01, -0.1, 2e-4, 1e-7);
        let exact = contact(&ground, height, vx, vy, u);
        let slope = |plus: Contact, minus: Contact| {
            ((plus.normal - minus.normal) / (2.0 * e), (plus.tangential - minus.tangential) / (2.0 * e))
        };
        let (_, along_vx) = slope(contact(&ground, height, vx + e, vy, u), contact(&ground, height, vx - e, vy, u));
        let (_, along_u) = slope(contact(&ground, height, vx, vy, u + e), contact(&ground, height, vx, vy, u - e));
        let (along_vy, _) = slope(contact(&ground, height, vx, vy + e, u), contact(&ground, height, vx, vy - e, u));
        assert!((exact.tangential_damping + along_vx).abs() < 1e-5 * exact.tangential_damping);
        assert!((exact.tangential_stiffness + along_u).abs() < 1e-5 * exact.tangential_stiffness);
        assert!((exact.normal_damping + along_vy).abs() < 1e-5 * exact.normal_damping);
        // The term in vy is left out on purpose, so compare at rest.
        let (along_y, _) = slope(contact(&ground, height + e, vx, 0.0, u), contact(&ground, height - e, vx, 0.0, u));
        assert!((exact.normal_stiffness + along_y).abs() < 1e-5 * exact.normal_stiffness);
    }

    #[test]
    fn a_slipping_point_keeps_its_force_on_the_cone_because_its_deformation_follows() {
        let ground = ground();
        let (height, vx) = (-0.01, 1.0);
        let mut u = 0.0;
        for _ in 0..20_000 {
            let c = contact(&ground, height, vx, 0.0, u);
            u += 1e-4 * deformation_rate(&ground, &c, u, vx, 0.0);
        }
        let c = contact(&ground, height, vx, 0.0, u);
        assert!((c.tangential + 0.5 * c.normal).abs() < 1e-9);
        // In equilibrium the spring alone carries the friction: K u = mu fn / root.
        assert!((ground.stiffness * u * 0.1 - 0.5 * c.normal).abs() < 1e-3 * c.normal);
    }
}
