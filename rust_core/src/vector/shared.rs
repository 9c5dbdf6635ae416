//! A value that threads take turns with, and what becomes of a panic in their work: an error, and a value that nobody uses again.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::time::{Duration, Instant};

use crate::schema::error::{Error, Result};

/// Forks between the first process and this one.
static FORKS: AtomicU64 = AtomicU64::new(0);
/// A thread that has taken its turn says so within this time.
const TO_BE_SAID: Duration = Duration::from_secs(1);

/// To be called in every process that has been forked off, before anything else.
pub fn forked() {
    FORKS.fetch_add(1, Ordering::SeqCst);
}

/// Does `work`; a panic in it is an [`Error::Internal`].
pub fn guarded<R>(work: impl FnOnce() -> Result<R>) -> Result<R> {
    // What `work` leaves half done is the caller's to throw away.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
        Err(Error::Internal(text.unwrap_or_else(|| "a panic without a message".to_owned())))
    })
}

/// A value that one thread at a time works on; the others wait.
#[derive(Debug)]
pub struct Shared<T> {
    value: Mutex<T>,
    /// [`FORKS`] of the last thread that had its turn.
    forks: AtomicU64,
}

impl<T> Shared<T> {
    /// Nobody's turn yet.
    pub fn new(value: T) -> Self {
        Self { value: Mutex::new(value), forks: AtomicU64::new(0) }
    }

    /// Does `work` on the value when it is this thread's turn. If it panics, the value may be half changed: that is an error
    /// now, and to everybody who comes later.
    pub fn with<R>(&self, work: impl FnOnce(&mut T) -> Result<R>) -> Result<R> {
        guarded(|| work(&mut *self.lock()?))
    }

    /// The same without waiting: `None` if it is somebody else's turn.
    pub fn try_with<R>(&self, work: impl FnOnce(&mut T) -> Result<R>) -> Option<Result<R>> {
        let mut guard = match self.value.try_lock() {
            Ok(guard) => guard,
            Err(TryLockError::WouldBlock) => return None,
            Err(TryLockError::Poisoned(_)) => return Some(Err(spoilt())),
        };
        self.forks.store(FORKS.load(Ordering::SeqCst), Ordering::SeqCst);
        Some(guarded(move || work(&mut guard)))
    }

    fn lock(&self) -> Result<MutexGuard<'_, T>> {
        let forks = FORKS.load(Ordering::SeqCst);
        let guard = match self.value.try_lock() {
            Err(TryLockError::WouldBlock) => {
                self.await_turn_of_this_process(forks)?;
                self.value.lock().map_err(|_| spoilt())
            }
            Err(TryLockError::Poisoned(_)) => Err(spoilt()),
            Ok(guard) => Ok(guard),
        }?;
        self.forks.store(forks, Ordering::SeqCst);
        Ok(guard)
    }

    /// An error if whoever has its turn is a thread of the process that this one was forked off from: it does not run here,
    /// so its turn would never end, and the value is half changed.
    fn await_turn_of_this_process(&self, forks: u64) -> Result<()> {
        let since = Instant::now();
        while self.forks.load(Ordering::SeqCst) != forks {
            if since.elapsed() > TO_BE_SAID {
                return Err(Error::Unusable(
                    "a thread of the parent process was at work on this batch when this process was forked: make a new one"
                        .to_owned(),
                ));
            }
            if !matches!(self.value.try_lock(), Err(TryLockError::WouldBlock)) {
                return Ok(()); // its turn has ended
            }
            std::thread::sleep(Duration::from_micros(50));
        }
        Ok(())
    }
}

fn spoilt() -> Error {
    Error::Unusable("an internal error has left this batch half changed: make a new one".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_internal_error_and_spoils_the_value_for_everybody() {
        let shared = Shared::new(vec![1, 2, 3]);
        assert_eq!(shared.with(|values| Ok(values.len())).unwrap(), 3);
        let error = shared.with(|values| {
            values.clear();
            Ok(values[0])
        });
        let Err(Error::Internal(text)) = error else { panic!("{error:?}") };
        assert!(text.contains("index out of bounds"), "{text}");
        for _ in 0..2 {
            assert!(matches!(shared.with(|values| Ok(values.len())), Err(Error::Unusable(_))));
        }
        assert_eq!(guarded(|| -> Result<()> { panic!("of {}", 7) }), Err(Error::Internal("of 7".to_owned())));
    }

    #[test]
    fn an_error_spoils_nothing() {
        let shared = Shared::new(0);
        let refused = shared.with(|_| -> Result<()> { Err(Error::Invalid("no".to_owned())) });
        assert_eq!(refused, Err(Error::Invalid("no".to_owned())));
        assert_eq!(shared.with(|value| Ok(*value)), Ok(0));
    }

    #[test]
    fn threads_take_turns() {
        let shared = Shared::new(0_u64);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..1000 {
                        let turn = shared.with(|value| {
                            let before = *value;
                            std::hint::black_box(&value);
                            *value = before + 1;
                            Ok(())
                        });
                        turn.unwrap();
                    }
                });
            }
        });
        assert_eq!(shared.with(|value| Ok(*value)), Ok(8000));
    }
}
