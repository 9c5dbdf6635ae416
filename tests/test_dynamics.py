"""The general chain against MuJoCo, a symbolic Lagrangian and itself."""

import math
import pickle
import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import sympy
from numpy.typing import ArrayLike, NDArray

from prosthesis_gym.dynamics import Chain, ExternalForce, Joint, walker_chain

Floats = NDArray[np.float64]

TOLERANCE = 1e-9
FOOT = 7
HEEL = (-0.025, -0.08)
PAPERS_SPLIT = [True, True, False, True, True, False, False, True]

# Table 1. MuJoCo takes no massless bodies: the tube's joints belong to the foot, whose frame is turned by 4 degrees at
# the ankle, 0.42 m below the knee; they lie at the tube sensor, 0.14 m up the tube.
MOUNT = math.radians(4.0)
TUBE_Y = f"{math.sin(MOUNT):.17g} {math.cos(MOUNT):.17g} 0"
SENSOR = f"{0.14 * math.sin(MOUNT):.17g} {0.14 * math.cos(MOUNT):.17g} 0"
WALKER_MJCF = f"""
<mujoco>
  <compiler angle="radian" autolimits="false"/>
  <option gravity="0 -9.81 0"><flag energy="enable"/></option>
  <default><joint armature="0" damping="0"/></default>
  <worldbody>
    <body name="trunk">
      <inertial pos="0 0.325 0" mass="62.5" diaginertia="4.401 4.401 4.401"/>
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>
      <body name="thigh">
        <inertial pos="0 -0.18 0" mass="9" diaginertia="0.1337 0.1337 0.1337"/>
        <joint type="hinge" axis="0 0 1"/>
        <body name="calf" pos="0 -0.42 0">
          <inertial pos="-0.01 -0.12 0" mass="2.8" diaginertia="0.03 0.03 0.03"/>
          <joint type="hinge" axis="0 0 1"/>
          <body name="foot" pos="0 -0.42 0" euler="0 0 {MOUNT:.17g}">
            <inertial pos="0.0625 -0.0533 0" mass="0.7" diaginertia="0.0018 0.0018 0.0018"/>
            <joint type="slide" axis="{TUBE_Y}"/><joint type="hinge" axis="0 0 1" pos="{SENSOR}"/>
            <joint type="hinge" axis="0 0 1"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def assert_close(found: ArrayLike, expected: ArrayLike) -> None:
    """Compare over the largest expected magnitude, at least 1."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    scale = max(1.0, float(np.abs(expected).max(initial=0.0)))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=TOLERANCE * scale)


def random_states(random: np.random.Generator, *shape: int) -> tuple[Floats, Floats, Floats, Floats]:
    """q, qd, qdd, tau of a shape (..., n)."""
    q, qd, qdd, tau = (random.uniform(-size, size, shape) for size in (1.5, 5.0, 20.0, 100.0))
    return q, qd, qdd, tau


def random_chain(random: np.random.Generator, n: int) -> Chain:
    def vector() -> tuple[float, float]:
        x, y = random.uniform(-0.5, 0.5, 2).tolist()
        return x, y

    def joint() -> Joint:
        angle, mass, inertia = random.uniform(-3, 3), random.uniform(0.5, 20.0), random.uniform(0.01, 2.0)
        return Joint(random.choice(["px", "py", "r"]), vector(), angle, mass, vector(), inertia)

    return Chain([joint() for _ in range(n)], gravity=vector())


def test_the_walker_moves_as_in_mujoco() -> None:
    model = mujoco.MjModel.from_xml_string(WALKER_MJCF)
    data = mujoco.MjData(model)
    chain, n = walker_chain(), 8
    for q, qd, _, tau in zip(*random_states(np.random.default_rng(1), 200, n), strict=True):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, qd, tau
        mujoco.mj_forward(model, data)
        mass_matrix = np.zeros((n, n))
        mujoco.mj_fullM(model, data, mass_matrix)
        assert_close(chain.mass_matrix(q), mass_matrix)
        assert_close(chain.bias(q, qd), data.qfrc_bias)
        assert_close([chain.potential_energy(q), chain.kinetic_energy(q, qd)], data.energy)
        assert_close(chain.frames(q)[[2, 3, 4, 7], :2], data.xpos[1:, :2])
        heel = data.body("foot").xpos + data.body("foot").xmat.reshape(3, 3) @ [*HEEL, 0.0]
        assert_close(chain.point_position(q, FOOT, HEEL), heel[:2])

        force = np.array([-300.0, 700.0])
        load = [ExternalForce(FOOT, HEEL, force)]
        mujoco.mj_applyFT(model, data, [*force, 0.0], np.zeros(3), heel, model.body("foot").id, data.qfrc_applied)
        mujoco.mj_forward(model, data)
        accelerations, _ = chain.hybrid_dynamics(q, qd, np.zeros(n), tau, np.ones(n, bool), load)
        assert_close(accelerations, data.qacc)
        # The paper's split: what MuJoCo found for the joints 3, 6 and 7 prescribed, their forces wanted.
        found = chain.hybrid_dynamics(q, qd, data.qacc, np.where(PAPERS_SPLIT, tau, np.nan), PAPERS_SPLIT, load)
        assert_close(found[0], data.qacc)
        assert_close(found[1], tau)


def lagrangian(chain: Chain) -> Any:  # noqa: ANN401 - a function that SymPy writes
    """Mass matrix and bias as a function of q and qd, from `d/dt dL/dqd - dL/dq` alone."""
    n = len(chain.joints)
    q, qd = sympy.symbols(f"q:{n}"), sympy.symbols(f"v:{n}")
    origin, angle, kinetic, potential = sympy.zeros(2, 1), sympy.Integer(0), 0, 0
    for joint, position in zip(chain.joints, q, strict=True):
        turned = sympy.rot_ccw_axis3(angle)[:2, :2] * sympy.Matrix(joint.offset)
        origin, angle = origin + turned, angle + joint.angle + (position if joint.kind == "r" else 0)
        axes = sympy.Matrix([[sympy.cos(angle), -sympy.sin(angle)], [sympy.sin(angle), sympy.cos(angle)]])
        shift = {"px": [position, 0], "py": [0, position], "r": [0, 0]}[joint.kind]
        origin += axes * sympy.Matrix(shift)
        com = origin + axes * sympy.Matrix(joint.com)
        velocity = com.jacobian(q) * sympy.Matrix(qd)
        spin = sum(sympy.diff(angle, position) * rate for position, rate in zip(q, qd, strict=True))
        kinetic += (joint.mass * velocity.dot(velocity) + joint.inertia * spin**2) / 2
        potential -= joint.mass * com.dot(sympy.Matrix(chain.gravity))
    momenta = sympy.Matrix([kinetic]).jacobian(qd)
    slope = sympy.Matrix([kinetic - potential]).jacobian(q)
    bias = momenta.jacobian(q) * sympy.Matrix(qd) - slope.T
    return sympy.lambdify([q, qd], [momenta.jacobian(qd), bias, kinetic, potential], cse=True)


@pytest.mark.parametrize("kinds", ["r r r", "px r py", "r py r"])
def test_three_links_obey_their_lagrangian(kinds: str) -> None:
    random = np.random.default_rng(2)
    joints = [
        Joint(kind, tuple(random.uniform(-0.5, 0.5, 2)), random.uniform(-2, 2), mass, (0.1, -0.2), inertia)  # type: ignore[arg-type]
        for kind, mass, inertia in zip(kinds.split(), (3.0, 1.2, 0.4), (0.2, 0.05, 0.01), strict=True)
    ]
    chain = Chain(joints, gravity=(1.5, -9.7))
    evaluate = lagrangian(chain)
    for q, qd, *_ in zip(*random_states(random, 50, 3), strict=True):
        mass_matrix, bias, kinetic, potential = evaluate(q, qd)
        assert_close(chain.mass_matrix(q), mass_matrix)
        assert_close(chain.bias(q, qd), bias.ravel())
        assert_close([chain.kinetic_energy(q, qd), chain.potential_energy(q)], [kinetic, potential])


def test_hybrid_after_inverse_dynamics_is_the_identity_for_every_split() -> None:
    random = np.random.default_rng(3)
    for n in range(1, 10):
        for _ in range(10):
            chain, forward = random_chain(random, n), random.random((20, n)) < 0.5
            q, qd, qdd, _ = random_states(random, 20, n)
            loads = [ExternalForce(n // 2, random.uniform(-0.3, 0.3, (20, 2)), random.uniform(-500, 500, (20, 2)))]
            tau = chain.inverse_dynamics(q, qd, qdd, loads)
            given = np.where(forward, np.nan, qdd), np.where(forward, tau, np.nan)  # what is wanted is not read
            found = chain.hybrid_dynamics(q, qd, *given, forward, loads)
            assert_close(found[0], qdd)
            assert_close(found[1], tau)


def test_velocities_and_energies_are_those_of_the_motion() -> None:
    """Differences over the path of a free motion: points move with their velocities, energy stays."""
    random = np.random.default_rng(4)
    chain, h = random_chain(random, 6), 1e-5
    q, qd, *_ = random_states(random, 40, 6)
    point = random.uniform(-0.3, 0.3, (40, 2))
    slope = (chain.point_position(q + h * qd, 4, point) - chain.point_position(q - h * qd, 4, point)) / (2 * h)
    np.testing.assert_allclose(chain.point_velocity(q, qd, 4, point), slope, atol=1e-7)
    qdd, _ = chain.hybrid_dynamics(q, qd, np.zeros(6), np.zeros(6), np.ones(6, bool))
    energies = [chain.kinetic_energy(q + t * qd, qd + t * qdd) + chain.potential_energy(q + t * qd) for t in (-h, h)]
    np.testing.assert_allclose((energies[1] - energies[0]) / (2 * h), 0.0, atol=1e-6 * float(np.abs(energies).max()))


def test_a_batch_is_its_states_one_by_one() -> None:
    random = np.random.default_rng(5)
    chain = random_chain(random, 5)
    q, qd, qdd, tau = random_states(random, 3, 4, 5)
    forward = random.random((3, 4, 5)) < 0.5
    point, force = random.uniform(-0.3, 0.3, 2), random.uniform(-500, 500, (3, 4, 2))

    def everything(i: Any) -> list[Floats]:  # noqa: ANN401 - any index
        load = [ExternalForce(2, point, force[i])]
        return [
            chain.frames(q[i]),
            chain.point_position(q[i], 3, point),
            chain.point_velocity(q[i], qd[i], 3, point),
            chain.mass_matrix(q[i]),
            chain.bias(q[i], qd[i]),
            chain.inverse_dynamics(q[i], qd[i], qdd[i], load),
            *chain.hybrid_dynamics(q[i], qd[i], qdd[i], tau[i], forward[i], load),
            chain.kinetic_energy(q[i], qd[i]),
            chain.potential_energy(q[i]),
        ]

    for index in np.ndindex(3, 4):
        for batched, alone in zip(everything(...), everything(index), strict=True):
            np.testing.assert_array_equal(batched[index], alone)
    assert all(array.shape[:2] == (0, 4) for array in everything(slice(0, 0)))
    # Leading dimensions broadcast, and neither layout nor type matters.
    np.testing.assert_array_equal(chain.bias(q, qd[0]), chain.bias(q, np.stack([qd[0]] * 3)))
    np.testing.assert_array_equal(chain.bias(np.asfortranarray(q), [0] * 5), chain.bias(q, np.zeros(5)))


def test_arguments_stay_as_they_are() -> None:
    chain = random_chain(np.random.default_rng(6), 3)
    qdd, tau = np.zeros(3), np.ones(3)
    found = chain.hybrid_dynamics([0.1] * 3, [0.2] * 3, qdd, tau, [True, False, True])
    assert (qdd == 0).all()
    assert (tau == 1).all()
    assert found[0][0] != 0


def test_the_walker_chain_has_the_dimensions_of_its_configuration() -> None:
    chain = walker_chain({"body": {"thigh_length_m": 0.5, "foot_mass_kg": 1.0}})
    assert [joint.kind for joint in chain.joints] == ["px", "py", "r", "r", "r", "py", "r", "r"]
    assert chain.joints[4].offset == (0.0, -0.5)
    assert chain.joints[FOOT].mass == 1.0
    assert walker_chain().joints[4].offset == (0.0, -0.42)
    with pytest.raises(ValueError, match=r"body\.thigh_mass_kg = -1 is outside"):
        walker_chain({"body": {"thigh_mass_kg": -1.0}})


def test_chains_survive_pickling() -> None:
    chain = random_chain(np.random.default_rng(7), 3)
    copy = pickle.loads(pickle.dumps(chain))
    assert repr(copy) == repr(chain)
    np.testing.assert_array_equal(copy.mass_matrix([0.1, 0.2, 0.3]), chain.mass_matrix([0.1, 0.2, 0.3]))


@pytest.mark.parametrize(
    ("joint", "gravity", "complaint"),
    [
        ({"kind": "ry"}, (0.0, 0.0), "joints[0].kind: unknown variant `ry`, expected one of `px`, `py`, `r`"),
        ({"kind": 3}, (0.0, 0.0), "joints[0].kind: "),
        ({"kind": "r", "mass": -1.0}, (0.0, 0.0), "joints[0].mass = -1 is outside its allowed range [0, inf) kg"),
        ({"kind": "r", "mass": "heavy"}, (0.0, 0.0), "joints[0].mass: "),
        ({"kind": "r", "inertia": float("nan")}, (0.0, 0.0), "joints[0].inertia = NaN is outside"),
        ({"kind": "r", "com": (0.0, float("inf"))}, (0.0, 0.0), "joints[0].com[1] = inf is outside"),
        ({"kind": "r", "offset": (0.0, 1.0, 2.0)}, (0.0, 0.0), "joints[0].offset: "),
        ({"kind": "r"}, (0.0, float("nan")), "gravity[1] = NaN is outside"),
        ({"kind": "r"}, (0.0,), "gravity: "),
    ],
)
def test_bad_chains_are_named(joint: dict[str, Any], gravity: Any, complaint: str) -> None:  # noqa: ANN401
    with pytest.raises(ValueError, match=re.escape(complaint)):
        Chain([Joint(**joint)], gravity)


def test_a_chain_without_joints_is_refused() -> None:
    with pytest.raises(ValueError, match="joints: a chain needs at least one"):
        Chain([])


NAN = float("nan")


@pytest.mark.parametrize(
    ("method", "arguments", "complaint"),
    [
        ("mass_matrix", ([0.0],), "q has shape (1,), must be (..., 2)"),
        ("mass_matrix", (0.0,), "q has shape (), must be (..., 2)"),
        ("mass_matrix", ([0.0, NAN],), "q[1] = NaN is outside"),
        ("mass_matrix", ([[0.0, 0.0], [NAN, 0.0]],), "q[0] = NaN is outside its allowed range (-inf, inf) (state 1 of"),
        ("mass_matrix", ([0.0, 1j],), "q has dtype complex128, must be real numbers"),
        ("mass_matrix", (["a", "b"],), "q has dtype <U1, must be real numbers"),
        ("mass_matrix", ([[0.0, 0.0], [0.0]],), "q: "),
        ("bias", (np.zeros((3, 2)), np.zeros((4, 2))), "leading dimensions do not broadcast: q (3, 2), qd (4, 2)"),
        ("point_position", ([0.0, 0.0], 2), "body = 2 is outside its allowed range [0, 1]"),
        ("point_position", ([0.0, 0.0], -1), "body = -1 is outside its allowed range [0, 1]"),
        ("point_position", ([0.0, 0.0], 0.5), "body = 0.5 is outside its allowed range [0, 1]"),
        ("point_position", ([0.0, 0.0], 0, [0.0]), "point has shape (1,), must be (..., 2)"),
        ("point_position", ([0.0, 0.0], 0, [0.0, NAN]), "point[1] = NaN is outside"),
        ("hybrid_dynamics", (*[[0.0, 0.0]] * 4, [1, 0]), "forward has dtype int64, must be boolean"),
        ("hybrid_dynamics", (*[[0.0, 0.0]] * 4, [True]), "forward has shape (1,), must be (..., 2)"),
        ("hybrid_dynamics", (*[[0.0, 0.0]] * 3, [NAN, 0.0], [True, False]), "tau[0] = NaN is outside"),
        (
            "hybrid_dynamics",
            (*[[0.0, 0.0]] * 4, [True, True]),
            "forward: joints[1] (PrismaticX) can accelerate without moving any mass",
        ),
    ],
)
def test_bad_arguments_are_named(method: str, arguments: tuple[Any, ...], complaint: str) -> None:
    chain = Chain([Joint("r", mass=1.0, com=(0.0, -1.0)), Joint("px")])
    with pytest.raises(ValueError, match=re.escape(complaint)):
        getattr(chain, method)(*arguments)


@pytest.mark.parametrize(
    ("load", "complaint"),
    [
        (ExternalForce(2, (0.0, 0.0), (0.0, 0.0)), "external_forces[1].body = 2 is outside its allowed range [0, 1]"),
        (ExternalForce(0, (0.0, 0.0, 0.0), (0.0, 0.0)), "external_forces[1].point has shape (3,), must be (..., 2)"),
        (ExternalForce(0, (0.0, 0.0), (0.0, NAN)), "external_forces[1].force[1] = NaN is outside"),
    ],
)
def test_bad_forces_are_named(load: ExternalForce, complaint: str) -> None:
    chain = Chain([Joint("r", mass=1.0, inertia=1.0), Joint("r", mass=1.0, inertia=1.0)])
    rest = [0.0, 0.0]
    with pytest.raises(ValueError, match=re.escape(complaint)):
        chain.inverse_dynamics(rest, rest, rest, [ExternalForce(1, (0.0, 0.0), (0.0, 0.0)), load])


def test_the_readme_example_runs(capsys: pytest.CaptureFixture[str]) -> None:
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    (example,) = (block for block in re.findall(r"```python\n(.*?)```", readme, re.DOTALL) if ".dynamics" in block)
    exec(compile(example, "README.md", "exec"), {})
    assert capsys.readouterr().out
