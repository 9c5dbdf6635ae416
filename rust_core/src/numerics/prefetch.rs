//! Asking for memory before it is needed. Batches beyond some thousand walkers do not fit into the caches.

/// Bytes that caches move at once.
const CACHE_LINE: usize = 64;

/// Has `value` fetched into the caches while the caller goes on with something else. A hint that changes no result.
#[inline(always)]
pub fn prefetch<T: ?Sized>(value: &T) {
    let mut ahead = Ahead::of(value);
    ahead.fetch(1, 1);
}

/// Memory to fetch bit by bit while something else is done: asked for all at once, its end waits for its start.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ahead {
    start: usize,
    end: usize,
    next: usize,
}

impl Ahead {
    /// All of `value`.
    #[inline(always)]
    pub fn of<T: ?Sized>(value: &T) -> Self {
        let start = std::ptr::from_ref(value).addr();
        Self { start, end: start + size_of_val(value), next: start }
    }

    /// Asks for what is missing of the first `parts` of `all` parts.
    #[inline(always)]
    pub fn fetch(&mut self, parts: usize, all: usize) {
        let end = self.start + (self.end - self.start) * parts / all;
        while self.next < end {
            fetch_line(self.next);
            self.next += CACHE_LINE;
        }
    }
}

#[inline(always)]
fn fetch_line(address: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch reads nothing; any address is allowed.
        #[allow(unsafe_code)]
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(std::ptr::without_provenance(address));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}
