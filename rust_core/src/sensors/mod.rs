//! Prosthesis sensors (section 5.2): sampled at 200 Hz and held, each with its imperfections.
//!
//! Knee speed and rate of the ankle moment are computed from readings, so they inherit the imperfections of those.

mod channel;
pub mod params;

use crate::numerics::lanes::lanes;
use crate::signals::{CONTROL_PERIOD_S, MeasurandLanes, ReadingsLanes};
use channel::{Channel, Kind};
use params::Imperfections;
pub use params::SensorParams;

/// Which sensor reads which quantities, in the order of the channels.
macro_rules! channels {
    ($($quantity:ident: $sensor:ident,)+) => {
        const CHANNELS: usize = [$(stringify!($quantity)),+].len();

        fn imperfections(params: &SensorParams) -> [Imperfections; CHANNELS] {
            [$(Imperfections::from(&params.$sensor)),+]
        }

        #[inline(always)]
        fn measured<const L: usize>(truth: &MeasurandLanes<L>) -> [&[f64; L]; CHANNELS] {
            [$(&truth.$quantity),+]
        }

        #[inline(always)]
        fn received<const L: usize>(readings: &mut ReadingsLanes<L>) -> [&mut [f64; L]; CHANNELS] {
            [$(&mut readings.$quantity),+]
        }
    };
}

// New quantities go to the end: the position of a quantity is part of its noise.
channels! {
    knee_angle: knee_encoder,
    tube_force_bw: tube_force,
    tube_moment_nm_kg: tube_moment,
    shank_angle: shank_inclination,
    shank_rate: shank_rate,
    shank_force_x: shank_specific_force,
    shank_force_y: shank_specific_force,
    thigh_rate: thigh_rate,
    thigh_force_x: thigh_specific_force,
    thigh_force_y: thigh_specific_force,
    ankle_moment_nm_kg: ankle_moment,
    motor_position: motor_position,
    motor_speed: motor_speed,
    motor_current: motor_current,
}

impl SensorParams {
    /// Memory of the samples under way to one walker's controller.
    pub fn bytes_under_way(&self) -> usize {
        imperfections(self).iter().map(|channel| (channel.delay_samples + 1) * size_of::<f64>()).sum()
    }
}

lanes! {
    /// First-order Butterworth low-pass by the bilinear transform, y = decay y + gain (x + x_previous), on a backward difference.
    pub struct FilteredRate, FilteredRateLanes {
        /// Of the last filtered rate.
        decay: f64,
        /// Of the last two differences.
        gain: f64,
    }
}

impl FilteredRate {
    fn new(cutoff_hz: f64) -> Self {
        let warped = (std::f64::consts::PI * cutoff_hz * CONTROL_PERIOD_S).tan();
        Self { decay: (1.0 - warped) / (1.0 + warped), gain: warped / (1.0 + warped) }
    }

    /// Takes the next value.
    #[inline(always)]
    fn next(&self, value: f64, last: &RateMemory) -> RateMemory {
        let difference = (value - last.value) / CONTROL_PERIOD_S;
        RateMemory { value, difference, rate: self.decay * last.rate + self.gain * (difference + last.difference) }
    }
}

lanes! {
    /// What a filtered rate remembers between samples.
    pub struct RateMemory, RateMemoryLanes {
        /// Last value.
        value: f64,
        /// Its last backward difference, per second.
        difference: f64,
        /// Its last filtered rate, per second.
        rate: f64,
    }
}

/// Constants of the sensors of a block of walkers.
#[derive(Clone, Debug)]
pub struct SensorModel<const L: usize> {
    imu: ImuLanes<L>,
    channels: [Kind<L>; CHANNELS],
    knee_filter: FilteredRateLanes<L>,
    ankle_filter: FilteredRateLanes<L>,
}

lanes! {
    /// Places of the inertial sensors.
    pub struct Imu, ImuLanes {
        /// Below the hip, m.
        thigh: f64,
        /// Below the knee, m.
        shank: f64,
    }
}

impl From<&SensorParams> for Imu {
    fn from(params: &SensorParams) -> Self {
        Self { thigh: params.thigh_imu_m, shank: params.shank_imu_m }
    }
}

impl<const L: usize> SensorModel<L> {
    /// Sensors with the given parameters, the same for all walkers.
    pub fn new(params: &SensorParams) -> Self {
        let imperfections = imperfections(params);
        Self {
            imu: ImuLanes::splat(Imu::from(params)),
            channels: std::array::from_fn(|index| Kind::new(index, imperfections[index])),
            knee_filter: FilteredRateLanes::splat(FilteredRate::new(params.knee_speed_cutoff_hz)),
            ankle_filter: FilteredRateLanes::splat(FilteredRate::new(params.ankle_moment_rate_cutoff_hz)),
        }
    }

    /// Gives the walker in `lane` sensors of its own.
    pub fn set(&mut self, lane: usize, params: &SensorParams) {
        self.imu.set(lane, Imu::from(params));
        for (channel, imperfections) in self.channels.iter_mut().zip(imperfections(params)) {
            channel.set(lane, imperfections);
        }
        self.knee_filter.set(lane, FilteredRate::new(params.knee_speed_cutoff_hz));
        self.ankle_filter.set(lane, FilteredRate::new(params.ankle_moment_rate_cutoff_hz));
    }

    /// Inertial sensors of thigh and shank below hip and knee, m.
    #[inline(always)]
    pub fn imu(&self, lane: usize) -> [f64; 2] {
        [self.imu.thigh[lane], self.imu.shank[lane]]
    }
}

/// What the sensors of a block of walkers keep between samples.
#[derive(Clone, Debug)]
pub struct Sensors<const L: usize> {
    /// Seed of the noise of each lane's episode; takes effect at the start of an episode.
    pub seed: [u64; L],
    /// Samples since the start of the episode.
    count: [u64; L],
    knee: RateMemoryLanes<L>,
    ankle: RateMemoryLanes<L>,
    channels: [Channel<L>; CHANNELS],
}

/// What the sensors of one walker keep between samples.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SensorMemory {
    count: u64,
    knee: RateMemory,
    ankle: RateMemory,
    channels: Vec<(f64, Vec<f64>)>,
}

impl<const L: usize> Default for Sensors<L> {
    /// Sensors that wait for their [`start`](Self::start).
    fn default() -> Self {
        Self {
            seed: [0; L],
            count: [0; L],
            knee: RateMemoryLanes::default(),
            ankle: RateMemoryLanes::default(),
            channels: std::array::from_fn(|_| Channel::default()),
        }
    }
}

impl<const L: usize> Sensors<L> {
    /// What those in `lane` keep.
    pub fn get(&self, lane: usize) -> SensorMemory {
        SensorMemory {
            count: self.count[lane],
            knee: self.knee.get(lane),
            ankle: self.ankle.get(lane),
            channels: self.channels.iter().map(|channel| channel.memory(lane)).collect(),
        }
    }

    /// Puts back what those in `lane` kept.
    pub fn set(&mut self, lane: usize, memory: &SensorMemory) {
        self.count[lane] = memory.count;
        self.knee.set(lane, memory.knee);
        self.ankle.set(lane, memory.ankle);
        for (channel, memory) in self.channels.iter_mut().zip(&memory.channels) {
            channel.remember(lane, memory);
        }
    }

    /// First sample of the lanes that have just been started; filters start at rest there.
    pub fn start(
        &mut self,
        model: &SensorModel<L>,
        started: &[bool; L],
        truth: &MeasurandLanes<L>,
        readings: &mut ReadingsLanes<L>,
    ) {
        let channels = self.channels.iter_mut().zip(&model.channels);
        for (((channel, kind), truth), reading) in channels.zip(measured(truth)).zip(received(readings)) {
            channel.start(kind, &self.seed, truth, started, reading);
        }
        for lane in (0..L).filter(|&lane| started[lane]) {
            self.count[lane] = 0;
            self.knee.set(lane, RateMemory { value: readings.knee_angle[lane], ..RateMemory::default() });
            self.ankle.set(lane, RateMemory { value: readings.ankle_moment_nm_kg[lane], ..RateMemory::default() });
            readings.knee_speed[lane] = 0.0;
            readings.ankle_moment_rate[lane] = 0.0;
        }
    }

    /// One sample of every lane; `readings` holds the last ones.
    #[inline(always)]
    pub fn sample(&mut self, model: &SensorModel<L>, truth: &MeasurandLanes<L>, readings: &mut ReadingsLanes<L>) {
        for count in &mut self.count {
            *count += 1;
        }
        let channels = self.channels.iter_mut().zip(&model.channels);
        for (((channel, kind), truth), reading) in channels.zip(measured(truth)).zip(received(readings)) {
            channel.sample(kind, &self.seed, &self.count, truth, reading);
        }
        for lane in 0..L {
            let knee = model.knee_filter.get(lane).next(readings.knee_angle[lane], &self.knee.get(lane));
            self.knee.set(lane, knee);
            readings.knee_speed[lane] = knee.rate;
            let ankle = model.ankle_filter.get(lane).next(readings.ankle_moment_nm_kg[lane], &self.ankle.get(lane));
            self.ankle.set(lane, ankle);
            readings.ankle_moment_rate[lane] = ankle.rate;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signals::{Measurand, Readings};

    fn run(params: &SensorParams, angle: impl Fn(f64) -> f64, samples: usize) -> Vec<Readings> {
        let model = SensorModel::new(params);
        let mut sensors = Sensors::<1>::default();
        let mut readings = ReadingsLanes::default();
        (0..samples)
            .map(|i| {
                let truth = Measurand { knee_angle: angle(i as f64 * CONTROL_PERIOD_S), ..Measurand::default() };
                let truth = MeasurandLanes::splat(truth);
                if i == 0 {
                    sensors.start(&model, &[true], &truth, &mut readings);
                } else {
                    sensors.sample(&model, &truth, &mut readings);
                }
                readings.get(0)
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
        let mut ideal = SensorParams::default();
        ideal.knee_encoder.resolution = 0.0;
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

    #[test]
    fn every_quantity_reaches_its_reading_through_its_own_sensor() {
        let truth = Measurand {
            knee_angle: 1.0,
            tube_force_bw: 2.0,
            tube_moment_nm_kg: 3.0,
            shank_angle: 4.0,
            shank_rate: 5.0,
            shank_force_x: 6.0,
            shank_force_y: 7.0,
            thigh_rate: 8.0,
            thigh_force_x: 9.0,
            thigh_force_y: 10.0,
            ankle_moment_nm_kg: 11.0,
            motor_position: 12.0,
            motor_speed: 13.0,
            motor_current: 14.0,
        };
        let mut params = SensorParams::default();
        params.knee_encoder.resolution = 0.0;
        params.shank_specific_force.noise = 0.1;
        params.motor_speed.saturation = 12.5;
        let mut readings = ReadingsLanes::default();
        let model = SensorModel::new(&params);
        Sensors::<1>::default().start(&model, &[true], &MeasurandLanes::splat(truth), &mut readings);
        let mut received = received(&mut readings).map(|reading| reading[0]);
        let axes = [received[5] - 6.0, received[6] - 7.0];
        assert!(axes.iter().all(|error| *error != 0.0 && error.abs() < 0.7) && axes[0] != axes[1]);
        (received[5], received[6]) = (6.0, 7.0);
        let expected: [f64; CHANNELS] = std::array::from_fn(|i| if i == 12 { 12.5 } else { (i + 1) as f64 });
        assert_eq!(received, expected);
    }
}
