//! Reference controller of the motor knee: state machine with impedances (Figure 10; thresholds of the supplementary material).

use crate::prosthesis::gait::Phase;
use crate::schema::params::{params, within};
use crate::signals::Readings;

params! {
    /// State machine and impedances of Figure 10. Currents in A, positive where they flex the knee; angles of knee flexion.
    pub struct MotorFsmParams {
        /// Ankle moment that begins mid stance.
        mid_stance_moment_nm_kg: f64 = 0.25, "N m/kg", within(-5.0, 5.0);
        /// Ankle moment below which mid stance returns to early stance.
        early_stance_moment_nm_kg: f64 = -0.1, "N m/kg", within(-5.0, 5.0);
        /// Ankle moment that begins late stance.
        late_stance_moment_nm_kg: f64 = 0.75, "N m/kg", within(-5.0, 5.0);
        /// Ankle moment below which late stance returns to mid stance.
        lost_late_stance_moment_nm_kg: f64 = 0.4, "N m/kg", within(-5.0, 5.0);
        /// Rate of the ankle moment that begins swing.
        swing_moment_rate_nm_kg_s: f64 = -2.0, "N m/kg/s", within(-100.0, 0.0);
        /// Ankle moment that ends swing.
        heel_strike_moment_nm_kg: f64 = -0.05, "N m/kg", within(-5.0, 5.0);
        /// Flexion that swing must reach before it turns to extension.
        swing_flexion_deg: f64 = 50.0, "deg", within(0.0, 120.0);
        /// Stiffness in early stance.
        early_stance_a_deg: f64 = 0.15, "A/deg", within(0.0, 10.0);
        /// Stiffness in mid stance.
        mid_stance_a_deg: f64 = 0.5, "A/deg", within(0.0, 10.0);
        /// Equilibrium of both.
        stance_angle_deg: f64 = 4.0, "deg", within(-20.0, 60.0);
        /// Stiffness in swing flexion.
        swing_flexion_a_deg: f64 = 0.02, "A/deg", within(0.0, 10.0);
        /// Its equilibrium.
        swing_flexion_angle_deg: f64 = 65.0, "deg", within(0.0, 120.0);
        /// Stiffness in swing extension, about 0 deg.
        swing_extension_a_deg: f64 = 0.02, "A/deg", within(0.0, 10.0);
        /// Damping on the motor speed in swing extension near full extension.
        swing_extension_as_rad: f64 = 0.01, "A s/rad", within(0.0, 10.0);
        /// Flexion below which that damping acts.
        braking_angle_deg: f64 = 15.0, "deg", within(-20.0, 60.0);
        /// Flexion above which the full extending current is applied in any state.
        largest_flexion_deg: f64 = 55.0, "deg", within(0.0, 150.0);
    }
}

impl MotorFsmParams {
    /// Takes one sample and returns the commanded current (A), within the given limit.
    pub fn update(&self, phase: &mut Phase, current_limit: f64, readings: &Readings) -> f64 {
        if let Some(next) = self.next(*phase, readings) {
            *phase = next;
        }
        let angle = readings.knee_angle.to_degrees();
        let stance_error = angle - self.stance_angle_deg;
        let braking = if angle < self.braking_angle_deg { self.swing_extension_as_rad } else { 0.0 };
        let current = match *phase {
            _ if angle > self.largest_flexion_deg => -current_limit,
            Phase::EarlyStance => -self.early_stance_a_deg * stance_error,
            Phase::MidStance => -self.mid_stance_a_deg * stance_error,
            Phase::LateStance => 0.0,
            Phase::SwingFlexion => -self.swing_flexion_a_deg * (angle - self.swing_flexion_angle_deg),
            Phase::SwingExtension => -self.swing_extension_a_deg * angle - braking * readings.motor_speed,
        };
        current.clamp(-current_limit, current_limit)
    }

    fn next(&self, phase: Phase, readings: &Readings) -> Option<Phase> {
        use Phase::{EarlyStance, LateStance, MidStance, SwingExtension, SwingFlexion};
        let moment = readings.ankle_moment_nm_kg;
        match phase {
            EarlyStance | MidStance if moment > self.late_stance_moment_nm_kg => Some(LateStance),
            EarlyStance if moment > self.mid_stance_moment_nm_kg => Some(MidStance),
            MidStance if moment < self.early_stance_moment_nm_kg => Some(EarlyStance),
            LateStance if moment < self.lost_late_stance_moment_nm_kg => Some(MidStance),
            LateStance if readings.ankle_moment_rate < self.swing_moment_rate_nm_kg_s => Some(SwingFlexion),
            SwingFlexion if readings.knee_angle.to_degrees() > self.swing_flexion_deg && readings.knee_speed < 0.0 => {
                Some(SwingExtension)
            }
            SwingExtension if moment < self.heel_strike_moment_nm_kg => Some(EarlyStance),
            _ => None,
        }
    }
}
