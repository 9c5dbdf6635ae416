//! A job that helpers may join while its owner works at it. The owner waits for those who have joined, never for those who have
//! been called and have not come: the system may run something else in their place for as long as it likes.

use std::any::Any;
use std::hint::spin_loop;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// What there is to do for whoever joins, given the number of the helper.
type Job<'a> = dyn Fn(usize) + Sync + 'a;

/// Where an owner offers one job after the other.
#[derive(Default)]
pub struct SharedJob {
    offer: Mutex<Offer>,
    /// Helpers that work at the job; changed under the lock alone, so that a helper either is seen or finds the offer withdrawn.
    inside: AtomicUsize,
    left: Condvar,
}

#[derive(Default)]
struct Offer {
    job: Option<&'static Job<'static>>,
    /// Helpers that have been called and have not come yet.
    called: usize,
    /// What a helper has panicked with.
    panic: Option<Box<dyn Any + Send>>,
}

impl SharedJob {
    /// Runs `own` while helpers that [`join`](Self::join) run `job`, of whom `helpers` are wanted: `call` is to send one more.
    /// Returns once nobody works at the job any longer, and how long that took after `own` had ended; a panic of a helper goes on
    /// in the owner. The owner looks on for `patience` before it sleeps.
    pub fn run(
        &self,
        job: &Job<'_>,
        helpers: usize,
        mut call: impl FnMut(),
        patience: Duration,
        own: impl FnOnce(),
    ) -> Duration {
        // SAFETY: only the lifetime changes. `Withdrawal` takes the job back and waits for every helper that has it, before this
        // function returns or unwinds, so nobody uses it after it has ended.
        #[allow(unsafe_code)]
        let job = unsafe { std::mem::transmute::<&Job<'_>, &'static Job<'static>>(job) };
        let withdrawal = Withdrawal { shared: self, patience };
        let missing = {
            let mut offer = self.lock();
            offer.job = Some(job);
            let missing = helpers.saturating_sub(offer.called);
            offer.called += missing;
            missing
        };
        (0..missing).for_each(|_| call());
        own();
        let since = Instant::now();
        drop(withdrawal);
        let waited = since.elapsed();
        if let Some(panic) = self.lock().panic.take() {
            resume_unwind(panic);
        }
        waited
    }

    /// What a helper does that has been called: joins the present job, if there is one.
    pub fn join(&self, helper: usize) {
        let job = {
            let mut offer = self.lock();
            offer.called -= 1;
            let Some(job) = offer.job else { return };
            self.inside.fetch_add(1, Ordering::Relaxed);
            job
        };
        let outcome = catch_unwind(AssertUnwindSafe(|| job(helper)));
        let mut offer = self.lock();
        if let Err(panic) = outcome {
            offer.panic = Some(panic);
        }
        self.inside.fetch_sub(1, Ordering::Release);
        drop(offer);
        self.left.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, Offer> {
        self.offer.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Takes the job back and waits for those inside when it goes out of scope, also when its owner panics.
struct Withdrawal<'a> {
    shared: &'a SharedJob,
    patience: Duration,
}

impl Drop for Withdrawal<'_> {
    fn drop(&mut self) {
        let Self { shared, patience } = self;
        shared.lock().job = None;
        let since = Instant::now();
        while shared.inside.load(Ordering::Acquire) > 0 && since.elapsed() < *patience {
            spin_loop();
        }
        let mut offer = shared.lock();
        while shared.inside.load(Ordering::Acquire) > 0 {
            offer = shared.left.wait(offer).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::mpsc::channel;

    use super::*;

    const PATIENCE: Duration = Duration::from_micros(30);

    #[test]
    fn an_owner_does_not_wait_for_helpers_that_never_come() {
        let shared = SharedJob::default();
        let done = AtomicUsize::new(0);
        let mut calls = 0;
        for _ in 0..3 {
            let own = || _ = done.fetch_add(1, Ordering::Relaxed);
            shared.run(&|_| unreachable!("nobody joins"), 2, || calls += 1, PATIENCE, own);
        }
        // Those who have been called and have not come are not called again.
        assert_eq!((done.into_inner(), calls), (3, 2));
    }

    #[test]
    fn a_helper_that_comes_late_joins_the_present_job_or_none() {
        let shared = SharedJob::default();
        let mut calls = 0;
        shared.run(&|_| unreachable!("withdrawn before anybody joins"), 1, || calls += 1, PATIENCE, || ());
        let joined = AtomicUsize::new(0);
        let count = |helper| _ = joined.fetch_add(helper, Ordering::Relaxed);
        shared.run(&count, 1, || calls += 1, PATIENCE, || shared.join(7));
        shared.run(&count, 0, || calls += 1, PATIENCE, || ());
        assert_eq!((joined.into_inner(), calls), (7, 1));
    }

    #[test]
    fn an_owner_waits_for_helpers_that_have_joined() {
        let shared = Arc::new(SharedJob::default());
        let finished = AtomicUsize::new(0);
        let (joined, has_joined) = channel();
        let helper = Arc::clone(&shared);
        let job = |_| {
            joined.send(()).unwrap();
            std::thread::sleep(Duration::from_millis(50));
            finished.fetch_add(1, Ordering::Relaxed);
        };
        let mut threads = Vec::new();
        let call = || {
            threads.push(std::thread::spawn({
                let helper = Arc::clone(&helper);
                move || helper.join(0)
            }))
        };
        let waited = shared.run(&job, 1, call, PATIENCE, || has_joined.recv().unwrap());
        assert_eq!(finished.load(Ordering::Relaxed), 1);
        assert!(waited > Duration::ZERO);
    }

    #[test]
    fn a_helpers_panic_goes_on_in_the_owner_and_the_next_job_runs() {
        let shared = SharedJob::default();
        let run = || shared.run(&|_| panic!("of a helper"), 1, || (), PATIENCE, || shared.join(0));
        let panic = catch_unwind(AssertUnwindSafe(run)).unwrap_err();
        assert_eq!(panic.downcast_ref(), Some(&"of a helper"));
        let done = AtomicUsize::new(0);
        shared.run(&|_| _ = done.fetch_add(1, Ordering::Relaxed), 1, || (), PATIENCE, || shared.join(0));
        assert_eq!(done.into_inner(), 1);
    }
}
