//! End stops of the knee: neo-Hookean rubber with damping (section 5.2.1; lambda falls with compression, the torque resists).

use crate::numerics::lanes::lanes;
use crate::numerics::math::{FusedSum, max, select};
use crate::schema::params::{above, params, within};

params! {
    /// Rubber end stops of the knee (section 5.2.1).
    pub struct EndStopParams {
        /// Knee flexion below which the extension stop is compressed.
        extension_angle_deg: f64 = 3.0, "deg", within(-30.0, 60.0);
        /// Knee flexion above which the flexion stop is compressed.
        flexion_angle_deg: f64 = 115.0, "deg", within(60.0, 170.0);
        /// Thickness d of the rubber.
        thickness_deg: f64 = 2.0, "deg", above(0.0, 30.0);
        /// Torque at half compression.
        half_compression_torque_nm: f64 = 100.0, "N m", within(0.0, 1e4);
        /// Damping time constant t_c.
        damping_time_s: f64 = 0.01, "s", within(0.0, 1.0);
    }
}

lanes! {
    /// End-stop constants of one walker, SI.
    pub struct EndStop, EndStopLanes {
        /// Knee flexion at contact with the extension stop, rad.
        extension: f64,
        /// Knee flexion at contact with the flexion stop, rad.
        flexion: f64,
        /// 1 / thickness, 1/rad.
        inverse_thickness: f64,
        /// 2/7 of the torque at half compression, N m: lambda - lambda^-2 is -7/2 there.
        scale: f64,
        /// Damping time constant, s.
        damping_time: f64,
    }
}

impl From<&EndStopParams> for EndStop {
    fn from(p: &EndStopParams) -> Self {
        Self {
            extension: p.extension_angle_deg.to_radians(),
            flexion: p.flexion_angle_deg.to_radians(),
            inverse_thickness: 1.0 / p.thickness_deg.to_radians(),
            scale: 2.0 / 7.0 * p.half_compression_torque_nm,
            damping_time: p.damping_time_s,
        }
    }
}

/// Resisting torque with its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Resisting torque, N m, never negative.
    pub torque: f64,
    /// d torque / d compression rate, N m s/rad, never negative.
    pub damping: f64,
    /// d torque / d compression, N m/rad, never negative.
    pub stiffness: f64,
}

impl Stop {
    /// No contact.
    pub const NONE: Self = Self { torque: 0.0, damping: 0.0, stiffness: 0.0 };
}

/// The extension ratio is kept above this: the law diverges at 0.
const SMALLEST_RATIO: f64 = 0.05;

/// Rubber compressed by `compression` rad (no force where negative) at `rate` rad/s.
#[inline(always)]
pub fn rubber(stop: &EndStop, compression: f64, rate: f64) -> Stop {
    let touches = compression > 0.0;
    let ratio = max(1.0_f64.minus(max(compression, 0.0), stop.inverse_thickness), SMALLEST_RATIO);
    let ratio_rate = -rate * stop.inverse_thickness;
    let inverse = 1.0 / ratio;
    let inverse2 = inverse * inverse;
    let slope = 1.0_f64.plus(2.0 * inverse2, inverse);
    let torque = -stop.scale * ((ratio - inverse2).plus(stop.damping_time * ratio_rate, slope));
    let pushes = touches & (torque > 0.0);
    // d/d compression of the damping part is 6 rate / (d ratio^4) >= 0 while compressing; leave it out while releasing.
    let progressive = 6.0 * stop.damping_time * max(rate, 0.0) * stop.inverse_thickness * inverse2 * inverse2;
    let gain = stop.scale * stop.inverse_thickness;
    Stop {
        torque: select(pushes, torque, 0.0),
        damping: select(pushes, gain * stop.damping_time * slope, 0.0),
        stiffness: select(pushes, gain * (slope + progressive), 0.0),
    }
}

/// Extension stop at the given knee flexion (rad) and flexion rate (rad/s).
#[inline(always)]
pub fn extension_stop(stop: &EndStop, flexion: f64, flexion_rate: f64) -> Stop {
    rubber(stop, stop.extension - flexion, -flexion_rate)
}

/// Flexion stop at the given knee flexion (rad) and flexion rate (rad/s).
#[inline(always)]
pub fn flexion_stop(stop: &EndStop, flexion: f64, flexion_rate: f64) -> Stop {
    rubber(stop, flexion - stop.flexion, flexion_rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_compression_gives_the_stated_torque() {
        let stop = EndStop::from(&EndStopParams::default());
        let half = 1.0_f64.to_radians();
        assert!((extension_stop(&stop, 3.0_f64.to_radians() - half, 0.0).torque - 100.0).abs() < 1e-9);
        assert!((flexion_stop(&stop, 115.0_f64.to_radians() + half, 0.0).torque - 100.0).abs() < 1e-9);
    }

    #[test]
    fn a_stop_never_pulls_and_is_silent_before_contact() {
        let stop = EndStop::from(&EndStopParams::default());
        for i in 0..1000 {
            let flexion = (f64::from(i) * 0.13).sin() * 0.1;
            let rate = (f64::from(i) * 0.71).sin() * 20.0;
            let s = extension_stop(&stop, flexion, rate);
            assert!(s.torque >= 0.0 && s.torque.is_finite());
            assert!(flexion < stop.extension || s.torque == 0.0);
        }
    }

    #[test]
    fn derivatives_match_differences_while_compressing() {
        let stop = EndStop::from(&EndStopParams::default());
        for (compression, rate) in [(0.01, 0.5), (0.02, 3.0), (0.03, 1.0)] {
            let at = |c: f64, r: f64| rubber(&stop, c, r).torque;
            let exact = rubber(&stop, compression, rate);
            let e = 1e-7;
            let stiffness = (at(compression + e, rate) - at(compression - e, rate)) / (2.0 * e);
            let damping = (at(compression, rate + e) - at(compression, rate - e)) / (2.0 * e);
            assert!((exact.stiffness / stiffness - 1.0).abs() < 1e-5);
            assert!((exact.damping / damping - 1.0).abs() < 1e-5);
        }
    }
}
