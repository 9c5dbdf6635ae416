//! One quantity on its way from transducer to controller: bias, noise, resolution, saturation, delay, drop-out.
//!
//! Each stage is a branch around a lane loop, taken if any lane has that imperfection: an ideal channel is the same code with
//! every stage skipped, and an ideal lane passes its value on.

use crate::numerics::math::{clamp, select};
use crate::numerics::noise::{self, Use};
use crate::sensors::params::{Imperfections, ImperfectionsLanes};

/// Constants of a channel of a block of walkers.
#[derive(Clone, Debug)]
pub struct Kind<const L: usize> {
    /// Number among the channels, for its noise.
    index: usize,
    imperfections: ImperfectionsLanes<L>,
    /// Largest of every imperfection over the lanes.
    worst: Imperfections,
}

impl<const L: usize> Kind<L> {
    /// Channel number `index`, the same for all walkers.
    pub fn new(index: usize, imperfections: Imperfections) -> Self {
        Self { index, imperfections: ImperfectionsLanes::splat(imperfections), worst: imperfections }
    }

    /// Gives the walker in `lane` a channel of its own.
    pub fn set(&mut self, lane: usize, imperfections: Imperfections) {
        self.imperfections.set(lane, imperfections);
        let largest = |column: &[f64; L]| column.iter().copied().fold(0.0, f64::max);
        self.worst = Imperfections {
            resolution: largest(&self.imperfections.resolution),
            noise: largest(&self.imperfections.noise),
            bias: largest(&self.imperfections.bias),
            delay_samples: self.imperfections.delay_samples.iter().copied().max().unwrap_or(0),
            drop_out: largest(&self.imperfections.drop_out),
            saturation: largest(&self.imperfections.saturation),
        };
    }
}

/// What a channel of a block of walkers keeps between samples.
#[derive(Clone, Debug)]
pub struct Channel<const L: usize> {
    /// Bias of the present episode.
    bias: [f64; L],
    /// Digitised samples under way, a ring; empty without delay.
    line: Vec<[f64; L]>,
    /// Entry of the newest sample.
    newest: usize,
}

impl<const L: usize> Default for Channel<L> {
    fn default() -> Self {
        Self { bias: [0.0; L], line: Vec::new(), newest: 0 }
    }
}

impl<const L: usize> Channel<L> {
    /// First sample of the lanes that have just been started: it counts as having been there all the time before.
    pub fn start(
        &mut self,
        kind: &Kind<L>,
        seed: &[u64; L],
        truth: &[f64; L],
        started: &[bool; L],
        reading: &mut [f64; L],
    ) {
        self.make_room(kind.worst.delay_samples);
        for lane in (0..L).filter(|&lane| started[lane]) {
            let bits = noise::bits(seed[lane], 0, kind.index, Use::Bias);
            self.bias[lane] = kind.imperfections.bias[lane] * noise::normal(bits);
        }
        let value = self.digitise(kind, seed, &[0; L], truth);
        for lane in (0..L).filter(|&lane| started[lane]) {
            self.line.iter_mut().for_each(|sample| sample[lane] = value[lane]);
            reading[lane] = value[lane];
        }
    }

    /// Makes the ring long enough for a delay of that many samples. The entries that it adds hold 0 until samples fill them; no
    /// reading comes from them before, as a walker whose delay is that long fills its own when it starts.
    fn make_room(&mut self, delay: usize) {
        let (length, now) = (if delay > 0 { delay + 1 } else { 0 }, self.line.len());
        if length > now {
            // Newest sample first.
            let kept = (0..now).map(|age| self.line[(self.newest + now - age) % now]);
            let mut line: Vec<_> = kept.collect();
            line.resize(length, [0.0; L]);
            line.reverse();
            (self.line, self.newest) = (line, length - 1);
        }
    }

    /// Sample of `lane` that is so old, oldest first known.
    fn aged(&self, lane: usize, age: usize) -> f64 {
        self.line[(self.newest + self.line.len() - age) % self.line.len()][lane]
    }

    /// What `lane` of the channel remembers: its bias, and its samples under way, newest first.
    pub fn memory(&self, lane: usize) -> (f64, Vec<f64>) {
        (self.bias[lane], (0..self.line.len()).map(|age| self.aged(lane, age)).collect())
    }

    /// Puts back what [`memory`](Self::memory) has given.
    pub fn remember(&mut self, lane: usize, (bias, samples): &(f64, Vec<f64>)) {
        self.make_room(samples.len().saturating_sub(1));
        self.bias[lane] = *bias;
        let length = self.line.len();
        for (age, &sample) in samples.iter().enumerate() {
            self.line[(self.newest + length - age) % length][lane] = sample;
        }
    }

    /// Replaces the last reading by that of a new sample.
    #[inline(always)]
    pub fn sample(
        &mut self,
        kind: &Kind<L>,
        seed: &[u64; L],
        sample: &[u64; L],
        truth: &[f64; L],
        reading: &mut [f64; L],
    ) {
        let mut value = self.digitise(kind, seed, sample, truth);
        if kind.worst.delay_samples > 0 {
            self.newest = (self.newest + 1) % self.line.len();
            self.line[self.newest] = value;
            for lane in 0..L {
                value[lane] = self.aged(lane, kind.imperfections.delay_samples[lane]);
            }
        }
        if kind.worst.drop_out > 0.0 {
            for lane in 0..L {
                let bits = noise::bits(seed[lane], sample[lane], kind.index, Use::DropOut);
                let lost = noise::uniform(bits) < kind.imperfections.drop_out[lane];
                value[lane] = select(lost, reading[lane], value[lane]);
            }
        }
        *reading = value;
    }

    /// What transducer and converter make of the truth.
    #[inline(always)]
    fn digitise(&self, kind: &Kind<L>, seed: &[u64; L], sample: &[u64; L], truth: &[f64; L]) -> [f64; L] {
        let Kind { imperfections: of, worst, .. } = kind;
        let mut value = *truth;
        if worst.bias > 0.0 {
            for lane in 0..L {
                value[lane] = select(of.bias[lane] > 0.0, value[lane] + self.bias[lane], value[lane]);
            }
        }
        if worst.noise > 0.0 {
            for lane in 0..L {
                let bits = noise::bits(seed[lane], sample[lane], kind.index, Use::Noise);
                let noisy = value[lane] + of.noise[lane] * noise::normal(bits);
                value[lane] = select(of.noise[lane] > 0.0, noisy, value[lane]);
            }
        }
        if worst.resolution > 0.0 {
            for lane in 0..L {
                let step = of.resolution[lane];
                let rounded = (value[lane] / step).round_ties_even() * step;
                value[lane] = select(step > 0.0, rounded, value[lane]);
            }
        }
        if worst.saturation > 0.0 {
            for lane in 0..L {
                let limit = of.saturation[lane];
                value[lane] = select(limit > 0.0, clamp(value[lane], -limit, limit), value[lane]);
            }
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLES: u64 = 100_000;

    /// Readings of `truth` over an episode in the second of two lanes.
    fn episode(imperfections: Imperfections, seed: u64, samples: u64, truth: impl Fn(u64) -> f64) -> Vec<f64> {
        let (kind, mut channel) = (Kind::new(5, imperfections), Channel::<2>::default());
        let mut reading = [0.0; 2];
        channel.start(&kind, &[1, seed], &[9.0, truth(0)], &[false, true], &mut reading);
        let mut readings = vec![reading[1]];
        for sample in 1..samples {
            channel.sample(&kind, &[1, seed], &[sample; 2], &[9.0, truth(sample)], &mut reading);
            readings.push(reading[1]);
        }
        readings
    }

    fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64;
        (mean, variance.sqrt())
    }

    #[test]
    fn an_ideal_channel_passes_the_truth_on() {
        let truth = |sample: u64| (sample as f64 * 0.1).sin();
        let readings = episode(Imperfections::default(), 3, 100, truth);
        assert_eq!(readings, (0..100).map(truth).collect::<Vec<_>>());
    }

    #[test]
    fn noise_has_its_mean_and_standard_deviation_and_is_white() {
        let readings = episode(Imperfections { noise: 0.2, ..Imperfections::default() }, 3, SAMPLES, |_| 1.5);
        let (mean, deviation) = mean_and_deviation(&readings);
        assert!((mean - 1.5).abs() < 4.0 * 0.2 / (SAMPLES as f64).sqrt(), "{mean}");
        assert!((deviation / 0.2 - 1.0).abs() < 4.0 / (2.0 * SAMPLES as f64).sqrt(), "{deviation}");
        let neighbours = readings.windows(2).map(|pair| (pair[0] - 1.5) * (pair[1] - 1.5)).sum::<f64>();
        assert!((neighbours / SAMPLES as f64 / 0.04).abs() < 4.0 / (SAMPLES as f64).sqrt());
    }

    #[test]
    fn bias_is_constant_within_an_episode_and_spread_by_its_deviation_between_episodes() {
        let biased = Imperfections { bias: 0.3, ..Imperfections::default() };
        let biases: Vec<f64> = (0..5000_u64)
            .map(|episode_number| {
                let seed = episode_number.wrapping_mul(0x2545_f491_4f6c_dd1d);
                let readings = episode(biased, seed, 4, |_| 0.0);
                assert!(readings.iter().all(|reading| *reading == readings[0]));
                readings[0]
            })
            .collect();
        let (mean, deviation) = mean_and_deviation(&biases);
        assert!(mean.abs() < 4.0 * 0.3 / 5000_f64.sqrt(), "{mean}");
        assert!((deviation / 0.3 - 1.0).abs() < 4.0 / 10_000_f64.sqrt(), "{deviation}");
        assert!(biases.windows(2).all(|pair| pair[0] != pair[1]));
    }

    #[test]
    fn delay_shifts_by_exactly_its_samples() {
        for delay_samples in [1, 3, 7] {
            let delayed = Imperfections { delay_samples, ..Imperfections::default() };
            let readings = episode(delayed, 3, 60, |sample| 10.0 + sample as f64);
            for (sample, reading) in readings.iter().enumerate() {
                assert_eq!(*reading, 10.0 + sample.saturating_sub(delay_samples) as f64);
            }
        }
    }

    #[test]
    fn drop_out_holds_the_last_reading_as_often_as_asked() {
        let lossy = Imperfections { drop_out: 0.25, ..Imperfections::default() };
        let readings = episode(lossy, 3, SAMPLES, |sample| sample as f64);
        let mut held = 0;
        for (sample, pair) in readings.windows(2).enumerate() {
            assert!(pair[1] == pair[0] || pair[1] == (sample + 1) as f64);
            held += u64::from(pair[1] == pair[0]);
        }
        assert!((held as f64 / SAMPLES as f64 - 0.25).abs() < 4.0 * (0.25 * 0.75 / SAMPLES as f64).sqrt());
        let dead = Imperfections { drop_out: 1.0, ..Imperfections::default() };
        assert!(episode(dead, 3, 100, |sample| 1.0 + sample as f64).iter().all(|reading| *reading == 1.0));
    }

    #[test]
    fn resolution_rounds_to_the_nearest_step_and_saturation_clips() {
        let coarse = Imperfections { resolution: 0.25, saturation: 1.0, ..Imperfections::default() };
        let truth = [0.1, 0.13, 0.3, -0.4, 0.99, 1.4, -7.0];
        let readings = episode(coarse, 3, truth.len() as u64, |sample| truth[sample as usize]);
        assert_eq!(readings, [0.0, 0.25, 0.25, -0.5, 1.0, 1.0, -1.0]);
    }

    #[test]
    fn a_lane_that_starts_leaves_the_samples_of_its_neighbours_alone() {
        let imperfections = Imperfections { delay_samples: 2, noise: 0.1, bias: 0.1, ..Imperfections::default() };
        let undisturbed = episode(imperfections, 3, 20, |sample| sample as f64);
        let (kind, mut channel) = (Kind::new(5, imperfections), Channel::<2>::default());
        let mut reading = [0.0; 2];
        channel.start(&kind, &[1, 3], &[0.0, 0.0], &[true; 2], &mut reading);
        for sample in 1..20 {
            channel.sample(&kind, &[1, 3], &[sample, sample], &[0.0, sample as f64], &mut reading);
            channel.start(&kind, &[1, 3], &[0.0, sample as f64], &[true, false], &mut reading);
            assert_eq!(reading[1], undisturbed[sample as usize]);
        }
    }
}
