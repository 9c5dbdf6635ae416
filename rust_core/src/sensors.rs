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
    }
}

/// Sensor constants.
#[derive(Clone, Copy, Debug)]
pub struct Sensors {
    /// Encoder tick, rad; 0 is ideal.
    tick: f64,
    /// Bilinear Butterworth low-pass y = decay y + gain (x + x_previous).
    decay: f64,
    gain: f64,
}

impl From<&SensorParams> for Sensors {
    fn from(p: &SensorParams) -> Self {
        let warped = (std::f64::consts::PI * p.knee_speed_cutoff_hz * CONTROL_PERIOD_S).tan();
        Self {
            tick: if p.knee_encoder_ticks == 0 { 0.0 } else { std::f64::consts::TAU / p.knee_encoder_ticks as f64 },
            decay: (1.0 - warped) / (1.0 + warped),
            gain: warped / (1.0 + warped),
        }
    }
}

lanes! {
    /// What the sensors remember between samples.
    pub struct SensorMemory, SensorMemoryLanes {
        /// Last encoder reading, rad.
        knee_angle: f64,
        /// Last backward difference, rad/s.
        difference: f64,
        /// Last filtered speed, rad/s.
        speed: f64,
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
        SensorMemory { knee_angle: quantise(truth.knee_angle, self.tick), difference: 0.0, speed: 0.0 }
    }

    /// One sample: new memory and what the controller receives.
    #[inline(always)]
    pub fn sample(&self, memory: &SensorMemory, truth: &Measurand) -> (SensorMemory, Readings) {
        let knee_angle = quantise(truth.knee_angle, self.tick);
        let difference = (knee_angle - memory.knee_angle) / CONTROL_PERIOD_S;
        let speed = self.decay * memory.speed + self.gain * (difference + memory.difference);
        let readings = Readings {
            knee_angle,
            knee_speed: speed,
            tube_force_bw: truth.tube_force_bw,
            tube_moment_nm_kg: truth.tube_moment_nm_kg,
            shank_angle: truth.shank_angle,
            shank_rate: truth.shank_rate,
        };
        (SensorMemory { knee_angle, difference, speed }, readings)
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
