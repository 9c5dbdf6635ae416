//! Hybrid dynamics of any planar serial chain (section 3.1): `H(q) q'' + C(q, q') = tau + sum of J^T f`.
//!
//! Body i moves on joint i relative to body i - 1, body 0 relative to the ground; gravity and external forces act on it.
//! Each joint is either a forward-dynamics joint (force given, acceleration wanted) or an inverse-dynamics joint (the
//! reverse). The algorithms are those of R. Featherstone, Rigid Body Dynamics Algorithms (2008), in body coordinates:
//! recursive Newton-Euler (Table 5.1), composite rigid bodies (Table 6.2) and hybrid dynamics (section 9.1).

mod dynamics;
mod joint;
mod model;
mod planar;
mod posture;

pub use dynamics::Workspace;
pub use joint::{Joint, JointKind};
pub use model::{Chain, ExternalForce, MOST_JOINTS};
pub use planar::{Frame, Vector};
pub use posture::Posture;
