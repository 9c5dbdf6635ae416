//! Noise as a function of (seed, sample, channel, use): it has no state, so that no option and no neighbour shifts it.

use crate::numerics::math::{SPLITMIX_STEP, ln, scramble, sin_cos};

/// What a random number is for.
#[derive(Clone, Copy, Debug)]
pub enum Use {
    /// Bias of the episode.
    Bias,
    /// White noise.
    Noise,
    /// Drop-out.
    DropOut,
}
const USES: u64 = 3;
/// Channels that may share a seed.
const CHANNELS: u64 = 64;

/// 64 random bits: output `index` of SplitMix64 (Steele, Lea & Flood 2014) seeded with `seed`.
#[inline(always)]
pub fn bits(seed: u64, sample: u64, channel: usize, purpose: Use) -> u64 {
    let index = (sample * CHANNELS + channel as u64) * USES + purpose as u64;
    scramble(seed.wrapping_add(index.wrapping_add(1).wrapping_mul(SPLITMIX_STEP)))
}

const UNIT: f64 = 1.0 / 4_294_967_296.0; // 2^-32

/// Uniform in [0, 1), in steps of 2^-32.
#[inline(always)]
pub fn uniform(bits: u64) -> f64 {
    (bits >> 32) as f64 * UNIT
}

/// Standard normal (Box & Muller 1958); at most 6.8.
#[inline(always)]
pub fn normal(bits: u64) -> f64 {
    let radius = (-2.0 * ln(uniform(bits) + 0.5 * UNIT)).sqrt();
    let (_, cosine) = sin_cos(std::f64::consts::TAU * uniform(bits << 32));
    radius * cosine
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_has_the_moments_and_tails_of_the_normal_distribution() {
        const COUNT: u64 = 400_000;
        let draws: Vec<f64> = (0..COUNT).map(|sample| normal(bits(7, sample, 3, Use::Noise))).collect();
        let moment = |power: i32| draws.iter().map(|x| x.powi(power)).sum::<f64>() / COUNT as f64;
        for (power, expected, tolerance) in [(1, 0.0, 0.008), (2, 1.0, 0.012), (3, 0.0, 0.03), (4, 3.0, 0.08)] {
            assert!((moment(power) - expected).abs() < tolerance, "moment {power}: {}", moment(power));
        }
        let beyond = draws.iter().filter(|x| x.abs() > 1.959_964).count() as f64 / COUNT as f64;
        assert!((beyond - 0.05).abs() < 0.002, "{beyond}");
    }

    #[test]
    fn samples_channels_uses_and_seeds_are_uncorrelated() {
        const COUNT: u64 = 100_000;
        let draw = |seed, sample, channel, purpose| normal(bits(seed, sample, channel, purpose));
        let correlation = |other: &dyn Fn(u64) -> f64| {
            (0..COUNT).map(|i| draw(7, i, 3, Use::Noise) * other(i)).sum::<f64>() / COUNT as f64
        };
        assert!(correlation(&|i| draw(7, i + 1, 3, Use::Noise)).abs() < 0.015);
        assert!(correlation(&|i| draw(7, i, 4, Use::Noise)).abs() < 0.015);
        assert!(correlation(&|i| draw(7, i, 3, Use::DropOut)).abs() < 0.015);
        assert!(correlation(&|i| draw(8, i, 3, Use::Noise)).abs() < 0.015);
    }
}
