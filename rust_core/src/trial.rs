//! Walkers with all that a closed loop needs, for those who look at single ones.

use std::ops::Deref;

use crate::closed_loop::energy_meter::EnergyMeter;
use crate::closed_loop::episode::Episode;
use crate::closed_loop::simulation::{LoopModel, Sampled, Scratch, Simulation};
use crate::config::Config;
use crate::numerics::lanes::vectorised;
use crate::plant::outputs::PlantOutputs;
use crate::plant::state::State;

/// A block of walkers with all that it needs, for those who look at single walkers.
#[derive(Clone, Debug)]
pub struct Trial<const L: usize> {
    model: LoopModel<L>,
    simulation: Simulation<L>,
    scratch: Scratch<L>,
}

impl<const L: usize> Trial<L> {
    /// Walkers with the given parameters, each starting its episode.
    pub fn new(config: &Config, episodes: [Episode; L]) -> Self {
        let model = LoopModel::new(&config.loop_params(), config.solvers());
        let (mut simulation, mut scratch) = (Simulation::new(&model), Scratch::new(&model));
        for (lane, episode) in episodes.into_iter().enumerate() {
            simulation.start(&model, lane, episode, &mut scratch);
        }
        simulation.observe_started(&model, &[true; L], &mut scratch);
        Self { model, simulation, scratch }
    }

    /// The same walkers from another continuous state.
    pub fn set_state(&mut self, state: State<L>) {
        self.simulation.state = state;
        self.simulation.evaluate(&self.model, &mut self.scratch);
    }

    /// Continues where `other` is, with this trial's parameters.
    pub fn continue_from(&mut self, other: &Self) {
        self.simulation.clone_from(&other.simulation);
        self.simulation.evaluate(&self.model, &mut self.scratch);
    }

    /// One control period with the given commands to the knee units.
    pub fn advance(&mut self, commands: &[f64; L]) {
        advance(self, commands);
    }

    /// The same under the commands of the state machines.
    pub fn advance_controlled(&mut self) {
        self.advance(&self.simulation.state_machine_command.clone());
    }

    /// One control period under the state machines, with the work of all forces integrated.
    pub fn advance_metered(&mut self, meter: &mut EnergyMeter<L>) {
        advance_metered(self, meter);
    }

    /// Everything at the present sample.
    pub fn sampled(&self) -> Sampled<'_, L> {
        Sampled { model: &self.model, simulation: &self.simulation, scratch: &self.scratch }
    }

    /// The human-prosthesis system at the present sample.
    pub fn plant(&self) -> PlantOutputs<'_, L> {
        self.sampled().plant()
    }
}

vectorised! {
    fn advance<const L: usize>(trial: &mut Trial<L>, commands: &[f64; L]) {
        trial.simulation.advance(&trial.model, commands, &[true; L], &mut trial.scratch);
    }
}

vectorised! {
    fn advance_metered<const L: usize>(trial: &mut Trial<L>, meter: &mut EnergyMeter<L>) {
        let commands = trial.simulation.state_machine_command;
        trial.simulation.advance_metered(&trial.model, &commands, &mut trial.scratch, meter);
    }
}

impl<const L: usize> Deref for Trial<L> {
    type Target = Simulation<L>;

    fn deref(&self) -> &Simulation<L> {
        &self.simulation
    }
}
