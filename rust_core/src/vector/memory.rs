//! Whether there is memory for what is about to be made: too much is an error, not the end of the process.

use sysinfo::{MemoryRefreshKind, System};

use crate::schema::error::{Error, Result};

/// Below this nobody asks.
const LITTLE: u64 = 1 << 26;

/// An error that names `what`, the bytes that it needs and those available, if there are not so many.
///
/// Systems hand out more memory than they have, and end the process that uses it; so what is available is asked for first.
pub fn check(what: &str, bytes: u64) -> Result<()> {
    if bytes < LITTLE {
        return Ok(());
    }
    let available = available();
    if available.is_none_or(|available| bytes <= available) && can_be_reserved(bytes) {
        return Ok(());
    }
    let available = match available {
        Some(available) if available < bytes => format!("available are {available} bytes ({})", gigabytes(available)),
        _ => "available are fewer to this process".to_owned(),
    };
    Err(Error::Invalid(format!("{what} needs {bytes} bytes of memory ({}), {available}", gigabytes(bytes))))
}

/// Memory that this process may still use, as far as the system tells.
fn available() -> Option<u64> {
    let mut system = System::new();
    system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
    if system.total_memory() == 0 {
        return None;
    }
    // A container's limit may be below what the machine has.
    let limit = system.cgroup_limits().map_or(u64::MAX, |limits| limits.total_memory.saturating_sub(limits.rss));
    Some(system.available_memory().min(limit))
}

/// Whether the process's own limits allow it.
fn can_be_reserved(bytes: u64) -> bool {
    usize::try_from(bytes).is_ok_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok())
}

fn gigabytes(bytes: u64) -> String {
    format!("{:.1} GB", bytes as f64 / 1e9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_refused_with_its_name_and_both_numbers() {
        let error = check("num_envs = 7", 1 << 60).unwrap_err().to_string();
        assert!(error.starts_with("num_envs = 7 needs 1152921504606846976 bytes"), "{error}");
        assert!(error.contains("available are") && error.contains("GB"), "{error}");
        check("little", LITTLE).unwrap();
        check("nothing", 0).unwrap();
    }
}
