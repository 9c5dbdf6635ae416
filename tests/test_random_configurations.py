"""Any configuration that the schema allows either is refused with a ValueError or walks without a fault.

Configurations are drawn from the schema itself: each parameter near its default, anywhere in its range or at its edges.
"""

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from hypothesis import HealthCheck, assume, event, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from prosthesis_gym import ProsthesisVectorEnv, TerminationReason, _core
from prosthesis_gym.config import Config, merge, resolve
from prosthesis_gym.walkers import spaces

#: Of at least 5 ms: time for every walker to be reset once and then to come to an end.
STEPS = 120
WALKERS, CONFIGURATIONS = 32, 300
#: Parameters that would only make the test slow, and what it allows of them.
CHEAP: dict[str, tuple[float, float]] = {
    "solver.steps": (1, 60),
    "scenario.duration_s": (0.1, 0.4),
    "action.hold": (1, 4),
    "observation.frames": (1, 4),
    "body.sole_points": (2, 6),
}
DEFAULTS = resolve({})


def default_of(key: str) -> Any:  # noqa: ANN401 - a parameter is of any type
    value: Any = DEFAULTS
    for part in key.split("."):
        value = value[part]
    return value


def numbers(key: str, limits: str, default: float) -> st.SearchStrategy[float]:
    """Strategy of one number, from a range such as "(0, 500]"."""
    match = re.search(r"([\[(])(\S+), (\S+)\]", limits)
    assert match, f"{key} has the range {limits!r}"
    low, high = CHEAP.get(key, (float(match[2]), float(match[3])))
    if isinstance(default, int):
        return st.integers(int(low), int(high))
    low = np.nextafter(low, high) if match[1] == "(" else low
    near = st.floats(0.5, 2.0).map(lambda factor: float(np.clip(default * factor, low, high)))
    return near | near | near | st.floats(low, high) | st.sampled_from([low, high])


def distributions(key: str, limits: str, default: float) -> st.SearchStrategy[Any]:
    """Strategy of a number's distributions."""
    number = numbers(key, limits, default)
    pair = st.tuples(number, number).map(sorted)
    return (
        number
        | pair
        | pair.map(lambda bounds: {"log_uniform": bounds})
        | pair.map(lambda bounds: {"normal": [sum(bounds) / 2, (bounds[1] - bounds[0]) / 6.1]})
        | st.lists(number, min_size=1, max_size=4).map(lambda choice: {"choice": choice})
    )


def values(key: str, limits: str) -> st.SearchStrategy[Any] | None:
    """Strategy of a parameter's values; None for the lists, which have tests of their own."""
    default = default_of(key)
    if key == "scenario.randomise":
        keys = st.lists(st.sampled_from(sorted(RANDOMISABLE)), max_size=5, unique=True)
        return keys.flatmap(lambda keys: st.fixed_dictionaries({key: RANDOMISABLE[key] for key in keys}))
    if key == "observation.groups":
        return st.lists(st.sampled_from(limits.removeprefix("list of ").split(", ")), min_size=1, unique=True)
    if isinstance(default, bool | str):
        return st.booleans() if isinstance(default, bool) else st.sampled_from(limits.split(" | "))
    if limits.startswith("list of"):
        return None
    number = default[0] if isinstance(default, list) else default
    return distributions(key, limits, number) if limits.startswith("distribution") else numbers(key, limits, number)


WALKER = {"body", "ground", "human", "knee", "motor", "friction_knee", "end_stop", "ankle", "socket", "tube", "sensors"}
RANDOMISABLE = {
    key: distributions(key, parameter["range"], default_of(key))
    for parameter in _core.parameters()
    if (key := parameter["key"]).split(".")[0] in WALKER
    and key != "body.sole_points"
    and isinstance(default_of(key), int | float)
    and not isinstance(default_of(key), bool)
}


STRATEGIES = {
    parameter["key"]: drawn
    for parameter in _core.parameters()
    if (drawn := values(parameter["key"], parameter["range"])) is not None
}
ALWAYS = ("device.kind", "solver.stepper", "scenario.duration_s")


@st.composite
def configurations(draw: st.DrawFn) -> Config:
    """Draw a configuration with a few parameters of its own."""
    keys = draw(st.lists(st.sampled_from(sorted(STRATEGIES)), max_size=30, unique=True))
    config: Config = {}
    for key in dict.fromkeys([*ALWAYS, *keys]):
        entry: Any = draw(STRATEGIES[key])
        for part in reversed(key.split(".")):
            entry = {part: entry}
        config = merge(config, entry)
    return config


@dataclass
class Walks:
    """What the steps of a batch gave."""

    observations: list[NDArray[np.float32]] = field(default_factory=list)
    rewards: list[NDArray[np.float64]] = field(default_factory=list)
    ended: list[NDArray[np.bool_]] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)


def walk(envs: ProsthesisVectorEnv, seed: int) -> Walks:
    """Step with random actions, checking each, and reset a part of the walkers in the middle of their episodes."""
    rng = np.random.default_rng(seed)
    walks = Walks([envs.reset(seed=seed)[0]])
    for step in range(STEPS):
        actions = rng.uniform(-1.0, 1.0, envs.action_space.shape or ())
        observations, rewards, terminated, truncated, infos = envs.step(actions)
        ended = terminated | truncated
        assert not (terminated & truncated).any()
        assert all(np.isfinite(infos[f"reward_{name}"]).all() for name in _core.TERMS)
        if ended.any():
            walks.observations.append(infos["final_obs"][ended])
            reasons = infos["final_info"]["termination_reason"]
            np.testing.assert_array_equal(infos["final_info"]["_termination_reason"], ended)
            np.testing.assert_array_equal(reasons[ended] == TerminationReason.TIME_LIMIT, truncated[ended])
            walks.reasons += [_core.REASONS[reason] for reason in reasons[ended]]
        walks.observations.append(observations)
        walks.rewards.append(rewards)
        walks.ended.append(ended)
        if step == 10:
            mask = rng.random(WALKERS) < 0.3
            mask[0] = True
            walks.observations.append(envs.reset(options={"reset_mask": mask})[0])
    return walks


@settings(max_examples=CONFIGURATIONS, suppress_health_check=list(HealthCheck))
@given(config=configurations(), seed=st.integers(0, 2**32))
def test_every_configuration_is_refused_or_walks_without_a_fault(config: Config, seed: int) -> None:
    try:
        # Complete, because most of a random part of a configuration would be refused as settings without effect.
        envs = ProsthesisVectorEnv(WALKERS, resolve(config), autoreset_mode=AutoresetMode.SAME_STEP, threads=1)
    except ValueError as error:
        event("refused: " + re.sub(r"-?\d[\d.e-]*", "#", str(error)))
        assume(False)
    walks = walk(envs, seed)
    for observations in walks.observations:
        assert np.isfinite(observations).all()
        space, _ = spaces(envs.config)
        assert ((observations >= space.low) & (observations <= space.high)).all()
    assert all(np.isfinite(rewards).all() for rewards in walks.rewards)
    assert set(walks.reasons) <= set(_core.REASONS[1:])
    for reason in set(walks.reasons):
        event(f"ended by {reason}")
    assert np.any(walks.ended, axis=0).all()

    again = walk(envs, seed)
    for ours, theirs in ((walks.observations, again.observations), (walks.rewards, again.rewards)):
        for mine, repeated in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(mine, repeated)
