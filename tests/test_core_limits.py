"""Whatever a caller gives to the core works, or is an exception that `except Exception` catches, and ends no process.

Panics, aborts and lack of memory would: what could bring them about runs in processes of its own.
"""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from prosthesis_gym import InternalError, _core
from prosthesis_gym.config import Config

#: What refuses an argument: neither a panic nor a fault of the core's own.
REFUSALS = (ValueError, TypeError, OverflowError, IndexError, AttributeError)


def survives(code: str) -> str:
    """Run `code` in a process of its own, which must end by itself, and return what it prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, f"{done.returncode}: {done.stderr[-2000:]}"
    assert "panicked" not in done.stderr, done.stderr[-2000:]
    return done.stdout


PREAMBLE = """
import numpy as np
from prosthesis_gym import _core
def refused(call):
    try:
        call()
    except (ValueError, TypeError, OverflowError, IndexError) as error:
        print(type(error).__name__, error)
    else:
        raise SystemExit("was accepted")
groups = ["knee", "load", "shank", "shank_force", "thigh", "ankle", "command", "phase", "privileged"]
wide = {"observation": {"frames": 64, "groups": groups}}
tiny_foot = {"solver": {"stepper": "rk4"}, "tube": {"connection": "compliant"}, "body": {"foot_mass_kg": 1e-300}}
itself = {}
itself["scenario"] = {"variants": [itself]}
deep = 1.0
for _ in range(200_000):
    deep = [deep]
chain = _core.Chain({"joints": [{"kind": "r", "mass": 1.0, "com": [0.0, -0.1]}] * 3, "gravity": [0.0, -9.81]})
batch = _core.Batch(3, {})
batch.reset(np.arange(3, dtype=np.uint64))
rows, forward = np.zeros((2, 3)), np.ones((2, 3), dtype=bool)
locked = np.zeros((2, 3))
locked.flags.writeable = False
"""
#: Calls that ended the process, or that would in a core that does not look first, and what the refusal must name.
FATAL = {
    "_core.Batch(16_000_000, wide)": "num_envs = 16000000 needs",
    "_core.Batch(16_000_000, wide, 'same_step')": "bytes of memory",
    "_core.Batch(16_000_000, {**wide, 'scenario': {'randomise': {'body.trunk_mass_kg': 60.0}}})": "available are",
    "_core.Batch(2**63, {})": "num_envs",
    "_core.Batch(-1, {})": "",
    "_core.Batch(1, {}, threads=2**40)": "threads",
    "_core.Batch(1, {'observation': {'groups': ['motor']}})": "observation.groups",
    "_core.channels({'observation': {'groups': ['motor']}})": "observation.groups",
    "_core.resolve(itself)": "nested",
    "_core.Chain(itself)": "nested",
    "_core.resolve({'scenario': {'push_n': deep}})": "nested",
    "_core.resolve({'scenario': {'variants': [{'body': deep}]}})": "nested",
    "_core.resolve({'scenario': {'push_n': {'choice': range(10**13)}}})": "values",
    "_core.resolve({'solver': {'steps': 10**400}})": "steps",
    "_core.Batch(1, {'solver': {'stepper': 'rk4'}, 'socket': {'connection': 'compliant', 'tilt_rad': 1e-300}})": "rk4",
    "_core.Batch(1, tiny_foot)": "rk4",
    "batch.get_state(range(10**15))": "indices",
    "batch.set_state(batch.get_state([0]), range(10**15))": "indices",
    "batch.get_state([3])": "index = 3",
    "batch.get_state([-1])": "",
    "batch.snapshot(2**63)": "index",
    "batch.ground_height(3, np.zeros(1))": "index = 3",
    "batch.set_state(bytes(10_000), [0])": "state",
    "batch.step(np.zeros(6)[::2])": "contiguous",
    "batch.step(np.zeros(4))": "actions have 4 entries",
    "batch.reset(np.zeros(2, np.uint64), None)": "seeds has 2 entries",
    "batch.reset(None, np.zeros(4, bool))": "mask has 4 entries",
    "batch.set_moments(1.0, np.zeros(1), np.zeros(1), True)": "",
    "chain.mass_matrix(np.zeros((10**15, 0)))": "q has 0 values",
    "chain.mass_matrix(np.asfortranarray(np.arange(9.0).reshape(3, 3)))": "contiguous",
    "chain.mass_matrix(np.broadcast_to(np.zeros((1, 3)), (10**12, 3)))": "contiguous",
    "chain.hybrid_dynamics(rows, rows, rows, rows.copy(), forward, [])": "array",
    "chain.hybrid_dynamics(rows, rows, rows.copy(), rows, forward, [])": "array",
    "chain.hybrid_dynamics(rows, rows, locked, rows.copy(), forward, [])": "writeable",
    "chain.hybrid_dynamics(rows, rows, rows.copy(), rows.copy(), forward, [(0, rows, rows)])": "point",
    "chain.inverse_dynamics(rows, rows, rows, range(10**15))": "",
    "chain.point_position(rows, 2**63, np.zeros((2, 2)))": "body",
    "_core.Chain({'joints': [{'kind': 'r'}] * 200_000, 'gravity': [0, 0]})": "joints",
    "_core.Chain({'joints': [], 'gravity': [0, 0]})": "joints",
}


def test_what_would_end_the_process_is_refused() -> None:
    calls = "\n".join(f"refused(lambda: {call})" for call in FATAL)
    refusals = survives(PREAMBLE + calls + "\nbatch.step(np.zeros(3))").splitlines()
    assert len(refusals) == len(FATAL)
    for (call, named), refusal in zip(FATAL.items(), refusals, strict=True):
        assert named in refusal, f"{call}: {refusal}"


def test_what_a_process_may_not_take_is_refused_too() -> None:
    resource = pytest.importorskip("resource")
    assert resource
    limited = "import resource\nresource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))\n"
    assert "num_envs = 1500000 needs" in survives(limited + PREAMBLE + "refused(lambda: _core.Batch(1_500_000, {}))")


@pytest.mark.parametrize(
    "config",
    [
        {},
        {"observation": {"frames": 64}},
        {"sensors": {"knee_encoder": {"delay_samples": 200}}},
        {"body": {"sole_points": 6}, "scenario": {"randomise": {"ground.friction": [0.4, 0.6]}}},
        {"scenario": {"profile": [{"time_s": t, "speed_m_s": 1.0, "walk": True} for t in range(100)]}},
    ],
    ids=["usual", "frames", "delays", "drawn", "profile"],
)
def test_walkers_need_the_memory_that_is_asked_for(config: Config) -> None:
    """What is refused is what would not fit: what is asked for is near what walkers really take."""
    walkers = 20_000
    printed = survives(
        "import gc, numpy as np, psutil\nfrom prosthesis_gym import _core\n"
        f"config, walkers, process = {config!r}, {walkers}, psutil.Process()\n"
        "warm = _core.Batch(64, config)\nwarm.reset(np.arange(64, dtype=np.uint64))\nwarm.step(np.zeros(64))\n"
        "before = process.memory_info().rss\nbatch = _core.Batch(walkers, config)\n"
        "batch.reset(np.arange(walkers, dtype=np.uint64))\nheld = [batch.step(np.zeros(walkers)) for _ in range(2)]\n"
        "print(process.memory_info().rss - before, batch.bytes)"
    )
    taken, needed = map(int, printed.split())
    assert 0.75 * taken < needed < 1.5 * taken, f"{taken / walkers} bytes per walker, {needed / walkers} foreseen"


# What follows looks for inputs that nobody has thought of.

NUMBER = st.one_of(
    st.floats(),
    st.integers(-(2**70), 2**70),
    st.sampled_from([0, 1, -1, 2, 3, 2**31, 2**32, 2**63, 2**64 - 1, 1e300, -1e300, 5e-324, True, None]),
)
JUNK = st.recursive(
    NUMBER | st.text(max_size=3) | st.binary(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)
KEYS = [row["key"] for row in _core.parameters()]


@st.composite
def configs(draw: st.DrawFn) -> Any:  # noqa: ANN401 - anything
    """Draw what may be a configuration."""
    config: dict[str, Any] = {}
    for key in draw(st.lists(st.sampled_from(KEYS), max_size=3, unique=True)):
        section = config
        *sections, name = key.split(".")
        for part in sections:
            section = section.setdefault(part, {})
        section[name] = draw(JUNK)
    return draw(st.just(config) | st.just(config) | JUNK)


@st.composite
def arrays(draw: st.DrawFn, *lengths: int) -> Any:  # noqa: ANN401 - anything
    """Draw an array of the given lengths, or something like it."""
    kind = draw(st.sampled_from([np.float64, np.float64, np.float64, np.float32, np.uint64, np.bool_, np.object_]))
    shape = lengths if draw(st.booleans()) else tuple(draw(st.lists(st.integers(0, 5), max_size=3)))
    fill = draw(st.sampled_from([0.0, 1.0, -3.0, 1e300, 1e-300, np.nan, np.inf, -np.inf]))
    array: NDArray[Any] = np.zeros(shape, dtype=kind)
    with np.errstate(all="ignore"):
        array[...] = np.random.default_rng(draw(st.integers(0, 99))).uniform(-1.0, 1.0, shape)
        if array.size and kind in (np.float64, np.float32):
            array.flat[draw(st.integers(0, array.size - 1))] = fill
    if draw(st.integers(0, 5)) == 0:
        return draw(
            st.sampled_from([array.T, array[..., ::-1], array[::2], array.tolist(), None]) if array.ndim else JUNK
        )
    array.flags.writeable = draw(st.integers(0, 5)) > 0
    return array


def attempt(call: Any, *arguments: Any, **named: Any) -> Any:  # noqa: ANN401 - anything
    try:
        return call(*arguments, **named)
    except InternalError:
        raise
    except REFUSALS:
        return None


FUZZ = settings(max_examples=400, suppress_health_check=list(HealthCheck))


@FUZZ
@given(configs())
def test_any_configuration_is_read_or_refused(config: Any) -> None:  # noqa: ANN401
    for function in (_core.resolve, _core.channels, _core.channel_groups, _core.action_size, _core.walker_joints):
        attempt(function, config)
    batch = attempt(_core.Batch, 2, config)
    if batch is not None and batch.solver_steps < 100:
        hold = _core.resolve(config)["action"]["hold"]
        attempt(batch.reset, np.arange(2, dtype=np.uint64))
        if hold < 10:
            attempt(batch.step, np.zeros(2 * _core.action_size(config)))


@st.composite
def calls(draw: st.DrawFn) -> list[tuple[str, list[Any]]]:
    """Draw calls of a batch of 9 walkers."""
    index, indices = NUMBER | st.integers(0, 9), st.lists(NUMBER | st.integers(0, 9), max_size=12) | JUNK
    arguments: dict[str, list[st.SearchStrategy[Any]]] = {
        "reset": [arrays(9) | st.none(), arrays(9) | st.none()],
        "step": [arrays(9)],
        "normalise_observations": [NUMBER, NUMBER],
        "moments": [],
        "set_moments": [NUMBER, arrays(10), arrays(10), st.booleans()],
        "episodes": [],
        "get_state": [indices],
        "set_state": [JUNK | st.binary(max_size=40), indices],
        "record": [index],
        "recording": [],
        "events": [],
        "snapshot": [index],
        "ground_height": [index, arrays(4)],
        "difficulty": [NUMBER],
    }
    names = draw(st.lists(st.sampled_from(sorted(arguments)), max_size=8))
    return [(name, [draw(argument) for argument in arguments[name]]) for name in names]


@FUZZ
@given(calls(), st.sampled_from(["next_step", "same_step", "disabled"]))
def test_any_call_of_a_batch_works_or_is_refused(drawn: list[tuple[str, list[Any]]], autoreset: Any) -> None:  # noqa: ANN401
    batch = _core.Batch(9, {"scenario": {"duration_s": 0.1}}, autoreset, 2)
    for name, arguments in drawn:
        if name == "difficulty":
            attempt(setattr, batch, name, *arguments)
        else:
            attempt(getattr(batch, name), *arguments)
    batch.reset(np.arange(9, dtype=np.uint64), None)
    assert np.isfinite(batch.step(np.zeros(9)).rewards).all()


@FUZZ
@given(st.data())
def test_damaged_states_are_refused(data: st.DataObject) -> None:
    batch = _core.Batch(2, {"action": {"delay_samples": 2}, "sensors": {"tube_force": {"delay_samples": 3}}})
    batch.reset(np.arange(2, dtype=np.uint64))
    for _ in range(5):
        batch.step(np.ones(2))
    state = bytearray(batch.get_state([0, 1]))
    place = data.draw(st.integers(0, len(state) - 1))
    damage = data.draw(st.sampled_from(["bit", "cut", "grow", "byte"]))
    if damage == "bit":
        state[place] ^= 1 << data.draw(st.integers(0, 7))
    elif damage == "byte":
        state[place] = (state[place] + data.draw(st.integers(1, 255))) % 256
    else:
        state = state[:place] if damage == "cut" else state + state[place:]
    with pytest.raises(ValueError, match="state"):
        batch.set_state(bytes(state), [0, 1])
    batch.step(np.ones(2))


JOINT = st.fixed_dictionaries(
    {"kind": st.sampled_from(["r", "px", "py"])},
    optional={
        "offset": st.lists(NUMBER | st.floats(-1, 1), min_size=2, max_size=2),
        "angle": st.floats(-4, 4) | NUMBER,
        "mass": st.floats(0, 5) | st.floats(0, 5) | NUMBER,
        "com": st.lists(st.floats(-1, 1) | NUMBER, min_size=2, max_size=2),
        "inertia": st.floats(0, 1) | NUMBER,
    },
)


@FUZZ
@given(st.lists(JOINT, max_size=4) | JUNK, st.data())
def test_any_chain_works_or_is_refused(joints: Any, data: st.DataObject) -> None:  # noqa: ANN401
    definition = data.draw(st.just({"joints": joints, "gravity": [0.0, -9.81]}) | JUNK)
    chain = attempt(_core.Chain, definition)
    if chain is None:
        return
    n, rows = len(joints), 2
    table, points = arrays(rows, n), arrays(rows, 2)
    body = data.draw(st.integers(0, 4) | NUMBER)
    loads = data.draw(st.lists(st.tuples(st.integers(0, 4) | NUMBER, points, points), max_size=2) | JUNK)
    q, qd, qdd, tau, forward = (data.draw(table) for _ in range(5))
    q = data.draw(st.sampled_from([q, qdd]))
    attempt(chain.frames, q)
    attempt(chain.point_position, q, body, data.draw(points))
    attempt(chain.point_velocity, q, qd, body, data.draw(points))
    attempt(chain.mass_matrix, q)
    attempt(chain.bias, q, qd)
    attempt(chain.inverse_dynamics, q, qd, qdd, loads)
    attempt(chain.hybrid_dynamics, q, qd, qdd, tau, forward, loads)
    attempt(chain.kinetic_energy, q, qd)
    attempt(chain.potential_energy, q)
