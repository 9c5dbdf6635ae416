//! How a step is shared out to threads: the caller's, and those of its helpers.

use std::hint::spin_loop;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::block::{Block, Scratches};
use crate::environment::Setup;
use crate::error::{Error, Result};
use crate::prefetch::{Ahead, prefetch};
use crate::step_output::StepOutput;

/// Blocks for each thread that is called: waking one up takes as long as stepping a few.
const BLOCKS_PER_THREAD: usize = 3;
/// Portions that a thread would cut its share of what is left into. It takes one: few are handed out, and all threads end
/// within a block's time.
const PORTIONS: usize = 4;
/// How long the caller looks whether helpers have finished before it sleeps: falling asleep and waking up takes as long.
const PATIENCE: Duration = Duration::from_micros(30);

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
}

/// Threads beside the caller's, their scratches, and the process that they live in.
#[derive(Debug)]
struct Helpers {
    process: u32,
    pool: rayon::ThreadPool,
    scratches: Vec<Scratches>,
}

impl Crew {
    /// Helpers start when they are first needed.
    pub fn new(threads: usize) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        // A caller that looks on would keep a helper from its core, if there are too few.
        let patience = if threads > cores { Duration::ZERO } else { PATIENCE };
        Self { threads, patience, scratches: Scratches::default(), helpers: None }
    }

    /// Steps all blocks.
    pub fn run(&mut self, work: Work<'_>, setup: &Setup) -> Result<()> {
        let called = self.threads.min(work.blocks.len() / BLOCKS_PER_THREAD);
        if called < 2 {
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
        let Helpers { pool, scratches, .. } = helpers(&mut self.helpers, self.threads)?;
        let finished = AtomicUsize::new(1);
        // Helpers join in when they have woken up.
        pool.in_place_scope(|scope| {
            for scratches in &mut scratches[..called - 1] {
                scope.spawn(|_| {
                    join(scratches);
                    finished.fetch_add(1, Ordering::Release);
                });
            }
            join(&mut self.scratches);
            let since = Instant::now();
            while finished.load(Ordering::Acquire) < called && since.elapsed() < self.patience {
                spin_loop();
            }
        });
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
        let scratches = (0..pool.current_num_threads()).map(|_| Scratches::default()).collect();
        // Dropping the parent's could wait for a lock that one of its threads, which are not here, held at the fork.
        std::mem::forget(slot.replace(Helpers { process, pool, scratches }));
    }
    slot.as_mut().ok_or_else(|| Error::Invalid("no threads".into()))
}
