//! What all environments of a batch share.

use crate::agent::action::ActionMap;
use crate::agent::observation::ObservationMap;
use crate::config::Config;
use crate::schema::error::Result;
use crate::validation::randomiser::Randomiser;
use crate::vector::autoreset::Autoreset;

/// What all environments of a batch share.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The configuration.
    pub config: Config,
    /// What happens after an episode's end.
    pub autoreset: Autoreset,
    /// Share of disturbances and randomisation that episodes have from their next start on, in [0, 1].
    pub difficulty: f64,
    /// Draws the parameters of walkers.
    pub randomiser: Option<Randomiser>,
    /// Whether any walker may meet uneven ground.
    pub(super) uneven: bool,
    pub(super) action: ActionMap,
    pub(super) observation: ObservationMap,
    /// Control sample that ends an episode; `u64::MAX` none does.
    pub(super) last_sample: u64,
    /// Of samples under way through a walker's sensors, at most.
    pub(super) most_sensor_bytes: usize,
}

impl Setup {
    /// Checks the configuration.
    pub fn new(config: Config, autoreset: Autoreset) -> Result<Self> {
        config.validate()?;
        let last_sample = config.scenario.samples();
        let action = ActionMap::new(&config.action, config.device.kind);
        let observation = ObservationMap::new(&config.observation, config.device.kind);
        let randomiser = Randomiser::new(&config)?;
        let uneven = randomiser.as_ref().is_some_and(Randomiser::is_uneven);
        let drawn =
            randomiser.iter().flat_map(Randomiser::spans).map(|span| span.as_span().high.sensors.bytes_under_way());
        let most_sensor_bytes = drawn.fold(config.sensors.bytes_under_way(), usize::max);
        Ok(Self {
            config,
            autoreset,
            difficulty: 1.0,
            randomiser,
            uneven,
            action,
            observation,
            last_sample,
            most_sensor_bytes,
        })
    }

    /// Length of one environment's observation.
    pub fn observation_size(&self) -> usize {
        self.config.observation.frames * self.frame_size()
    }

    /// How many numbers an action has.
    pub fn action_size(&self) -> usize {
        self.action.size()
    }

    /// Samples of a whole episode, and the one that it starts with; `None` without a limit.
    pub fn most_samples(&self) -> Option<u64> {
        (self.last_sample < u64::MAX).then(|| self.last_sample.saturating_add(self.config.action.hold as u64))
    }

    /// Env steps of an episode at most; `None` without a limit.
    pub fn most_steps(&self) -> Option<u64> {
        (self.last_sample < u64::MAX).then(|| self.last_sample.div_ceil(self.config.action.hold as u64))
    }

    /// Ends episodes after so many env steps, in place of `scenario.duration_s`; `None` never.
    pub fn set_most_steps(&mut self, steps: Option<u64>) {
        let hold = self.config.action.hold as u64;
        self.last_sample = steps.map_or(u64::MAX, |steps| steps.saturating_mul(hold));
    }

    pub(super) fn frame_size(&self) -> usize {
        self.observation.channels().len()
    }
}
