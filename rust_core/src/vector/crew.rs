//! How a step is shared out to threads: the caller's, and those of its helpers.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::numerics::prefetch::{Ahead, prefetch};
use crate::schema::error::{Error, Result};
use crate::vector::block::{Block, Scratches};
use crate::vector::setup::Setup;
use crate::vector::shared_job::SharedJob;
use crate::vector::step_output::StepOutput;

/// Blocks for each thread that is called: waking one up takes as long as stepping a few.
const BLOCKS_PER_THREAD: usize = 3;
/// Portions that a thread would cut its share of what is left into. It takes one: few are handed out, and all threads end
/// within a block's time.
const PORTIONS: usize = 4;
/// How long the caller looks whether helpers have finished before it sleeps: falling asleep and waking up takes as long.
const PATIENCE: Duration = Duration::from_micros(30);
/// Time that helpers may have gained of late and lose again before the caller sends them away, s: a few time slices of the system.
const MOST_CREDIT_S: f64 = 0.005;
/// The caller then works alone for so many times as long as they have lost beyond it: where another process wants their cores,
/// helpers cost at most a fortieth of the time. Twice as long whenever they fail again before they have earned that much, at most
/// for `LONGEST_REST_S`, after which they are tried again.
const REST: f64 = 40.0;
const LONGEST_REST_S: f64 = 1.0;

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
    gain: Gain,
}

/// How much time the helper threads have lately saved, compared with the caller working alone. When the operating system suspends
/// a helper that has begun a portion of the work, the caller has to wait until the helper runs again; where that happens often,
/// working alone is faster.
#[derive(Debug, Default)]
struct Gain {
    seconds: f64,
    /// Until when the caller works alone.
    rests_until: Option<Instant>,
    /// How often they have been sent away since they had earned all that they may lose.
    failures: i32,
}

impl Gain {
    /// Takes note of a step that took `together` s and would have taken `alone` s without helpers.
    fn note(&mut self, alone: f64, together: f64, now: Instant) {
        self.seconds = (self.seconds + alone - together).min(MOST_CREDIT_S);
        if self.seconds < 0.0 {
            let rest = (-REST * self.seconds * 2.0_f64.powi(self.failures)).min(LONGEST_REST_S);
            let rests_until = Some(now + Duration::from_secs_f64(rest));
            *self = Self { seconds: 0.0, rests_until, failures: self.failures.saturating_add(1) };
        } else if self.seconds == MOST_CREDIT_S {
            self.failures = 0;
        }
    }

    /// Whether the caller had better work alone.
    fn is_negative(&mut self) -> bool {
        let rests = self.rests_until.is_some_and(|until| Instant::now() < until);
        if !rests {
            self.rests_until = None;
        }
        rests
    }
}

/// Threads beside the caller's, their scratches, what they join, and the process that they live in.
struct Helpers {
    process: u32,
    /// There until it is dropped.
    pool: Option<rayon::ThreadPool>,
    shared: Arc<SharedJob>,
    scratches: Vec<Mutex<Scratches>>,
}

impl Crew {
    /// Helpers start when they are first needed.
    pub fn new(threads: usize) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        // A caller that looks on would keep a helper from its core, if there are too few.
        let patience = if threads > cores { Duration::ZERO } else { PATIENCE };
        Self { threads, patience, scratches: Scratches::default(), helpers: None, gain: Gain::default() }
    }

    /// Steps all blocks. Helpers join in when they have woken up; the caller does what they do not get round to.
    pub fn run(&mut self, work: Work<'_>, setup: &Setup) -> Result<()> {
        let blocks = work.blocks.len();
        let called = self.threads.min(blocks / BLOCKS_PER_THREAD);
        if called < 2 || self.gain.is_negative() {
            work.run(setup, &mut self.scratches);
            return Ok(());
        }
        let work = Mutex::new(work);
        let join = |scratches: &mut Scratches| {
            let next = || work.lock().unwrap_or_else(PoisonError::into_inner).portion(called);
            let mut done = 0;
            while let Some(portion) = next() {
                done += portion.blocks.len();
                portion.run(setup, scratches);
            }
            done
        };
        let Helpers { pool, shared, scratches, .. } = helpers(&mut self.helpers, self.threads)?;
        let help = |helper: usize| _ = join(&mut scratches[helper].lock().unwrap_or_else(PoisonError::into_inner));
        let call = || {
            let shared = Arc::clone(shared);
            let work = move || shared.join(rayon::current_thread_index().unwrap_or(0));
            pool.iter().for_each(|pool| pool.spawn(work.clone()));
        };
        let (began, mut own) = (Instant::now(), 0);
        let waited = shared.run(&help, called - 1, call, self.patience, || own = join(&mut self.scratches));
        if own > 0 {
            let together = began.elapsed();
            let alone = together.saturating_sub(waited).as_secs_f64() * blocks as f64 / own as f64;
            self.gain.note(alone, together.as_secs_f64(), began + together);
        }
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
        *slot = Some(Helpers { process, pool: Some(pool), shared: Arc::default(), scratches });
    }
    slot.as_mut().ok_or_else(|| Error::Invalid("no threads".into()))
}

impl Drop for Helpers {
    fn drop(&mut self) {
        if std::process::id() != self.process {
            // To drop the parent's pool could wait for a lock that one of its threads, which are not here, held at the fork.
            std::mem::forget(self.pool.take());
        }
    }
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
    use crate::config::Config;
    use crate::episode::reward::TERMS;
    use crate::vector::autoreset::Autoreset;
    use crate::vector::block::{LANES, block};

    const BLOCKS: usize = 16;
    const WALKERS: usize = BLOCKS * LANES;

    /// Observations of walkers after some steps of a crew.
    fn walk(crew: &mut Crew, steps: usize) -> Vec<f32> {
        let setup = Setup::new(Config::default(), Autoreset::NextStep).unwrap();
        let mut blocks: Vec<_> = (0..BLOCKS).map(|_| block(&setup, LANES)).collect();
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
        helpers(&mut crew.helpers, 2).unwrap().pool.as_ref().unwrap().spawn(occupy);
        assert_eq!(walk(&mut crew, 40), expected);
        release.send(()).unwrap();
        assert_eq!(outcome.recv().unwrap(), Ok(()), "the caller has waited for a helper that did not run");
        assert_eq!(walk(&mut crew, 40), expected);
    }

    #[test]
    fn a_caller_whose_helpers_cost_more_than_they_gain_works_alone_and_calls_them_again_later() {
        let expected = walk(&mut Crew::new(1), 40);
        let mut crew = Crew::new(2);
        crew.gain.rests_until = Some(Instant::now() + Duration::from_secs(3600));
        assert_eq!(walk(&mut crew, 40), expected);
        assert!(crew.helpers.is_none());
        crew.gain.rests_until = Some(Instant::now());
        assert_eq!(walk(&mut crew, 40), expected);
        assert!(crew.helpers.is_some());
    }

    #[test]
    fn what_helpers_have_gained_they_may_lose_before_they_are_sent_away() {
        let (mut gain, now) = (Gain::default(), Instant::now());
        // Two hundred steps of which each is half a millisecond shorter than alone: credit, but no more than there may be.
        (0..200).for_each(|_| gain.note(1e-3, 0.5e-3, now));
        assert_eq!((gain.seconds, gain.rests_until), (MOST_CREDIT_S, None));
        // An interruption of 3 ms is forgiven, a second one is paid for.
        gain.note(1e-3, 4e-3, now);
        assert!(gain.seconds > 0.0 && gain.rests_until.is_none());
        gain.note(1e-3, 4e-3, now);
        let rest = gain.rests_until.unwrap() - now;
        assert!((rest.as_secs_f64() - REST * 1e-3).abs() < 1e-9, "{rest:?}");
        // The next time twice as much, unless they have earned their credit again.
        let next = |gain: &mut Gain| {
            gain.note(1e-3, 2e-3, now);
            (gain.rests_until.unwrap() - now).as_secs_f64()
        };
        assert!((next(&mut gain) - 2.0 * REST * 1e-3).abs() < 1e-9);
        assert!((next(&mut gain) - 4.0 * REST * 1e-3).abs() < 1e-9);
        (0..200).for_each(|_| gain.note(1e-3, 0.5e-3, now));
        gain.note(1e-3, 5.5e-3, now);
        assert!((next(&mut gain) - 0.5 * REST * 1e-3).abs() < 1e-9);
        // However long a helper was away, it is tried again before long.
        gain.note(1e-3, 2.0, now);
        assert!((gain.rests_until.unwrap() - now).as_secs_f64() <= LONGEST_REST_S);
    }
}
