//! Saved environments as bytes: a header that names version and configuration, then one environment after the other.

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::environment::SavedEnvironment;
use crate::error::{Error, Result};
use crate::math::scramble;

/// Version of the format: a change of any saved struct makes a new one.
const VERSION: u16 = 2;
const MAGIC: [u8; 4] = *b"PGYM";

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    magic: [u8; 4],
    version: u16,
    configuration: u64,
}

/// A number that two configurations share only if they are equal, but for a chance of 2^-64.
fn fingerprint(config: &Config) -> Result<u64> {
    let text = serde_json::to_string(config).map_err(|error| Error::Invalid(error.to_string()))?;
    Ok(text.bytes().fold(0, |hash, byte| scramble(hash ^ u64::from(byte))))
}

/// Bytes of saved environments.
pub fn encode(config: &Config, saved: &[SavedEnvironment]) -> Result<Vec<u8>> {
    let header = Header { magic: MAGIC, version: VERSION, configuration: fingerprint(config)? };
    postcard::to_stdvec(&(header, saved)).map_err(|error| Error::Invalid(format!("cannot save the state: {error}")))
}

/// Saved environments of the same configuration.
pub fn decode(config: &Config, bytes: &[u8]) -> Result<Vec<SavedEnvironment>> {
    let invalid = |reason: &str| Error::Invalid(format!("state {reason}"));
    let (header, rest): (Header, _) =
        postcard::take_from_bytes(bytes).map_err(|_| invalid("is not one of this package"))?;
    if header.magic != MAGIC {
        return Err(invalid("is not one of this package"));
    }
    if header.version != VERSION {
        return Err(invalid(&format!("has version {}, must have {VERSION}", header.version)));
    }
    if header.configuration != fingerprint(config)? {
        return Err(invalid("belongs to another configuration"));
    }
    let (saved, rest) = postcard::take_from_bytes(rest).map_err(|error| invalid(&format!("is damaged: {error}")))?;
    if rest.is_empty() { Ok(saved) } else { Err(invalid("is damaged: it is too long")) }
}
