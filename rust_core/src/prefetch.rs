//! Asking for memory before it is needed. Batches beyond some thousand walkers do not fit into the caches.

/// Bytes that caches move at once.
const CACHE_LINE: usize = 64;

/// Has `value` fetched into the caches while the caller goes on with something else. A hint that changes no result.
#[inline(always)]
pub fn prefetch<T: ?Sized>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    for offset in (0..size_of_val(value)).step_by(CACHE_LINE) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let line = std::ptr::from_ref(value).cast::<i8>().wrapping_add(offset);
        // SAFETY: a prefetch reads nothing; any address is allowed.
        #[allow(unsafe_code)]
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(line);
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (value, CACHE_LINE);
}
