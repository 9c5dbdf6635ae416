"""Dynamics of any planar serial chain, `H(q) qdd + C(q, qd) = tau + sum of J^T f`, over NumPy arrays.

Body i moves on joint i relative to body i - 1, body 0 relative to the ground; joints, bodies and the entries of q are
counted from 0 at the ground. The plane is x forward, y up, angles counter-clockwise. Positions `q`, velocities `qd`,
accelerations `qdd` and forces `tau` have shape (..., n) for n joints: m, m/s, m/s^2 and N for prismatic joints, rad,
rad/s, rad/s^2 and N m for revolute ones. Leading dimensions are a batch; those of several arguments broadcast.

>>> pendulum = Chain([Joint("r", mass=2.0, com=(0.0, -0.5))])
>>> pendulum.mass_matrix([0.1]).item(), pendulum.bias([0.0], [0.0]).item()
(0.5, 0.0)
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import load_config

Floats = NDArray[np.float64]
Vector = tuple[float, float]


@dataclass(frozen=True)
class Joint:
    """A joint and the body that moves on it. `Chain` checks the values."""

    kind: Literal["px", "py", "r"]
    """Shift along the x- or y-axis of the joint's frame, or counter-clockwise rotation."""
    offset: Vector = (0.0, 0.0)
    """Origin of the body's frame in the parent body's frame at q = 0, m."""
    angle: float = 0.0
    """Angle of the body's frame in the parent body's frame at q = 0, rad."""
    mass: float = 0.0
    """Mass of the body, kg; 0 for a body that only connects two joints."""
    com: Vector = (0.0, 0.0)
    """Centre of mass in the body's frame, m."""
    inertia: float = 0.0
    """Inertia of the body about its centre of mass, kg m^2."""


@dataclass(frozen=True)
class ExternalForce:
    """A force on a point of a body; leading dimensions are a batch."""

    body: int
    """Index of the body."""
    point: ArrayLike
    """Point of application in the body's frame, m, shape (..., 2)."""
    force: ArrayLike
    """Force along the world's axes, N, shape (..., 2)."""


class Chain:
    """Immutable model of a planar serial chain in a uniform field of gravity."""

    joints: tuple[Joint, ...]
    gravity: Vector

    def __init__(self, joints: Sequence[Joint], gravity: Vector = (0.0, -9.81)) -> None:
        """Build the chain of `joints`, from the ground outwards.

        Args:
            joints: the joints with their bodies, at least one.
            gravity: field of gravity along the world's axes, m/s^2.

        Raises:
            ValueError: a kind is unknown, or a value is no finite number or negative where it must not be.

        """
        self.joints, self.gravity = tuple(joints), gravity
        self._core = _core.Chain({"joints": [asdict(joint) for joint in self.joints], "gravity": gravity})

    def __repr__(self) -> str:
        return f"Chain({list(self.joints)}, gravity={self.gravity})"

    def __reduce__(self) -> tuple[type["Chain"], tuple[tuple[Joint, ...], Vector]]:
        return Chain, (self.joints, self.gravity)

    def frames(self, q: ArrayLike) -> Floats:
        """Pose of every body's frame in the world: x (m), y (m) and angle (rad, in (-pi, pi]), shape (..., n, 3)."""
        batch, (q,) = self._rows(q=q)
        return self._core.frames(q).reshape(*batch, len(self.joints), 3)

    def point_position(self, q: ArrayLike, body: int, point: ArrayLike = (0.0, 0.0)) -> Floats:
        """Position in the world (m, shape (..., 2)) of a `point` (m, shape (..., 2)) in the frame of a body."""
        batch, (q, point) = self._rows(q=q, point=point)
        return self._core.point_position(q, self._index("body", body), point).reshape(*batch, 2)

    def point_velocity(self, q: ArrayLike, qd: ArrayLike, body: int, point: ArrayLike = (0.0, 0.0)) -> Floats:
        """Velocity along the world's axes (m/s, shape (..., 2)) of a `point` (m, shape (..., 2)) fixed to a body."""
        batch, (q, qd, point) = self._rows(q=q, qd=qd, point=point)
        return self._core.point_velocity(q, qd, self._index("body", body), point).reshape(*batch, 2)

    def mass_matrix(self, q: ArrayLike) -> Floats:
        """Inertia H of the joints, shape (..., n, n): kg, kg m and kg m^2."""
        batch, (q,) = self._rows(q=q)
        n = len(self.joints)
        return self._core.mass_matrix(q).reshape(*batch, n, n)

    def bias(self, q: ArrayLike, qd: ArrayLike) -> Floats:
        """Return the forces C that leave the joints unaccelerated, shape (..., n): gravity and velocity products."""
        batch, (q, qd) = self._rows(q=q, qd=qd)
        return self._core.bias(q, qd).reshape(*batch, len(self.joints))

    def inverse_dynamics(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, external_forces: Sequence[ExternalForce] | None = None
    ) -> Floats:
        """Return the forces `tau`, shape (..., n), that cause the accelerations `qdd` under the external forces."""
        batch, (q, qd, qdd, *loads) = self._rows(q=q, qd=qd, qdd=qdd, **_points_and_forces(external_forces))
        tau = self._core.inverse_dynamics(q, qd, qdd, self._loads(external_forces, loads))
        return tau.reshape(*batch, len(self.joints))

    def hybrid_dynamics(  # noqa: PLR0917 - the quantities of the equation of motion
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        tau: ArrayLike,
        forward: ArrayLike,
        external_forces: Sequence[ExternalForce] | None = None,
    ) -> tuple[Floats, Floats]:
        """Find the accelerations of the joints in `forward` and the forces of the others.

        Args:
            q: positions.
            qd: velocities.
            qdd: accelerations; those of forward joints are not read.
            tau: forces; only those of forward joints are read.
            forward: booleans, shape (..., n): True where the force is given and the acceleration wanted.
            external_forces: forces on points of bodies.

        Returns:
            `qdd` and `tau`, both complete, shape (..., n) each.

        Raises:
            ValueError: the forward joints can accelerate without moving any mass, or an argument does not fit.

        """
        batch, (q, qd, qdd, tau, forward, *loads) = self._rows(
            q=q, qd=qd, qdd=qdd, tau=tau, forward=forward, **_points_and_forces(external_forces)
        )
        qdd, tau = qdd.copy(), tau.copy()
        self._core.hybrid_dynamics(q, qd, qdd, tau, forward, self._loads(external_forces, loads))
        shape = (*batch, len(self.joints))
        return qdd.reshape(shape), tau.reshape(shape)

    def kinetic_energy(self, q: ArrayLike, qd: ArrayLike) -> Floats:
        """Kinetic energy, J, shape (...)."""
        batch, (q, qd) = self._rows(q=q, qd=qd)
        return self._core.kinetic_energy(q, qd).reshape(batch)

    def potential_energy(self, q: ArrayLike) -> Floats:
        """Potential energy in the field of gravity, J, shape (...); 0 with the centre of mass at the world's origin."""
        batch, (q,) = self._rows(q=q)
        return self._core.potential_energy(q).reshape(batch)

    def _rows(self, **arguments: ArrayLike) -> tuple[tuple[int, ...], list[NDArray[Any]]]:
        """Broadcast the batch dimensions of the arguments, and flatten these to rows: (batch, argument's rows)."""
        arrays = {
            name: _array(name, value, width=2 if name.endswith(("point", "force")) else len(self.joints))
            for name, value in arguments.items()
        }
        try:
            batch = np.broadcast_shapes(*(array.shape[:-1] for array in arrays.values()))
        except ValueError as error:
            shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
            raise ValueError(f"leading dimensions do not broadcast: {shapes}") from error
        count = math.prod(batch)
        widened = ((np.broadcast_to(array, (*batch, array.shape[-1]))) for array in arrays.values())
        return batch, [np.ascontiguousarray(array.reshape(count, array.shape[-1])) for array in widened]

    def _loads(
        self, external_forces: Sequence[ExternalForce] | None, rows: list[Floats]
    ) -> list[tuple[int, Floats, Floats]]:
        keys = (f"external_forces[{i}].body" for i in range(len(rows)))
        bodies = (self._index(key, force.body) for key, force in zip(keys, external_forces or (), strict=False))
        return list(zip(bodies, rows[::2], rows[1::2], strict=True))

    def _index(self, key: str, body: int) -> int:
        if isinstance(body, int | np.integer) and 0 <= body < len(self.joints):
            return int(body)
        raise ValueError(f"{key} = {body!r} is outside its allowed range [0, {len(self.joints) - 1}]")


def walker_chain(config: str | Path | Mapping[str, Any] | None = None) -> Chain:
    """Return the walker of Table 1 as a chain, with the dimensions of the configuration's section `body`.

    Its joints are 0 px and 1 py (the hip's position), 2 trunk, 3 hip, 4 knee, 5 tube extension (py), 6 tube rotation
    and 7 ankle.

    Args:
        config: path of a TOML file, a nested mapping, or None for the defaults.

    """
    return Chain([Joint(**joint) for joint in _core.walker_joints(load_config(config))])


def _array(name: str, value: ArrayLike, width: int) -> NDArray[Any]:
    dtype: type[np.generic] = np.bool_ if name == "forward" else np.float64
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error
    if array.dtype.kind not in ("b" if dtype is np.bool_ else "fiu"):
        raise ValueError(
            f"{name} has dtype {array.dtype}, must be {'boolean' if dtype is np.bool_ else 'real numbers'}"
        )
    if array.shape[-1:] != (width,):
        raise ValueError(f"{name} has shape {array.shape}, must be (..., {width})")
    return array.astype(dtype, copy=False)


def _points_and_forces(external_forces: Sequence[ExternalForce] | None) -> dict[str, ArrayLike]:
    arguments: dict[str, ArrayLike] = {}
    for i, load in enumerate(external_forces or ()):
        arguments |= {f"external_forces[{i}].point": load.point, f"external_forces[{i}].force": load.force}
    return arguments
