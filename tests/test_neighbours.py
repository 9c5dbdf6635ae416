"""Whatever happens to some walkers of a batch, the others walk, bit for bit, as each would alone."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from hypothesis import given, settings
from hypothesis import strategies as st

from prosthesis_gym import ProsthesisVectorEnv

#: Two blocks of eight and one that is half used.
WALKERS = 20
STEPS = 60
HOLD = 5
#: What can be done to walkers between two steps. The last four only look, so they may look at all.
MEDDLING = ("reset", "reset anew", "set_state", "get_state", "snapshot", "record", "render")

PUSH = {"duration_s": 0.15, "force_x_n": 200.0}
STANDING_FIRST = [
    {"time_s": 0.0, "speed_m_s": 1.1, "walk": False},
    {"time_s": 0.6, "speed_m_s": 1.1, "walk": True},
    {"time_s": 1.3, "speed_m_s": 0.9, "walk": True},
]
NOISY = {"noise": 0.02, "bias": 0.02, "delay_samples": 3, "drop_out": 0.1}
SCENARIOS: dict[str, dict[str, Any]] = {
    "a push as the first step begins": {
        "scenario": {"start": "standing", "profile": STANDING_FIRST, "pushes": [{"time_s": 0.0, "phase": 0.0, **PUSH}]}
    },
    "pushes by phase": {"scenario": {"push_phase": [0.0, 0.9], "push_n": [50.0, 200.0], "push_s": [0.0, 1.0]}},
    "gusts": {"scenario": {"gust": {"force_n": [-80.0, 80.0], "duration_s": 0.3, "pause_s": [0.05, 0.4]}}},
    "late and noisy": {
        "sensors": {"knee_encoder": NOISY, "tube_force": NOISY, "shank_rate": NOISY},
        "action": {"delay_samples": 2},
        "scenario": {"human": {"touch_down_delay_s": [0.0, 0.1], "step_delay_s": [0.0, 0.1]}},
    },
    "bodies and ground drawn": {
        "scenario": {
            "duration_s": 0.8,
            "randomise": {
                "body.trunk_mass_kg": [40.0, 60.0],
                "ground.slope_deg": [-3.0, 3.0],
                "termination.hip_height_m": [0.5, 0.6],
            },
        }
    },
}


def new_envs(number: int, config: dict[str, Any], mode: AutoresetMode) -> ProsthesisVectorEnv:
    action = {"hold": HOLD} | config.get("action", {})
    return ProsthesisVectorEnv(
        number,
        config | {"action": action},
        device="damper",
        autoreset_mode=mode,
        render_mode="rgb_array",
        render_size=(160, 120),
        threads=2,
    )


def meddle(envs: ProsthesisVectorEnv, kind: str, victims: list[int], anyone: list[int], seed: int) -> None:
    """Do something of a kind to the victims, or look at anyone."""
    mask = np.zeros(envs.num_envs, dtype=np.bool_)
    mask[victims] = True
    match kind:
        case "reset":
            envs.reset(options={"reset_mask": mask})
        case "reset anew":
            seeds: list[int | None] = [seed + index for index in range(envs.num_envs)]
            envs.reset(seed=seeds, options={"reset_mask": mask})
        case "set_state":
            envs.set_state(envs.get_state([anyone[0]]), victims)
        case "get_state":
            envs.get_state(anyone)
        case "snapshot":
            for index in anyone:
                envs.batch.snapshot(index)
        case "record":
            envs.batch.record(anyone[0])
        case "render":
            envs.render()


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    scenario=st.sampled_from(list(SCENARIOS)),
    mode=st.sampled_from([AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP]),
    untouched=st.lists(st.integers(0, WALKERS - 1), min_size=1, max_size=4, unique=True),
    kinds=st.lists(st.sampled_from(MEDDLING), min_size=1, unique=True),
    seed=st.integers(0, 2**32),
)
def test_untouched_walkers_equal_themselves_alone(
    scenario: str, mode: AutoresetMode, untouched: list[int], kinds: list[str], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    together = new_envs(WALKERS, SCENARIOS[scenario], mode)
    alone = {index: new_envs(1, SCENARIOS[scenario], mode) for index in untouched}
    together.reset(seed=100)
    for index, envs in alone.items():
        envs.reset(seed=100 + index)
    others = np.setdiff1d(np.arange(WALKERS), untouched)
    for step in range(STEPS):
        victims = rng.permutation(others)[: rng.integers(1, WALKERS - 4)].tolist()
        anyone = rng.integers(0, WALKERS, 3).tolist()
        meddle(together, str(rng.choice(kinds)), victims, anyone, 7000 + step)
        if rng.random() < 0.05:
            difficulty = rng.random()
            for envs in (together, *alone.values()):
                envs.difficulty = difficulty
        actions = rng.uniform(-1.0, 1.0, WALKERS)
        found = together.walkers.step(actions)
        for index, envs in alone.items():
            expected = envs.walkers.step(actions[index : index + 1])
            for name in ("observations", "rewards", "terminated", "truncated", "terms", "reasons", "episode_returns"):
                values = getattr(found, name)[index], getattr(expected, name)[0]
                np.testing.assert_array_equal(*values, err_msg=f"{name} in step {step}")
            assert together.get_state([index]) == envs.get_state([0]), step
            np.testing.assert_equal(together.batch.snapshot(index), envs.batch.snapshot(0))  # NaN is NaN
    for envs in (together, *alone.values()):
        envs.close()


def test_a_neighbours_reset_does_not_draw_the_others_disturbances() -> None:
    profile = [{"time_s": 0.0, "speed_m_s": 1.1, "walk": False}, {"time_s": 1.0, "speed_m_s": 1.1, "walk": True}]
    pushes = [{"time_s": 0.0, "phase": 0.0, **PUSH}]
    config = {"scenario": {"start": "standing", "profile": profile, "pushes": pushes}}
    walks = []
    for meddled in (False, True):
        envs = ProsthesisVectorEnv(8, config, device="damper", autoreset_mode=AutoresetMode.DISABLED)
        envs.reset(seed=0)
        observed = []
        for step in range(300):
            if meddled and step == 200:
                envs.reset(options={"reset_mask": np.arange(8) == 1})
            observed.append(envs.step(np.zeros((8, 1), dtype=np.float32))[0])
        walks.append(np.array(observed)[:, [0, 2, 3, 4, 5, 6, 7]])
    undisturbed, meddled_with = walks
    np.testing.assert_array_equal(meddled_with, undisturbed)
