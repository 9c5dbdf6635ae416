//! Saved environments as bytes: a header that names version, configuration and contents, then one environment after the other.

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::numerics::math::scramble;
use crate::schema::error::{Error, Result};
use crate::vector::environment::SavedEnvironment;

/// Version of the format: a change of any saved struct makes a new one.
const VERSION: u16 = 3;
const MAGIC: [u8; 4] = *b"PGYM";

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    magic: [u8; 4],
    version: u16,
    configuration: u64,
    /// [`digest`] of what follows: what comes back is what was saved, so nothing in it need be doubted.
    contents: u64,
}

/// A number that two byte strings share only if they are equal, but for a chance of 2^-64.
fn digest(bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks();
    let hash = words.iter().fold(bytes.len() as u64, |hash, word| scramble(hash ^ u64::from_le_bytes(*word)));
    rest.iter().fold(hash, |hash, byte| scramble(hash ^ u64::from(*byte)))
}

fn fingerprint(config: &Config) -> Result<u64> {
    let text = serde_json::to_string(config).map_err(|error| Error::Invalid(error.to_string()))?;
    Ok(digest(text.as_bytes()))
}

/// Bytes of saved environments.
pub fn encode(config: &Config, saved: &[SavedEnvironment]) -> Result<Vec<u8>> {
    let failed = |error: postcard::Error| Error::Invalid(format!("cannot save the state: {error}"));
    let contents = postcard::to_stdvec(saved).map_err(failed)?;
    let (configuration, digest) = (fingerprint(config)?, digest(&contents));
    let header = Header { magic: MAGIC, version: VERSION, configuration, contents: digest };
    let mut bytes = postcard::to_stdvec(&header).map_err(failed)?;
    bytes.extend(contents);
    Ok(bytes)
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
    if header.contents != digest(rest) {
        return Err(invalid("is damaged"));
    }
    let (saved, rest) = postcard::take_from_bytes(rest).map_err(|error| invalid(&format!("is damaged: {error}")))?;
    if rest.is_empty() { Ok(saved) } else { Err(invalid("is damaged: it is too long")) }
}
