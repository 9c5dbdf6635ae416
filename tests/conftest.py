"""Fixtures shared by all tests."""

import os

import gymnasium
import pytest
from hypothesis import settings

import prosthesis_gym  # noqa: F401 - registers the environments

# Everybody tests the same examples; HYPOTHESIS_PROFILE=explore looks for new ones.
settings.register_profile("ci", derandomize=True, deadline=None, print_blob=True)
settings.register_profile("explore", deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

# Windows of rendered environments open on no screen.
os.environ["SDL_VIDEODRIVER"] = "dummy"

ENVIRONMENTS = sorted(name for name in gymnasium.registry if name.startswith("prosthesis_gym/"))


@pytest.fixture(params=ENVIRONMENTS)
def env_id(request: pytest.FixtureRequest) -> str:
    """Every registered environment: contract tests run over all of them."""
    return str(request.param)
