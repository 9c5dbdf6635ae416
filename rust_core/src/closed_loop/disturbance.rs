//! Disturbances: forces on the trunk that the human did not intend (section 4.3), constant over a control period.

use rand::RngExt;
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use crate::numerics::math::sin_cos;
use crate::schema::distribution::Distribution;
use crate::schema::error::Result;
use crate::schema::params::{Parameter, Range, params, within};
use crate::signals::CONTROL_PERIOD_S;

/// Latest phase of a step at which a push can begin: hardly a step ends before it (Figure 3).
pub const LATEST_PHASE: f64 = 0.9;

/// A push as a scenario lists it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ListedPush {
    /// Time at which it begins, s; with a phase, the earliest time.
    pub time_s: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Forward force, N.
    #[serde(default)]
    pub force_x_n: f64,
    /// Upward force, N.
    #[serde(default)]
    pub force_y_n: f64,
    /// Phase of the residual step at which it begins; none for `time_s` itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase: Option<f64>,
}

/// Pushes that a scenario lists.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ListedPushes {
    /// In any order.
    pub pushes: Vec<ListedPush>,
}

impl Parameter for ListedPushes {
    fn numbers(&self) -> [f64; 2] {
        [0.0; 2]
    }
    fn text(&self) -> String {
        "[]".to_owned()
    }
    fn allowed(_: Range) -> String {
        format!("list of {{time_s, duration_s, force_x_n, force_y_n, phase}}, phase in [0, {LATEST_PHASE}] or left out")
    }
    fn check(&self, path: &str) -> Result<()> {
        for (i, push) in self.pushes.iter().enumerate() {
            let key = |field: &str| format!("{path}[{i}].{field}");
            within(0.0, 1e6).check(&key("time_s"), push.time_s, "s")?;
            within(0.0, 100.0).check(&key("duration_s"), push.duration_s, "s")?;
            within(-1e4, 1e4).check(&key("force_x_n"), push.force_x_n, "N")?;
            within(-1e4, 1e4).check(&key("force_y_n"), push.force_y_n, "N")?;
            within(0.0, LATEST_PHASE).check(&key("phase"), push.phase.unwrap_or(0.0), "")?;
        }
        Ok(())
    }
}

/// Force on the trunk at the hip.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrunkPush {
    /// Forward, N.
    pub x: f64,
    /// Up, N.
    pub y: f64,
}

/// One push on the trunk, on the 200 Hz grid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Push {
    /// Force while it lasts.
    pub force: TrunkPush,
    /// First control sample that it may act in.
    pub first_sample: u64,
    /// Control samples that it lasts for.
    pub samples: u64,
    /// Phase of the residual step that it waits for from its first sample on.
    pub phase: Option<f64>,
    /// First control sample that it does act in, once it has begun.
    begun: Option<u64>,
}

impl Push {
    /// A push from `time_s` on, or from when the residual step first reaches `phase` after it.
    pub fn new(force: TrunkPush, time_s: f64, duration_s: f64, phase: Option<f64>) -> Self {
        Self { force, first_sample: samples(time_s), samples: samples(duration_s), phase, begun: None }
    }

    /// A listed push with its force times `scale`.
    pub fn scaled(push: &ListedPush, scale: f64) -> Self {
        let force = TrunkPush { x: scale * push.force_x_n, y: scale * push.force_y_n };
        Self::new(force, push.time_s, push.duration_s, push.phase)
    }

    /// Earliest time at which it may begin, s.
    pub fn earliest_s(&self) -> f64 {
        self.first_sample as f64 * CONTROL_PERIOD_S
    }

    /// First sample after `sample`, at which the force was asked for last, when it may be another.
    fn next_change(&self, sample: u64) -> u64 {
        match self.begun {
            None => self.first_sample.max(sample + 1),
            Some(begun) if sample < begun + self.samples => begun + self.samples,
            Some(_) => u64::MAX,
        }
    }

    /// Force during the control period that starts at `sample`. `time_at` tells when the current step reaches a phase, s.
    fn force(&mut self, sample: u64, time_at: &impl Fn(f64) -> f64) -> TrunkPush {
        if self.begun.is_none() && sample >= self.first_sample {
            let begins = self.phase.is_none_or(|phase| {
                let since = sample as f64 * CONTROL_PERIOD_S - time_at(phase);
                (0.0..CONTROL_PERIOD_S).contains(&since)
            });
            self.begun = begins.then_some(sample);
        }
        if self.begun.is_some_and(|begun| sample < begun + self.samples) { self.force } else { TrunkPush::default() }
    }
}

/// Seconds as control samples.
pub fn samples(seconds: f64) -> u64 {
    (seconds / CONTROL_PERIOD_S).round() as u64
}

params! {
    /// Gusts on the trunk, one after the other, each with numbers of its own: F(t) = force/2 (1 - cos(2 pi t / duration)), the discrete gust of aviation (CS-25.341).
    pub struct GustParams {
        /// Peak force of a gust; forward is positive. 0 for no gusts.
        force_n: Distribution = Distribution::Fixed(0.0), "N", within(-1e4, 1e4);
        /// Duration of a gust.
        duration_s: Distribution = Distribution::Uniform([0.5, 2.0]), "s", within(0.05, 100.0);
        /// Calm before a gust.
        pause_s: Distribution = Distribution::Uniform([0.5, 3.0]), "s", within(0.0, 1e4);
    }
}

/// One gust.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Gust {
    begin_s: f64,
    duration_s: f64,
    force_n: f64,
}

impl Gust {
    fn end_s(&self) -> f64 {
        self.begin_s + self.duration_s
    }

    /// Forward force at a time before its end, N.
    fn force_x(&self, time: f64) -> f64 {
        if time <= self.begin_s {
            return 0.0;
        }
        let (_, cosine) = sin_cos(std::f64::consts::TAU * (time - self.begin_s) / self.duration_s);
        0.5 * self.force_n * (1.0 - cosine)
    }
}

/// The gusts of an episode, drawn one at a time from a random stream of their own.
#[derive(Clone, Debug, PartialEq)]
pub struct Gusts {
    params: GustParams,
    random: Pcg64,
    now: Gust,
    scale: f64,
}

impl Gusts {
    /// The gusts of an episode with their forces times `scale`, none if they have no force.
    pub fn new(params: &GustParams, seed: u64, scale: f64) -> Option<Self> {
        (params.force_n.bounds() != [0.0; 2]).then(|| Self {
            params: params.clone(),
            random: Pcg64::new(seed.into(), 0),
            now: Gust::default(),
            scale,
        })
    }

    /// Forward force at `time`, which must not run backward, N.
    fn force_x(&mut self, time: f64) -> f64 {
        while time >= self.now.end_s() {
            let mut draw = |distribution: &Distribution| distribution.at(self.random.random::<f64>());
            self.now = Gust {
                begin_s: self.now.end_s() + draw(&self.params.pause_s),
                duration_s: draw(&self.params.duration_s),
                force_n: self.scale * draw(&self.params.force_n),
            };
        }
        self.now.force_x(time)
    }
}

/// How far the disturbances of an episode have come.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// First sample of each push that has begun.
    begun: Vec<Option<u64>>,
    gusts: Option<(Pcg64, Gust)>,
}

/// Everything that disturbs the walker in an episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Disturbance {
    /// Pushes.
    pub pushes: Vec<Push>,
    /// Gusts, if any.
    pub gusts: Option<Gusts>,
}

impl Disturbance {
    /// How far they have come.
    pub fn progress(&self) -> Progress {
        Progress {
            begun: self.pushes.iter().map(|push| push.begun).collect(),
            gusts: self.gusts.as_ref().map(|gusts| (gusts.random.clone(), gusts.now)),
        }
    }

    /// Puts the same disturbances where they had come.
    pub fn resume(&mut self, progress: &Progress) {
        for (push, &begun) in self.pushes.iter_mut().zip(&progress.begun) {
            push.begun = begun;
        }
        if let (Some(gusts), Some((random, now))) = (&mut self.gusts, &progress.gusts) {
            (gusts.random, gusts.now) = (random.clone(), *now);
        }
    }

    /// Force during the control period that starts at `sample`. `time_at` tells when the current step reaches a phase, s.
    pub fn force(&mut self, sample: u64, time_at: impl Fn(f64) -> f64) -> TrunkPush {
        let wind = self.gusts.as_mut().map_or(0.0, |gusts| gusts.force_x(sample as f64 * CONTROL_PERIOD_S));
        self.pushes.iter_mut().fold(TrunkPush { x: wind, y: 0.0 }, |sum, push| {
            let force = push.force(sample, &time_at);
            TrunkPush { x: sum.x + force.x, y: sum.y + force.y }
        })
    }
}

impl Disturbance {
    /// First sample after `sample`, at which the force was asked for last, when it may be another.
    pub fn next_change(&self, sample: u64) -> u64 {
        let gust = if self.gusts.is_some() { sample + 1 } else { u64::MAX };
        self.pushes.iter().map(|push| push.next_change(sample)).fold(gust, u64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORCE: TrunkPush = TrunkPush { x: 100.0, y: -20.0 };

    fn acting(disturbance: &mut Disturbance, samples: u64, time_at: impl Fn(u64, f64) -> f64) -> Vec<u64> {
        (0..samples).filter(|&i| disturbance.force(i, |phase| time_at(i, phase)) != TrunkPush::default()).collect()
    }

    fn pushes(push: Push) -> Disturbance {
        Disturbance { pushes: vec![push], gusts: None }
    }

    #[test]
    fn a_push_acts_for_its_duration_from_its_time_on() {
        let mut disturbance = pushes(Push::new(FORCE, 0.1, 0.05, None));
        assert_eq!(acting(&mut disturbance, 100, |_, _| f64::INFINITY), (20..30).collect::<Vec<_>>());
    }

    #[test]
    fn a_push_at_a_phase_waits_for_the_next_step_that_reaches_it_and_comes_once() {
        // Steps of 1 s: at 1.2 s the phase 0.1 of the second is over.
        let steps = |sample: u64, phase: f64| (sample as f64 * CONTROL_PERIOD_S + 1e-9).floor() + phase;
        let mut disturbance = pushes(Push::new(FORCE, 1.2, 0.05, Some(0.1)));
        assert_eq!(acting(&mut disturbance, 1000, steps), (420..430).collect::<Vec<_>>());
        let mut standing = pushes(Push::new(FORCE, 1.2, 0.05, Some(0.1)));
        assert!(acting(&mut standing, 1000, |_, _| f64::INFINITY).is_empty());
    }

    #[test]
    fn the_force_stays_what_it_is_until_its_next_change() {
        let listed = |time_s: f64, phase: Option<f64>| Push::new(FORCE, time_s, 0.05, phase);
        let time_at = |sample: u64, phase: f64| (sample as f64 * CONTROL_PERIOD_S + 1e-9).floor() + phase;
        let mut disturbance = Disturbance { pushes: vec![listed(0.1, None), listed(1.2, Some(0.1))], gusts: None };
        let (mut force, mut next, mut asked) = (TrunkPush::default(), 0, 0);
        for sample in 0..1000 {
            let truth = disturbance.clone().force(sample, |phase| time_at(sample, phase));
            if sample >= next {
                force = disturbance.force(sample, |phase| time_at(sample, phase));
                next = disturbance.next_change(sample);
                asked += 1;
            }
            assert_eq!(force, truth, "{sample}");
        }
        // Only while the second push waits for its phase is it asked every time.
        assert!(asked < 200 && next == u64::MAX, "{asked}");
    }

    #[test]
    fn pushes_and_gusts_add_up() {
        let mut disturbance = pushes(Push::new(FORCE, 0.0, 1.0, None));
        disturbance.pushes.push(Push::new(FORCE, 0.5, 1.0, None));
        assert_eq!(disturbance.force(0, |_| 0.0), FORCE);
        assert_eq!(disturbance.force(100, |_| 0.0), TrunkPush { x: 200.0, y: -40.0 });
        let params = GustParams {
            force_n: Distribution::Fixed(50.0),
            duration_s: Distribution::Fixed(2.0),
            pause_s: Distribution::Fixed(0.0),
        };
        disturbance.gusts = Gusts::new(&params, 1, 1.0);
        assert!((disturbance.force(200, |_| 0.0).x - 150.0).abs() < 1e-9);
    }

    #[test]
    fn a_gust_rises_to_its_force_and_falls_back_smoothly() {
        let gust = Gust { begin_s: 1.0, duration_s: 2.0, force_n: -80.0 };
        for (time, force) in [(0.5, 0.0), (1.0, 0.0), (1.5, -40.0), (2.0, -80.0), (2.5, -40.0), (3.0, 0.0)] {
            assert!((gust.force_x(time) - force).abs() < 1e-12, "{time}");
        }
    }

    #[test]
    fn gusts_differ_keep_to_their_distributions_and_repeat_with_their_seed() {
        let params = GustParams { force_n: Distribution::Uniform([-60.0, 60.0]), ..GustParams::default() };
        let forces = |seed: u64| -> Vec<f64> {
            let mut gusts = Gusts::new(&params, seed, 1.0).unwrap();
            (0..20_000).map(|sample| gusts.force_x(sample as f64 * CONTROL_PERIOD_S)).collect()
        };
        let first = forces(1);
        assert_eq!(first, forces(1));
        assert_ne!(first, forces(2));
        assert!(first.iter().all(|force| force.abs() <= 60.0));
        assert!(first.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 60.0 * 3.15 * CONTROL_PERIOD_S / 0.5));
        // 100 s of gusts of 1.25 s after pauses of 1.75 s, on the average.
        let begins = first.windows(2).filter(|pair| pair[0] == 0.0 && pair[1] != 0.0).count();
        assert!((25..42).contains(&begins), "{begins}");
        assert_eq!(Gusts::new(&GustParams::default(), 1, 1.0), None);
    }
}
