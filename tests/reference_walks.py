"""Walks on the reference solver that several tests look at, each simulated once."""

from functools import cache
from types import MappingProxyType

from prosthesis_gym.config import REFERENCE_SOLVER, apply_settings, merge
from prosthesis_gym.scenarios import load_scenario
from prosthesis_gym.trial import Trial, run_trial

BASE = MappingProxyType(
    {
        **REFERENCE_SOLVER,
        "action": {"mode": "state_machine"},
        "scenario": {"start": "standing", "speed_m_s": 1.1, "walk_s": 1.0, "push_n": 0.0},
    }
)


@cache
def walk(*settings: str, duration_s: float = 30.0) -> Trial:
    return run_trial(apply_settings(BASE, settings), duration_s=duration_s, progress=False)


@cache
def trial40(*settings: str) -> Trial:
    """Walk the 40 s trial of Figure 8, with 5 s more to come to a stop."""
    config = merge(BASE, load_scenario("trial40"))
    return run_trial(apply_settings(config, settings), progress=False)
