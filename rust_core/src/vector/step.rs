//! One step of a block of environments: command, advance, judge, publish.

use std::sync::Arc;

use crate::closed_loop::simulation::{LoopModel, Sampled, Scratch, Simulation};
use crate::episode::judgement;
use crate::episode::reward::{TERMS, TermsLanes};
use crate::episode::termination::Reason;
use crate::vector::autoreset::Autoreset;
use crate::vector::environment::Environments;
use crate::vector::setup::Setup;
use crate::vector::step_output::StepOutput;

/// What comes of a step.
struct Outcome<const L: usize> {
    /// The first so many lanes have an environment.
    used: usize,
    /// Lanes whose episode had ended before the step: they are reset by it, or wait.
    skipped: [bool; L],
    /// Why episodes ended in it.
    reasons: [Reason; L],
    /// Sums over its control periods.
    terms: TermsLanes<L>,
}

impl<const L: usize> Outcome<L> {
    /// Lanes at whose walker somebody still looks.
    #[inline(always)]
    fn live(&self) -> [bool; L] {
        std::array::from_fn(|lane| lane < self.used && !self.skipped[lane] && self.reasons[lane] == Reason::None)
    }
}

impl<const L: usize> Environments<L> {
    /// Advances every lane by one action of `action.hold` control periods; `actions` and `output` cover the used lanes. Returns
    /// the lanes that are due to start anew: [`finish`](Self::finish) does so, and hands out the observations.
    #[inline(always)]
    pub fn step(
        &mut self,
        setup: &Setup,
        model: &LoopModel<L>,
        actions: &[f64],
        output: &mut StepOutput<'_>,
        scratch: &mut Scratch<L>,
    ) -> [bool; L] {
        let mut outcome = Outcome {
            used: actions.len() / setup.action_size(),
            skipped: std::array::from_fn(|lane| self.envs[lane].ended),
            reasons: [Reason::None; L],
            terms: TermsLanes::default(),
        };
        for held in 0..setup.config.action.hold {
            let (commands, changes) = self.command(setup, actions, held == 0);
            self.simulation.advance(model, &commands, &outcome.live(), scratch);
            self.judge(setup, model, &changes, held + 1 == setup.config.action.hold, &mut outcome, scratch);
        }
        self.publish(setup, &outcome, output)
    }

    /// Commands of the next control period, and by how much the requested ones have changed with a `new` action, in commands of
    /// a full action.
    #[inline(always)]
    fn command(&mut self, setup: &Setup, actions: &[f64], new: bool) -> ([f64; L], [f64; L]) {
        let before = self.actuation.now.requested;
        let mut phases = [0; L];
        for lane in 0..L {
            phases[lane] = self.simulation.state_machine[lane].phase();
        }
        let Simulation { readings, state_machine_command, .. } = &self.simulation;
        let (scale, memory) = (&self.scale, &mut self.actuation);
        let commands = setup.action.commands(scale, memory, actions, readings, &phases, state_machine_command);
        let mut changes = [0.0; L];
        if new {
            for lane in 0..L {
                changes[lane] = self.scale.relative(lane, self.actuation.now.requested[lane] - before[lane]);
            }
        }
        (commands, changes)
    }

    /// Adds a control period to the outcome of the step: its reward terms, and why it ends an episode. Takes the observation at
    /// the `last` one, or where the episode ends.
    #[inline(always)]
    fn judge(
        &mut self,
        setup: &Setup,
        model: &LoopModel<L>,
        changes: &[f64; L],
        last: bool,
        outcome: &mut Outcome<L>,
        scratch: &Scratch<L>,
    ) {
        let sampled = Sampled { model, simulation: &self.simulation, scratch };
        let limits = &setup.config.termination;
        let (terms, reasons) = judgement::judge(&sampled, limits, &self.fall_height, setup.last_sample, changes);
        for lane in 0..outcome.used {
            if outcome.skipped[lane] || outcome.reasons[lane] != Reason::None {
                continue;
            }
            outcome.terms.set(lane, outcome.terms.get(lane).plus(&terms.get(lane)));
            outcome.reasons[lane] = reasons[lane];
            if let Some((_, recorder)) = self.recorder.as_mut().filter(|(recorded, _)| *recorded == lane) {
                recorder.push(&Sampled { model, simulation: &self.simulation, scratch }, lane);
            }
            if outcome.reasons[lane] != Reason::None || last {
                self.push_frame(setup, model, scratch, lane);
            }
        }
    }

    /// Writes the outcome of a step, observations apart, and returns the lanes that are due to start anew.
    #[inline(always)]
    fn publish(&mut self, setup: &Setup, outcome: &Outcome<L>, output: &mut StepOutput<'_>) -> [bool; L] {
        let Outcome { used, skipped, reasons, terms } = outcome;
        let mut starting = [false; L];
        for lane in 0..*used {
            let ends = reasons[lane] != Reason::None;
            self.envs[lane].ended |= ends;
            starting[lane] = match setup.autoreset {
                Autoreset::NextStep => skipped[lane],
                Autoreset::SameStep => ends,
                Autoreset::Disabled => false,
            };
            let terms = terms.get(lane);
            let reward = terms.reward(&setup.config.reward);
            let row = lane * TERMS.len()..(lane + 1) * TERMS.len();
            output.rewards[lane] = reward;
            output.terms[row.clone()].copy_from_slice(&terms.values());
            let env = &mut self.envs[lane];
            if !skipped[lane] {
                env.steps += 1;
                env.total_reward += reward;
                env.terms = env.terms.plus(&terms);
            }
            output.episode_returns[lane] = env.total_reward;
            output.episode_steps[lane] = env.steps;
            if ends {
                output.episode_terms[row].copy_from_slice(&env.terms.values());
            }
            output.terminated[lane] = ends && reasons[lane] != Reason::TimeLimit;
            output.truncated[lane] = reasons[lane] == Reason::TimeLimit;
            output.reasons[lane] = reasons[lane] as u8;
            output.started[lane] = starting[lane];
        }
        starting
    }

    /// Starts the lanes that a step has found due, and hands out the newest observations.
    pub fn finish(
        &mut self,
        setup: &Setup,
        model: &mut Arc<LoopModel<L>>,
        starting: &[bool; L],
        output: &mut StepOutput<'_>,
        scratch: &mut Scratch<L>,
    ) {
        let used = output.observations.len();
        if starting.contains(&true) {
            if setup.autoreset == Autoreset::SameStep {
                output.final_observations.copy_from_slice(&self.observations[..used]);
            }
            self.start(setup, model, starting, scratch);
        }
        output.observations.copy_from_slice(&self.observations[..used]);
    }
}
