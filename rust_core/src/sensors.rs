//! Prosthesis sensors (section 5.2): sampled at 200 Hz and held, the knee encoder quantised.

use crate::lanes::lanes;
use crate::math::select;
use crate::params::{params, within};
use crate::signals::{CONTROL_PERIOD_S, Measurand, Readings};

params! {
    /// Sensors of the prosthesis (section 5.2).
    pub struct SensorParams {
        /// Encoder ticks per revolution of the knee; 0 is an ideal encoder (section 5.2: 2^12).
        knee_encoder_ticks: usize = 4096, "1/rev", within(0.0, 16_777_216.0);
        /// Cut-off of the first-order Butterworth filter on the knee speed.
        knee_speed_cutoff_hz: f64 = 15.0, "Hz", within(0.1, 99.0);
        /// Cut-off of the first-order Butterworth filter on the rate of the ankle moment.
        ankle_moment_rate_cutoff_hz: f64 = 5.0, "Hz", within(0.1, 99.0);
    }
}

/// First-order Butterworth low-pass by the bilinear transform, y = decay y + gain (x + x_previous), on a backward difference.
#[derive(Clone, Copy, Debug)]
struct FilteredRate {
    decay: f64,
    gain: f64,
}

impl FilteredRate {
    fn new(cutoff_hz: f64) -> Self {
        let warped = (std::f64::consts::PI * cutoff_hz * CONTROL_PERIOD_S).tan();
        Self { decay: (1.0 - warped) / (1.0 + warped), gain: warped / (1.0 + warped) }
    }

    /// New backward difference and filtered rate.
    #[inline(always)]
    fn next(&self, value: f64, last_value: f64, last_difference: f64, last_rate: f64) -> (f64, f64) {
        let difference = (value - last_value) / CONTROL_PERIOD_S;
        (difference, self.decay * last_rate + self.gain * (difference + last_difference))
    }
}

/// Sensor constants.
#[derive(Clone, Copy, Debug)]
pub struct Sensors {
    /// Encoder tick, rad; 0 is ideal.
    tick: f64,
    knee_speed: FilteredRate,
    ankle_moment_rate: FilteredRate,
}

impl From<&SensorParams> for Sensors {
    fn from(p: &SensorParams) -> Self {
        Self {
            tick: if p.knee_encoder_ticks == 0 { 0.0 } else { std::f64::consts::TAU / p.knee_encoder_ticks as f64 },
            knee_speed: FilteredRate::new(p.knee_speed_cutoff_hz),
            ankle_moment_rate: FilteredRate::new(p.ankle_moment_rate_cutoff_hz),
        }
    }
}

lanes! {
    /// What the sensors remember between samples.
    pub struct SensorMemory, SensorMemoryLanes {
        /// Last encoder reading, rad.
        knee_angle: f64,
        /// Its last backward difference, rad/s.
        knee_difference: f64,
        /// Last filtered knee speed, rad/s.
        knee_speed: f64,
        /// Last ankle moment, N m/kg.
        ankle_moment: f64,
        /// Its last backward difference, N m/kg/s.
        ankle_difference: f64,
        /// Its last filtered rate, N m/kg/s.
        ankle_moment_rate: f64,
    }
}

/// Rounds to whole ticks; an ideal encoder (tick 0) passes the angle on.
#[inline(always)]
fn quantise(angle: f64, tick: f64) -> f64 {
    let safe_tick = select(tick > 0.0, tick, 1.0);
    select(tick > 0.0, (angle / safe_tick).round_ties_even() * safe_tick, angle)
}

impl Sensors {
    /// Memory at the first sample: filters start at rest there.
    #[inline(always)]
    pub fn start(&self, truth: &Measurand) -> SensorMemory {
        SensorMemory {
            knee_angle: quantise(truth.knee_angle, self.tick),
            ankle_moment: truth.ankle_moment_nm_kg,
            ..SensorMemory::default()
        }
    }

    /// One sample: new memory and what the controller receives.
    #[inline(always)]
    pub fn sample(&self, memory: &SensorMemory, truth: &Measurand) -> (SensorMemory, Readings) {
        let knee_angle = quantise(truth.knee_angle, self.tick);
        let (knee_difference, knee_speed) =
            self.knee_speed.next(knee_angle, memory.knee_angle, memory.knee_difference, memory.knee_speed);
        let ankle_moment = truth.ankle_moment_nm_kg;
        let (ankle_difference, ankle_moment_rate) = self.ankle_moment_rate.next(
            ankle_moment,
            memory.ankle_moment,
            memory.ankle_difference,
            memory.ankle_moment_rate,
        );
        let readings = Readings {
            knee_angle,
            knee_speed,
            tube_force_bw: truth.tube_force_bw,
            tube_moment_nm_kg: truth.tube_moment_nm_kg,
            shank_angle: truth.shank_angle,
            shank_rate: truth.shank_rate,
            ankle_moment_nm_kg: ankle_moment,
            ankle_moment_rate,
            motor_current: truth.motor_current,
            motor_speed: truth.motor_speed,
        };
        let memory =
            SensorMemory { knee_angle, knee_difference, knee_speed, ankle_moment, ankle_difference, ankle_moment_rate };
        (memory, readings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(params: &SensorParams, angle: impl Fn(f64) -> f64, samples: usize) -> Vec<Readings> {
        let sensors = Sensors::from(params);
        let truth = |i: usize| Measurand { knee_angle: angle(i as f64 * CONTROL_PERIOD_S), ..Measurand::default() };
        let mut memory = sensors.start(&truth(0));
        (0..samples)
            .map(|i| {
                let (next, readings) = sensors.sample(&memory, &truth(i));
                memory = next;
                readings
            })
            .collect()
    }

    #[test]
    fn encoder_readings_are_whole_ticks_within_half_a_tick() {
        let tick = std::f64::consts::TAU / 4096.0;
        for reading in run(&SensorParams::default(), |t| 0.5 * (7.0 * t).sin(), 400) {
            let ticks = reading.knee_angle / tick;
            assert!((ticks - ticks.round()).abs() < 1e-9);
        }
        let readings = run(&SensorParams::default(), |t| 0.3 * t, 10);
        for (i, r) in readings.iter().enumerate() {
            assert!((r.knee_angle - 0.3 * i as f64 * CONTROL_PERIOD_S).abs() <= 0.5 * tick + 1e-12);
        }
    }

    #[test]
    fn speed_filter_passes_constant_speed_and_halves_power_at_its_cutoff() {
        let ideal = SensorParams { knee_encoder_ticks: 0, ..SensorParams::default() };
        let ramp = run(&ideal, |t| 2.0 * t, 200);
        assert!((ramp[199].knee_speed - 2.0).abs() < 1e-9);
        let omega = std::f64::consts::TAU * 15.0;
        let peak = run(&ideal, |t| (omega * t).sin() / omega, 2000)[1000..]
            .iter()
            .map(|r| r.knee_speed.abs())
            .fold(0.0, f64::max);
        // 1/sqrt 2 of the filter times the droop of the backward difference.
        let droop = (omega * CONTROL_PERIOD_S / 2.0).sin() / (omega * CONTROL_PERIOD_S / 2.0);
        assert!((peak - droop / 2.0_f64.sqrt()).abs() < 5e-3, "{peak}");
    }
}
