//! Schema of the sensors: one section per sensor, each with the same keys in the sensor's own unit.

use crate::numerics::lanes::lanes;
use crate::schema::params::{params, within};

lanes! {
    /// Imperfections of one sensor, in its own unit; zero is ideal.
    pub struct Imperfections, ImperfectionsLanes {
        /// Step between readings.
        resolution: f64,
        /// Standard deviation of white noise.
        noise: f64,
        /// Standard deviation of the bias between episodes.
        bias: f64,
        /// Samples by which readings come late.
        delay_samples: usize,
        /// Probability of a sample to be lost.
        drop_out: f64,
        /// Largest magnitude of a reading.
        saturation: f64,
    }
}

/// Parameters of each sensor: name, meaning, unit, default resolution and upper end of the ranges.
macro_rules! sensors {
    ($($Name:ident: $doc:literal, $unit:literal, $resolution:expr, $largest:literal;)+) => {
        $(params! {
            #[doc = $doc]
            pub struct $Name {
                #[doc = $doc]
                /// Step between readings; 0 for none.
                resolution: f64 = $resolution, $unit, within(0.0, $largest);
                #[doc = $doc]
                /// Standard deviation of white noise.
                noise: f64 = 0.0, $unit, within(0.0, $largest);
                #[doc = $doc]
                /// Standard deviation of the bias, which is drawn once per episode.
                bias: f64 = 0.0, $unit, within(0.0, $largest);
                #[doc = $doc]
                /// Control periods of 5 ms by which readings come late.
                delay_samples: usize = 0, "samples", within(0.0, 200.0);
                #[doc = $doc]
                /// Probability of a sample to be lost: the last reading is held.
                drop_out: f64 = 0.0, "", within(0.0, 1.0);
                #[doc = $doc]
                /// Largest magnitude of a reading; 0 for no limit.
                saturation: f64 = 0.0, $unit, within(0.0, $largest);
            }
        }

        impl From<&$Name> for Imperfections {
            fn from(p: &$Name) -> Self {
                Self {
                    resolution: p.resolution,
                    noise: p.noise,
                    bias: p.bias,
                    delay_samples: p.delay_samples,
                    drop_out: p.drop_out,
                    saturation: p.saturation,
                }
            }
        })+
    };
}

/// 2^12 ticks per revolution (section 5.2), rad.
const KNEE_TICK: f64 = std::f64::consts::TAU / 4096.0;

sensors! {
    KneeEncoderParams: "Encoder of the knee (section 5.2: 2^12 ticks per revolution).", "rad", KNEE_TICK, 10.0;
    TubeForceParams: "Axial load cell of the tube.", "N/N", 0.0, 100.0;
    TubeMomentParams: "Bending load cell of the tube.", "N m/kg", 0.0, 100.0;
    AnkleMomentParams: "Load cell of the ankle.", "N m/kg", 0.0, 100.0;
    ShankInclinationParams: "Inclination of the shank, from its inertial sensor.", "rad", 0.0, 10.0;
    ShankRateParams: "Gyroscope of the shank.", "rad/s", 0.0, 1e3;
    ShankSpecificForceParams: "Accelerometer of the shank, each of its two axes.", "m/s^2", 0.0, 1e4;
    ThighRateParams: "Gyroscope of the thigh.", "rad/s", 0.0, 1e3;
    ThighSpecificForceParams: "Accelerometer of the thigh, each of its two axes.", "m/s^2", 0.0, 1e4;
    MotorPositionParams: "Encoder of the motor's shaft.", "rad", 0.0, 1e5;
    MotorSpeedParams: "Speed of the motor's shaft.", "rad/s", 0.0, 1e5;
    MotorCurrentParams: "Current of the motor.", "A", 0.0, 1e3;
}

params! {
    /// Sensors of the prosthesis (section 5.2), sampled at 200 Hz and held.
    pub struct SensorParams {
        /// Cut-off of the first-order Butterworth filter on the knee speed, the difference of the encoder's readings.
        knee_speed_cutoff_hz: f64 = 15.0, "Hz", within(0.1, 99.0);
        /// Cut-off of the first-order Butterworth filter on the rate of the ankle moment's readings.
        ankle_moment_rate_cutoff_hz: f64 = 5.0, "Hz", within(0.1, 99.0);
        /// Inertial sensor of the thigh below the hip.
        thigh_imu_m: f64 = 0.0, "m", within(0.0, 2.0);
        /// Inertial sensor of the shank below the knee.
        shank_imu_m: f64 = 0.0, "m", within(0.0, 2.0);
    } sections {
        knee_encoder: KneeEncoderParams,
        tube_force: TubeForceParams,
        tube_moment: TubeMomentParams,
        ankle_moment: AnkleMomentParams,
        shank_inclination: ShankInclinationParams,
        shank_rate: ShankRateParams,
        shank_specific_force: ShankSpecificForceParams,
        thigh_rate: ThighRateParams,
        thigh_specific_force: ThighSpecificForceParams,
        motor_position: MotorPositionParams,
        motor_speed: MotorSpeedParams,
        motor_current: MotorCurrentParams,
    }
}
