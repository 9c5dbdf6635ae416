//! Reference controller of the damper knee: state machine of Figure 6 (T12, T23 and T45 test the knee's angular velocity).

use crate::prosthesis::gait::{GaitMemory, Phase};
use crate::schema::params::{ANY, params, within};
use crate::signals::{CONTROL_PERIOD_S, Readings};

params! {
    /// State machine of Figure 6 with its recovery transitions (supplementary material).
    pub struct DamperFsmParams {
        /// Whether the dashed (recovery) transitions are active.
        recovery: bool = true, "", ANY;
        /// Damping in early and mid stance (20 in the supplementary material).
        stance_damping_nms2_rad2: f64 = 10.0, "N m s^2/rad^2", within(0.0, 1e4);
        /// Gain of the soft stop of swing flexion, on (angle - 60 deg)^2.
        flexion_gain: f64 = 50.0, "N m s^2/rad^4", within(0.0, 1e6);
        /// Knee flexion where that soft stop starts.
        flexion_angle_deg: f64 = 60.0, "deg", within(0.0, 150.0);
        /// Gain of the soft stop of swing extension, on (15 deg - angle)^2.
        extension_gain: f64 = 200.0, "N m s^2/rad^4", within(0.0, 1e6);
        /// Knee flexion where that soft stop starts; also the angle that counts as extended.
        extended_angle_deg: f64 = 15.0, "deg", within(0.0, 60.0);
        /// Tube force that counts as loaded.
        loaded_bw: f64 = 0.05, "N/N", within(0.0, 2.0);
        /// Tube moment that announces push-off.
        push_off_moment_nm_kg: f64 = 0.5, "N m/kg", within(-2.0, 2.0);
    }
}

impl DamperFsmParams {
    /// Takes one sample and returns the commanded damping coefficient, N m s^2/rad^2.
    pub fn update(&self, memory: &mut GaitMemory, readings: &Readings) -> f64 {
        let extended = readings.knee_angle < self.extended_angle_deg.to_radians();
        memory.extended = if extended { memory.extended.saturating_add(1) } else { 0 };
        memory.in_phase = memory.in_phase.saturating_add(1);
        if let Some(next) = self.next(memory, readings, extended) {
            memory.phase = next;
            memory.in_phase = 0;
        }
        self.damping(memory.phase, readings.knee_angle)
    }

    fn next(&self, memory: &GaitMemory, readings: &Readings, extended: bool) -> Option<Phase> {
        use Phase::{EarlyStance, LateStance, MidStance, SwingExtension, SwingFlexion};
        const RECOVERY_SPEED: f64 = std::f64::consts::FRAC_PI_2; // 90 deg/s
        let seconds = |samples: u32| f64::from(samples) * CONTROL_PERIOD_S;
        let extended_longer = |time: f64| extended && seconds(memory.extended - 1) > time + 1e-9;
        let in_phase_longer = |time: f64| seconds(memory.in_phase) > time + 1e-9;

        let flexing = readings.knee_speed > 0.0;
        let extending = readings.knee_speed < 0.0;
        let flexed = readings.knee_angle > self.extended_angle_deg.to_radians();
        let loaded = readings.tube_force_bw > self.loaded_bw;
        let unloaded = readings.tube_force_bw < self.loaded_bw;
        let recovery = self.recovery;
        let slips_into_swing = recovery && unloaded && flexed;
        match memory.phase {
            EarlyStance | MidStance if slips_into_swing => Some(SwingFlexion),
            EarlyStance if extending && extended_longer(0.05) => Some(MidStance),
            MidStance if recovery && (readings.knee_speed > RECOVERY_SPEED || (flexing && flexed)) => Some(EarlyStance),
            MidStance if readings.tube_moment_nm_kg > self.push_off_moment_nm_kg && flexing && extended_longer(0.1) => {
                Some(LateStance)
            }
            LateStance
                if recovery && ((loaded && flexed && readings.tube_moment_nm_kg < 0.1) || in_phase_longer(0.6)) =>
            {
                Some(EarlyStance)
            }
            LateStance if unloaded || flexed => Some(SwingFlexion),
            SwingFlexion if extending => Some(SwingExtension),
            SwingFlexion
                if recovery
                    && loaded
                    && in_phase_longer(0.05)
                    && readings.knee_speed < 30_f64.to_radians()
                    && readings.knee_angle < 20_f64.to_radians() =>
            {
                Some(EarlyStance)
            }
            SwingExtension
                if loaded && (!recovery || (readings.knee_angle < 50_f64.to_radians() && in_phase_longer(0.05))) =>
            {
                Some(EarlyStance)
            }
            _ => None,
        }
    }

    fn damping(&self, phase: Phase, knee_angle: f64) -> f64 {
        match phase {
            Phase::EarlyStance | Phase::MidStance => self.stance_damping_nms2_rad2,
            Phase::LateStance => 0.0,
            Phase::SwingFlexion => {
                self.flexion_gain * (knee_angle - self.flexion_angle_deg.to_radians()).max(0.0).powi(2)
            }
            Phase::SwingExtension => {
                self.extension_gain * (self.extended_angle_deg.to_radians() - knee_angle).max(0.0).powi(2)
            }
        }
    }
}
