//! Human controller (section 4): intent and speed in, hip and trunk references and trunk forces out.
//!
//! Everything that changes only at steps is kept in [`gait_fsm::Memory`]; from it follow the [`drive::Drive`] that the
//! continuous equations run on and the [`guard::Guard`] of the next transition, both without a branch on the state.

pub mod drive;
pub mod gait_fsm;
pub mod geometry;
pub mod guard;
pub mod impedance;
pub mod intent;
pub mod params;
pub mod reference;
pub mod slip_leg;
pub mod variation;
