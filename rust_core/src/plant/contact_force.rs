//! Contact of a point with the ground, and the force that it hands to the dynamics.

use crate::mechanics::compliant_ground::{self, Contact};
use crate::mechanics::motion::{Point, PointForce};
use crate::mechanics::terrain::Surface;

/// Contact of a point with a surface.
#[inline(always)]
pub(super) fn touch<const LEVEL: bool>(
    ground: &compliant_ground::Ground,
    surface: &Surface,
    point: &Point,
    deformation: f64,
) -> Contact {
    if LEVEL {
        return compliant_ground::contact(ground, point.y, point.vx, point.vy, deformation);
    }
    let (along, across) = surface.along_and_across(point.vx, point.vy);
    // Distance to the surface's tangent below the point.
    let distance = surface.cos * (point.y - surface.height);
    compliant_ground::contact(ground, distance, along, across, deformation)
}

/// Force of level ground on a point.
#[inline(always)]
pub fn level_force(contact: &Contact) -> PointForce {
    PointForce {
        x: contact.tangential,
        y: contact.normal,
        damping_x: contact.tangential_damping,
        damping_y: contact.normal_damping,
        stiffness_x: contact.tangential_stiffness,
        stiffness_y: contact.normal_stiffness,
        sin: 0.0,
        cos: 1.0,
    }
}

/// Force of a surface on a point that touches it.
#[inline(always)]
pub(super) fn point_force(contact: &Contact, surface: &Surface) -> PointForce {
    let (x, y) = surface.forward_and_up(contact.tangential, contact.normal);
    PointForce { x, y, sin: surface.sin, cos: surface.cos, ..level_force(contact) }
}
