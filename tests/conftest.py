"""Fixtures shared by all tests."""

import gymnasium
import pytest

import prosthesis_gym  # noqa: F401 - registers the environments

ENVIRONMENTS = sorted(name for name in gymnasium.registry if name.startswith("prosthesis_gym/"))


@pytest.fixture(params=ENVIRONMENTS)
def env_id(request: pytest.FixtureRequest) -> str:
    """Every registered environment: contract tests run over all of them."""
    return str(request.param)
