//! Reference controller of the damper knee: state machine of Figure 6 (T12, T23 and T45 test the knee's angular velocity).

use serde::{Deserialize, Serialize};

use crate::params::{ANY, params, within};
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

/// Phase of the gait as the prosthesis sees it (numbers of Figure 6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum Phase {
    /// 1: knee flexes under load.
    #[default]
    EarlyStance = 1,
    /// 2: knee extends under load.
    MidStance,
    /// 3: push-off.
    LateStance,
    /// 4: swing, knee flexing.
    SwingFlexion,
    /// 5: swing, knee extending.
    SwingExtension,
}

/// State of the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DamperFsm {
    /// Current phase.
    pub phase: Phase,
    /// Samples since the phase began.
    in_phase: u32,
    /// Samples for which the knee has been extended, counted from the first.
    extended: u32,
}

impl DamperFsm {
    /// Takes one sample and returns the commanded damping coefficient, N m s^2/rad^2.
    pub fn update(&mut self, params: &DamperFsmParams, readings: &Readings) -> f64 {
        let extended = readings.knee_angle < params.extended_angle_deg.to_radians();
        self.extended = if extended { self.extended + 1 } else { 0 };
        self.in_phase += 1;
        if let Some(next) = self.next(params, readings, extended) {
            self.phase = next;
            self.in_phase = 0;
        }
        Self::damping(params, self.phase, readings.knee_angle)
    }

    fn next(&self, params: &DamperFsmParams, readings: &Readings, extended: bool) -> Option<Phase> {
        use Phase::{EarlyStance, LateStance, MidStance, SwingExtension, SwingFlexion};
        const RECOVERY_SPEED: f64 = std::f64::consts::FRAC_PI_2; // 90 deg/s
        let seconds = |samples: u32| f64::from(samples) * CONTROL_PERIOD_S;
        let extended_longer = |time: f64| extended && seconds(self.extended - 1) > time + 1e-9;
        let in_phase_longer = |time: f64| seconds(self.in_phase) > time + 1e-9;

        let flexing = readings.knee_speed > 0.0;
        let extending = readings.knee_speed < 0.0;
        let flexed = readings.knee_angle > params.extended_angle_deg.to_radians();
        let loaded = readings.tube_force_bw > params.loaded_bw;
        let unloaded = readings.tube_force_bw < params.loaded_bw;
        let recovery = params.recovery;
        let slips_into_swing = recovery && unloaded && flexed;
        match self.phase {
            EarlyStance | MidStance if slips_into_swing => Some(SwingFlexion),
            EarlyStance if extending && extended_longer(0.05) => Some(MidStance),
            MidStance if recovery && (readings.knee_speed > RECOVERY_SPEED || (flexing && flexed)) => Some(EarlyStance),
            MidStance
                if readings.tube_moment_nm_kg > params.push_off_moment_nm_kg && flexing && extended_longer(0.1) =>
            {
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

    fn damping(params: &DamperFsmParams, phase: Phase, knee_angle: f64) -> f64 {
        match phase {
            Phase::EarlyStance | Phase::MidStance => params.stance_damping_nms2_rad2,
            Phase::LateStance => 0.0,
            Phase::SwingFlexion => {
                params.flexion_gain * (knee_angle - params.flexion_angle_deg.to_radians()).max(0.0).powi(2)
            }
            Phase::SwingExtension => {
                params.extension_gain * (params.extended_angle_deg.to_radians() - knee_angle).max(0.0).powi(2)
            }
        }
    }
}
