//! Scenario: what happens to the walker in an episode, drawn from the environment's own random stream.

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantNames};

use crate::closed_loop::disturbance::{
    Disturbance, GustParams, Gusts, LATEST_PHASE, ListedPushes, Push, TrunkPush, samples,
};
use crate::closed_loop::episode::{Drawn, Episode};
use crate::episode::randomisation::{Randomised, Variants};
use crate::human::intent::{Knot, Profile};
use crate::human::variation::HumanVariationParams;
use crate::plant::start::Start;
use crate::schema::distribution::{Distribution, eased};
use crate::schema::params::{ANY, Choice, params, within};

/// Start posture of an episode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, IntoStaticStr, VariantNames)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum StartChoice {
    /// Always from standing.
    Standing,
    /// Always at the heel strike of a cyclic step.
    Cyclic,
    /// Either with equal odds.
    #[default]
    Random,
}

impl Choice for StartChoice {}

params! {
    /// Distributions that an episode is drawn from; a number is a fixed value, `[low, high]` a uniform distribution.
    pub struct ScenarioParams {
        /// Start posture: standing, cyclic or random.
        start: StartChoice = StartChoice::Random, "", ANY;
        /// Length of an episode, after which it is truncated.
        duration_s: f64 = 12.0, "s", within(0.1, 1e4);
        /// Intended speed.
        speed_m_s: Distribution = Distribution::Uniform([0.8, 1.5]), "m/s", within(0.3, 2.5);
        /// Time at which the intended speed is drawn anew; later than the episode's end for never.
        speed_change_s: Distribution = Distribution::Uniform([3.0, 9.0]), "s", within(0.0, 1e4);
        /// Time at which a walker that starts from standing intends to walk.
        walk_s: Distribution = Distribution::Uniform([0.1, 0.5]), "s", within(0.0, 1e4);
        /// Size of the push on the trunk; forward or backward with equal odds.
        push_n: Distribution = Distribution::Uniform([0.0, 300.0]), "N", within(0.0, 1e4);
        /// Time of the push.
        push_s: Distribution = Distribution::Uniform([2.0, 10.0]), "s", within(0.0, 1e4);
        /// Duration of the push.
        push_duration_s: Distribution = Distribution::Fixed(0.15), "s", within(0.0, 100.0);
        /// Phase of the residual step, in expected cycles from its heel strike, at which the push begins, the first time from `push_s` on; negative for `push_s` itself.
        push_phase: Distribution = Distribution::Fixed(-1.0), "1", within(-1.0, LATEST_PHASE);
        /// List of {time_s, duration_s, force_x_n, force_y_n, phase}; if not empty, these pushes in place of the drawn one.
        pushes: ListedPushes = ListedPushes::default(), "", ANY;
        /// Intent and speed over time, a list of {time_s, speed_m_s, walk}; if not empty, in place of the drawn ones. Speed is linear between knots, a step where two share a time.
        profile: Profile = Profile::default(), "", ANY;
        /// Parameters that every episode draws anew, by their dotted paths: numbers of the sections body, ground, human, knee, motor, friction_knee, end_stop, ankle, socket, tube and sensors, and termination.hip_height_m. Every walker that may be drawn must be possible, and every parameter one that its leg has.
        randomise: Randomised = Randomised::default(), "", ANY;
        /// Sets of parameters of which every episode draws one with equal odds, such as bodies; under the same conditions.
        variants: Variants = Variants::default(), "", ANY;
    } sections {
        gust: GustParams,
        human: HumanVariationParams,
    }
}

impl ScenarioParams {
    /// Length of an episode in control samples.
    pub fn samples(&self) -> u64 {
        samples(self.duration_s)
    }

    /// Draws an episode. Always takes the same random values, whatever the parameters.
    ///
    /// `difficulty` in [0, 1] scales pushes and gusts, and eases speeds towards the middle of their range, variations of the
    /// human towards the paper's. `parameters` draws those of the walker, where episodes do.
    pub fn draw<R: Rng>(
        &self,
        random: &mut R,
        difficulty: f64,
        parameters: impl FnOnce(&mut R) -> Option<Drawn>,
    ) -> Episode {
        let mut fraction = || random.random::<f64>();
        let coin = fraction();
        let [slowest, fastest] = self.speed_m_s.bounds();
        let mut speed = || eased(0.5 * (slowest + fastest), self.speed_m_s.at(fraction()), difficulty);
        let speeds = [speed(), speed()];
        let change_s = self.speed_change_s.at(fraction());
        let walk_s = self.walk_s.at(fraction());
        let push_n = eased(0.0, self.push_n.at(fraction()), difficulty);
        let push_sign = if fraction() < 0.5 { -1.0 } else { 1.0 };
        let push_s = self.push_s.at(fraction());
        let push_duration_s = self.push_duration_s.at(fraction());
        // Draws that this list has gained stand at its end: the episodes of a seed stay what they were.
        let sensor_seed = random.next_u64();
        let push_phase = self.push_phase.at(random.random::<f64>());
        let gusts = Gusts::new(&self.gust, random.next_u64(), difficulty);
        let human = self.human.at(|| random.random::<f64>()).eased(difficulty);
        let drawn = parameters(random);

        let start = match self.start {
            StartChoice::Standing => Start::Standing,
            StartChoice::Cyclic => Start::Cyclic,
            StartChoice::Random => {
                if coin < 0.5 {
                    Start::Standing
                } else {
                    Start::Cyclic
                }
            }
        };
        let profile = if self.profile.knots.is_empty() {
            drawn_profile(start, speeds, change_s, walk_s)
        } else {
            self.profile.clone()
        };
        let pushes = if self.pushes.pushes.is_empty() {
            let force = TrunkPush { x: push_sign * push_n, y: 0.0 };
            vec![Push::new(force, push_s, push_duration_s, Some(push_phase).filter(|&phase| phase >= 0.0))]
        } else {
            self.pushes.pushes.iter().map(|push| Push::scaled(push, difficulty)).collect()
        };
        Episode { start, profile, sensor_seed, disturbance: Disturbance { pushes, gusts }, human, drawn }
    }
}

fn drawn_profile(start: Start, [first, second]: [f64; 2], change_s: f64, walk_s: f64) -> Profile {
    let walk_s = if start == Start::Standing { walk_s } else { 0.0 };
    let knot = |time_s: f64, speed_m_s: f64| Knot { time_s, speed_m_s, walk: time_s >= walk_s };
    let mut knots = vec![knot(0.0, first), knot(change_s, first), knot(change_s, second)];
    let (place, speed) = if walk_s < change_s { (1, first) } else { (3, second) };
    if walk_s > 0.0 {
        knots.insert(place, knot(walk_s, speed));
    }
    Profile { knots }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schema::params::Parameter;

    #[test]
    fn draws_stay_in_their_distributions_and_differ_between_streams() {
        let params = ScenarioParams::default();
        let episodes: Vec<_> =
            (0..200).map(|stream| params.draw(&mut rand_pcg::Pcg64::new(1, stream), 1.0, |_| None)).collect();
        for episode in &episodes {
            assert!(episode.profile.knots.iter().all(|knot| (0.8..=1.5).contains(&knot.speed_m_s)));
            let push = episode.disturbance.pushes[0];
            assert!(push.force.x.abs() <= 300.0);
            assert_eq!(push.samples, 30);
        }
        assert!(episodes.windows(2).all(|pair| pair[0] != pair[1]));
        let standing = episodes.iter().filter(|episode| episode.start == Start::Standing).count();
        assert!((70..130).contains(&standing), "{standing}");
    }

    #[test]
    fn a_walker_that_stands_longer_than_the_speed_change_does_not_walk_before_its_time() {
        for (change_s, walk_s) in [(3.0, 5.0), (5.0, 3.0)] {
            let profile = drawn_profile(Start::Standing, [1.0, 1.3], change_s, walk_s);
            assert!(!profile.walks(walk_s - 0.01) && profile.walks(walk_s), "{change_s} {walk_s}");
            assert_eq!(profile.speed(change_s - 0.01), 1.0);
            assert_eq!(profile.speed(change_s), 1.3);
            assert_eq!(profile.speed(9.0), 1.3);
            profile.check("profile").unwrap();
        }
        assert!(drawn_profile(Start::Cyclic, [1.0, 1.3], 3.0, 5.0).walks(0.0));
    }
}
