//! How a step is shared out to threads: the caller's, and those of its helpers.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::block::{Block, Scratches};
use crate::environment::Setup;
use crate::error::{Error, Result};
use crate::prefetch::{Ahead, prefetch};
use crate::shared_job::SharedJob;
use crate::step_output::StepOutput;

/// Blocks for each thread that is called: waking one up takes as long as stepping a few.
const BLOCKS_PER_THREAD: usize = 3;
/// Portions that a thread would cut its share of what is left into. It takes one: few are handed out, and all threads end
/// within a block's time.
const PORTIONS: usize = 4;
/// How long the caller looks whether helpers have finished before it sleeps: falling asleep and waking up takes as long.
const PATIENCE: Duration = Duration::from_micros(30);
/// A helper that keeps the caller waiting this long has been taken off its core in the midst of its portion.
const INTERRUPTED: Duration = Duration::from_micros(150);
/// The caller then works alone for so many times as long as it has waited: where another process wants the core too, waiting
/// costs at most a twentieth of the time. At most for `LONGEST_REST`, after which it looks whether the core is free again.
const REST: u32 = 20;
const LONGEST_REST: Duration = Duration::from_millis(100);

/// Blocks to step, their actions, and where outputs go.
pub struct Work<'a> {
    pub blocks: &'a mut [Box<dyn Block>],
    /// Environments per block.
    pub width: usize,
    pub actions: &'a [f64],
    pub output: StepOutput<'a>,
}

impl Work<'_> {
    /// Takes the first `blocks` away; None if nothing is left.
    fn take(&mut self, blocks: usize) -> Option<Self> {
        let environments = self.output.rewards.len();
        if environments == 0 {
            return None;
        }
        let taken = environments.min(blocks * self.width);
        let action_size = self.actions.len() / environments;
        Some(Self {
            blocks: self.blocks.split_off_mut(..blocks)?,
            width: self.width,
            actions: self.actions.split_off(..taken * action_size)?,
            output: self.output.take(taken)?,
        })
    }

    /// Takes what one of `threads` threads should do next.
    fn portion(&mut self, threads: usize) -> Option<Self> {
        self.take((self.blocks.len() / (PORTIONS * threads)).max(1))
    }

    /// Steps block after block.
    fn run(mut self, setup: &Setup, scratches: &mut Scratches) {
        let mut next = self.take(1);
        while let Some(mut now) = next {
            next = self.take(1);
            let ahead = next.as_ref().map_or_else(Ahead::default, |next| {
                prefetch(next.blocks[0].observations());
                prefetch(next.actions);
                next.output.prefetch();
                next.blocks[0].memory()
            });
            now.blocks[0].step(setup, now.actions, &mut now.output, scratches, ahead);
        }
        debug_assert!(self.blocks.is_empty(), "blocks without actions or outputs");
    }
}

/// The threads that step a batch.
#[derive(Debug)]
pub struct Crew {
    /// The caller's and its helpers.
    threads: usize,
    patience: Duration,
    /// The caller's.
    pub scratches: Scratches,
    helpers: Option<Helpers>,
    /// Until when the caller works alone.
    rests_until: Option<Instant>,
}

/// Threads beside the caller's, their scratches, what they join, and the process that they live in.
struct Helpers {
    process: u32,
    pool: rayon::ThreadPool,
    shared: Arc<SharedJob>,
    scratches: Vec<Mutex<Scratches>>,
}

impl Crew {
    /// Helpers start when they are first needed.
    pub fn new(threads: usize) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        // A caller that looks on would keep a helper from its core, if there are too few.
        let patience = if threads > cores { Duration::ZERO } else { PATIENCE };
        Self { threads, patience, scratches: Scratches::default(), helpers: None, rests_until: None }
    }

    /// Steps all blocks. Helpers join in when they have woken up; the caller does what they do not get round to.
    pub fn run(&mut self, work: Work<'_>, setup: &Setup) -> Result<()> {
        let called = self.threads.min(work.blocks.len() / BLOCKS_PER_THREAD);
        if called < 2 || self.rests_until.is_some_and(|until| Instant::now() < until) {
            work.run(setup, &mut self.scratches);
            return Ok(());
        }
        let work = Mutex::new(work);
        let join = |scratches: &mut Scratches| {
            let next = || work.lock().unwrap_or_else(PoisonError::into_inner).portion(called);
            while let Some(portion) = next() {
                portion.run(setup, scratches);
            }
        };
        let Helpers { pool, shared, scratches, .. } = helpers(&mut self.helpers, self.threads)?;
        let help = |helper: usize| join(&mut scratches[helper].lock().unwrap_or_else(PoisonError::into_inner));
        let call = || {
            let shared = Arc::clone(shared);
            pool.spawn(move || shared.join(rayon::current_thread_index().unwrap_or(0)));
        };
        let waited = shared.run(&help, called - 1, call, self.patience, || join(&mut self.scratches));
        self.rests_until = (waited > INTERRUPTED).then(|| Instant::now() + (REST * waited).min(LONGEST_REST));
        Ok(())
    }
}

/// The helpers of this process: threads do not survive a fork, so a child starts its own.
fn helpers(slot: &mut Option<Helpers>, threads: usize) -> Result<&mut Helpers> {
    let process = std::process::id();
    if slot.as_ref().is_none_or(|helpers| helpers.process != process) {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads - 1)
            .build()
            .map_err(|error| Error::Invalid(format!("cannot start {threads} threads: {error}")))?;
        let scratches = (0..pool.current_num_threads()).map(|_| Mutex::default()).collect();
        let helpers = Helpers { process, pool, shared: Arc::default(), scratches };
        // Dropping the parent's could wait for a lock that one of its threads, which are not here, held at the fork.
        std::mem::forget(slot.replace(helpers));
    }
    slot.as_mut().ok_or_else(|| Error::Invalid("no threads".into()))
}

impl std::fmt::Debug for Helpers {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Helpers").field("process", &self.process).field("pool", &self.pool).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;
    use crate::block::{LANES, blocks};
    use crate::config::Config;
    use crate::environment::Autoreset;
    use crate::reward::TERMS;

    const BLOCKS: usize = 16;
    const WALKERS: usize = BLOCKS * LANES;

    /// Observations of walkers after some steps of a crew.
    fn walk(crew: &mut Crew, steps: usize) -> Vec<f32> {
        let setup = Setup::new(Config::default(), Autoreset::NextStep).unwrap();
        let mut blocks = blocks(&setup, LANES, BLOCKS);
        let seeds: Vec<u64> = (0..WALKERS as u64).collect();
        for (block, seeds) in blocks.iter_mut().zip(seeds.chunks(LANES)) {
            block.reset(&setup, &[true; LANES], Some(seeds), &mut crew.scratches);
        }
        let size = setup.observation_size();
        let (mut observations, mut rewards) = (vec![0.0; WALKERS * size], [0.0; WALKERS]);
        let (mut terms, mut episode_terms) = ([0.0; WALKERS * TERMS.len()], [0.0; WALKERS * TERMS.len()]);
        let [mut terminated, mut truncated, mut started] = [[false; WALKERS]; 3];
        let (mut reasons, mut episode_returns, mut episode_steps) = ([0; WALKERS], [0.0; WALKERS], [0; WALKERS]);
        for _ in 0..steps {
            let output = StepOutput {
                observations: &mut observations,
                rewards: &mut rewards,
                terminated: &mut terminated,
                truncated: &mut truncated,
                terms: &mut terms,
                reasons: &mut reasons,
                final_observations: &mut [],
                started: &mut started,
                episode_returns: &mut episode_returns,
                episode_steps: &mut episode_steps,
                episode_terms: &mut episode_terms,
            };
            let work = Work { blocks: &mut blocks, width: LANES, actions: &[0.3; WALKERS], output };
            crew.run(work, &setup).unwrap();
        }
        observations
    }

    #[test]
    fn a_caller_whose_helper_is_never_scheduled_does_all_the_work_itself() {
        let expected = walk(&mut Crew::new(1), 40);
        let mut crew = Crew::new(2);
        // The only helper's thread is taken by something else for as long as the caller works, or half a minute.
        let (release, released) = channel();
        let (report, outcome) = channel();
        let occupy = move || report.send(released.recv_timeout(Duration::from_secs(30))).unwrap();
        helpers(&mut crew.helpers, 2).unwrap().pool.spawn(occupy);
        assert_eq!(walk(&mut crew, 40), expected);
        release.send(()).unwrap();
        assert_eq!(outcome.recv().unwrap(), Ok(()), "the caller has waited for a helper that did not run");
        assert_eq!(walk(&mut crew, 40), expected);
    }

    #[test]
    fn a_caller_that_rests_from_waiting_works_alone_and_calls_helpers_again_later() {
        let expected = walk(&mut Crew::new(1), 40);
        let mut crew = Crew::new(2);
        crew.rests_until = Some(Instant::now() + Duration::from_secs(3600));
        assert_eq!(walk(&mut crew, 40), expected);
        assert!(crew.helpers.is_none());
        crew.rests_until = Some(Instant::now());
        assert_eq!(walk(&mut crew, 40), expected);
        assert!(crew.helpers.is_some());
    }
}
