//! Which walkers are possible: conditions on numbers that must fit together.
//!
//! They hold for spans: whatever lies between two configurations, number by number. A single configuration is the span from
//! itself to itself, so what is drawn is checked by the same conditions as what is configured, and no walker that may be drawn
//! can break them. A bound over a span may be wider than what its walkers reach, never narrower.

use crate::config::Config;
use crate::episode::scenario::StartChoice;
use crate::numerics::integrator::Stepper;
use crate::plant::posture::STANDING_KNEE_DEG;
use crate::plant::solver::MOST_STEPS;
use crate::prosthesis::end_stop::{EndStop, EndStopParams, extension_stop};
use crate::prosthesis::socket::{SocketParams, socket};
use crate::prosthesis::spring_damper::Connection;
use crate::prosthesis::tube::{TubeParams, tube};
use crate::schema::error::{Error, Result};
use crate::signals::CONTROL_PERIOD_S;

/// All walkers whose numbers lie between those of `low` and `high`, which differ in nothing else.
#[derive(Clone, Copy, Debug)]
pub struct Span<'a> {
    /// Smallest value of each number.
    pub low: &'a Config,
    /// Largest value of each number.
    pub high: &'a Config,
}

/// Torque of the extension stop at a start, N m, at most: several times that of walking.
const MOST_STOP_NM: f64 = 1000.0;

impl<'a> Span<'a> {
    /// One walker.
    pub fn of(config: &'a Config) -> Self {
        Self { low: config, high: config }
    }

    /// Checks the conditions; an error names keys and values.
    pub fn check(&self) -> Result<()> {
        self.check_human()?;
        self.check_stops()?;
        self.check_start()?;
        self.check_sole()?;
        self.check_stairs()?;
        self.check_touch_down()?;
        self.check_steps()
    }

    /// Smallest and largest value of a number.
    fn ends(&self, number: impl Fn(&Config) -> f64) -> [f64; 2] {
        [number(self.low), number(self.high)]
    }

    /// The human's parameters with every variation that episodes may draw.
    fn check_human(&self) -> Result<()> {
        for (end, config) in [self.low, self.high].into_iter().enumerate() {
            let variation = config.scenario.human.end(end);
            config.human.varied(&variation).validate("human (varied by scenario.human)")?;
        }
        Ok(())
    }

    fn check_stops(&self) -> Result<()> {
        let extension = self.ends(|config| config.end_stop.extension_angle_deg + config.end_stop.thickness_deg);
        let flexion = self.ends(|config| config.end_stop.flexion_angle_deg);
        if extension[1] < flexion[0] {
            return Ok(());
        }
        Err(Error::Invalid(format!(
            "end_stop.flexion_angle_deg = {} must lie above end_stop.extension_angle_deg + end_stop.thickness_deg = {}",
            text(flexion),
            text(extension)
        )))
    }

    /// An episode must not start with a knee so far in the extension stop that it is thrown out of it.
    fn check_start(&self) -> Result<()> {
        let start = self.low.scenario.start;
        let standing = (start != StartChoice::Cyclic).then_some(STANDING_KNEE_DEG);
        let cyclic = (start != StartChoice::Standing).then_some(self.low.human.touch_down_knee_deg);
        let knee = standing.into_iter().chain(cyclic).fold(f64::INFINITY, f64::min);
        let stop = EndStopParams {
            extension_angle_deg: self.high.end_stop.extension_angle_deg,
            half_compression_torque_nm: self.high.end_stop.half_compression_torque_nm,
            ..self.low.end_stop.clone()
        };
        let torque = extension_stop(&EndStop::from(&stop), knee.to_radians(), 0.0).torque;
        let compression = (stop.extension_angle_deg - knee) / stop.thickness_deg;
        if compression <= 0.5 && torque <= MOST_STOP_NM {
            return Ok(());
        }
        Err(Error::Invalid(format!(
            "end_stop.extension_angle_deg = {} must leave room for the knee at an episode's start, whose flexion may be {knee} deg \
             ({STANDING_KNEE_DEG} standing, human.touch_down_knee_deg at a cyclic start): no more than half of end_stop.thickness_deg = {} may be \
             compressed there, by no more than {MOST_STOP_NM} N m",
            text(self.ends(|config| config.end_stop.extension_angle_deg)),
            text(self.ends(|config| config.end_stop.thickness_deg)),
        )))
    }

    fn check_sole(&self) -> Result<()> {
        let (heel, ball) = (self.ends(|config| config.body.heel_x_m), self.ends(|config| config.body.ball_x_m));
        if ball[0] <= heel[1] {
            return Err(Error::Invalid(format!(
                "body.ball_x_m = {} must lie ahead of body.heel_x_m = {}",
                text(ball),
                text(heel)
            )));
        }
        let half_sole = [0.5 * (ball[0] - heel[1]), 0.5 * (ball[1] - heel[0])];
        let radius = self.ends(|config| config.body.sole_radius_m);
        if radius != [0.0; 2] && radius[0] < half_sole[1] {
            return Err(Error::Invalid(format!(
                "body.sole_radius_m = {} must be 0 (straight) or at least half of heel to ball = {} m",
                text(radius),
                text(half_sole)
            )));
        }
        let inertia = self.ends(|config| config.body.foot_inertia_kg_m2);
        let arms = [self.ends(|config| config.body.foot_com_x_m), self.ends(|config| config.body.foot_com_y_m)];
        if inertia[0] == 0.0 && arms.iter().all(|&[low, high]| low <= 0.0 && high >= 0.0) {
            return Err(Error::Invalid(format!(
                "body.foot_inertia_kg_m2 = {} must be above 0 where the foot's centre of mass may lie in the ankle",
                text(inertia)
            )));
        }
        Ok(())
    }

    fn check_stairs(&self) -> Result<()> {
        let rise = self.ends(|config| config.ground.stair_rise_m);
        let (edge, run) = (self.ends(|config| config.ground.edge_m), self.ends(|config| config.ground.stair_run_m));
        if rise != [0.0; 2] && edge[1] > run[0] {
            return Err(Error::Invalid(format!(
                "ground.edge_m = {} must not be longer than ground.stair_run_m = {}",
                text(edge),
                text(run)
            )));
        }
        Ok(())
    }

    /// The pendulum's angle of attack is that whose cosine is the hip's height at touch-down over the leg's length: in the
    /// posture at touch-down the heel must be below the hip, by less than that length.
    fn check_touch_down(&self) -> Result<()> {
        let angles: [fn(&Config) -> f64; 3] = [
            |config| config.human.thigh_flexion_deg,
            |config| config.human.touch_down_knee_deg,
            |config| config.body.foot_mount_deg,
        ];
        // Spans of angles are cut into parts, over each of which sines and cosines are bounded.
        let most_parts = match angles.iter().filter(|angle| angle(self.low) != angle(self.high)).count() {
            0 | 1 => 64,
            2 => 24,
            _ => 12,
        };
        let parts = |angle: fn(&Config) -> f64| {
            let [low, high] = self.ends(|config| angle(config).to_radians());
            let parts = if low == high { 1 } else { most_parts };
            (0..parts).map(move |i| {
                let at = move |i: u32| low + (high - low) * f64::from(i) / f64::from(parts);
                [at(i), if parts == 1 { high } else { at(i + 1) }]
            })
        };
        let [mut lost, mut height] = [f64::INFINITY; 2];
        for thigh in parts(angles[0]) {
            for knee in parts(angles[1]) {
                for mount in parts(angles[2]) {
                    let [lost_here, height_here] = self.touch_down(thigh, knee, mount);
                    (lost, height) = (lost.min(lost_here), height.min(height_here));
                }
            }
        }
        let length = self.high.body.thigh_length_m + self.high.body.calf_length_m + self.high.body.tube_length_m;
        // What the walker computes is rounded.
        let rounding = 1e-9 * (length + self.high.body.foot_height_m);
        if lost > rounding && height > rounding {
            return Ok(());
        }
        let span = |number: fn(&Config) -> f64| text(self.ends(number));
        Err(Error::Invalid(format!(
            "human.thigh_flexion_deg = {}, human.touch_down_knee_deg = {} and body.foot_mount_deg = {} with body.heel_x_m = {} \
             must put the heel below the hip, by less than the leg is long: at touch-down {}",
            span(angles[0]),
            span(angles[1]),
            span(angles[2]),
            span(|config| config.body.heel_x_m),
            if lost > rounding { "the heel may be above it" } else { "it may be as far below or farther" }
        )))
    }

    /// What bending takes off the leg's length at touch-down, and the hip's height above the heel then, m: lower bounds for
    /// angles of thigh, knee and foot mount in the given spans (rad).
    fn touch_down(&self, thigh: [f64; 2], knee: [f64; 2], mount: [f64; 2]) -> [f64; 2] {
        let shank = [thigh[0] - knee[1], thigh[1] - knee[0]];
        let foot = [shank[0] + mount[0], shank[1] + mount[1]];
        let heel = self.ends(|config| config.body.heel_x_m);
        // Angles within a quarter turn: the sine rises, the cosine is largest at 0.
        let [low, high] = foot.map(f64::sin);
        let raised = [heel[0] * low, heel[0] * high, heel[1] * low, heel[1] * high];
        let [least, most] =
            [raised.into_iter().fold(f64::INFINITY, f64::min), raised.into_iter().fold(f64::NEG_INFINITY, f64::max)];
        let body = &self.low.body;
        let segments = [
            (body.thigh_length_m, thigh),
            (body.calf_length_m + body.tube_length_m, shank),
            (body.foot_height_m, foot),
        ];
        segments.into_iter().fold([least, -most], |[lost, height], (length, angle)| {
            let smallest = angle[0].cos().min(angle[1].cos());
            let largest = if angle[0] <= 0.0 && angle[1] >= 0.0 { 1.0 } else { angle[0].cos().max(angle[1].cos()) };
            [lost + length * (1.0 - largest), height + length * smallest]
        })
    }

    fn check_steps(&self) -> Result<()> {
        let solver = &self.low.solver;
        if solver.stepper != Stepper::Rk4 {
            return Ok(());
        }
        let fewest = self.explicit_steps();
        if fewest > MOST_STEPS {
            return Err(Error::Invalid(format!(
                "solver.stepper = rk4 would need {fewest:.3e} steps per control period, more than {MOST_STEPS}, with this compliant \
                 socket or tube: take stepper = two_stage_w"
            )));
        }
        if solver.steps != 0 && (solver.steps as f64) < fewest {
            return Err(Error::Invalid(format!(
                "solver.steps = {} must be at least {fewest} for solver.stepper = rk4 with this compliant socket or tube",
                solver.steps
            )));
        }
        Ok(())
    }

    /// Steps per control period below which explicit steps diverge on the dampers of socket and tube.
    pub fn explicit_steps(&self) -> f64 {
        let socket =
            if self.low.socket.connection == Connection::Compliant { self.explicit_steps_with_socket() } else { 0.0 };
        let tube =
            if self.low.tube.connection == Connection::Compliant { self.explicit_steps_with_tube() } else { 0.0 };
        socket.max(tube)
    }

    /// Measured: with the paper's tilt damping RK4 diverges with 35 steps and agrees with 200 from 40 on.
    fn explicit_steps_with_socket(&self) -> f64 {
        const STEPS: f64 = 40.0;
        const TILT_DAMPING_NMS_RAD: f64 = 531.0;
        let body = &self.high.body;
        let mass = body.trunk_mass_kg + body.thigh_mass_kg + body.calf_mass_kg + body.foot_mass_kg;
        let stiffest = SocketParams { tilt_rad: self.low.socket.tilt_rad, ..self.high.socket.clone() };
        let [_, tilt] = socket(&stiffest, mass);
        (STEPS * (tilt.damping / TILT_DAMPING_NMS_RAD).max(1.0)).ceil()
    }

    /// The fastest decay that contact, damper and spring of the tube can have together on a foot that the tube alone holds,
    /// over what RK4 bears.
    fn explicit_steps_with_tube(&self) -> f64 {
        /// Just below the 2.785 of RK4's real stability interval.
        const STABILITY: f64 = 2.5;
        /// Deepest usual penetration, m.
        const DEPTH: f64 = 0.025;
        let (light, heavy) = (&self.low.body, &self.high.body);
        let stiffest: &TubeParams = &self.high.tube;
        let [extension, _] = tube(stiffest, heavy.foot_mass_kg, heavy.foot_inertia_about_tube());
        let inverse_mass = |x: f64| {
            let arm = (x - light.foot_com_x_m).abs().max((x - heavy.foot_com_x_m).abs());
            1.0 / light.foot_mass_kg + arm.powi(2) / light.foot_inertia_kg_m2
        };
        let ends = [light.heel_x_m, heavy.heel_x_m, light.ball_x_m, heavy.ball_x_m];
        let at_end = ends.into_iter().map(inverse_mass).fold(0.0, f64::max);
        let at_ankle = inverse_mass(0.0);
        let rate = self.high.ground.damping_ns_m15 * DEPTH.sqrt() * at_end
            + extension.damping * at_ankle
            + (extension.stiffness * at_ankle).sqrt();
        (rate * CONTROL_PERIOD_S / STABILITY).ceil()
    }
}

/// A span of values for an error.
fn text([low, high]: [f64; 2]) -> String {
    if low == high { low.to_string() } else { format!("{low} to {high}") }
}
