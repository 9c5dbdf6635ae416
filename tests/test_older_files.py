"""Files that an older version of the package has written: they load, and mean the same.

`data/written_2026_11_26` is what commit ee24a77 wrote: saved states of three walkers each after 300 steps, what their
next 100 steps gave, and the folder of a small training run; `data/write.py` says how. A change of format reads them,
or refuses them by naming what is new; then this test says which.
"""

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from prosthesis_gym import ProsthesisVectorEnv
from prosthesis_gym.evaluation import evaluate
from prosthesis_gym.policy import Policy
from training.train import main

WRITTEN = Path(__file__).parent / "data" / "written_2026_11_26"
STATES: dict[str, dict[str, Any]] = json.loads((WRITTEN / "states.json").read_text())


@pytest.mark.parametrize("world", STATES)
def test_walkers_of_an_older_state_go_on_bit_for_bit(world: str) -> None:
    envs = ProsthesisVectorEnv(3, STATES[world]["config"])
    envs.reset(seed=0)
    envs.set_state((WRITTEN / f"{world}.state").read_bytes(), [0, 1, 2])
    rng = np.random.default_rng(7)
    shape = envs.action_space.shape or ()
    actions = [rng.uniform(-1, 1, shape).astype(np.float32) for _ in range(400)]
    digest = hashlib.sha256()
    for action in actions[300:]:
        observations, rewards, *_ = envs.step(action)
        digest.update(observations.tobytes() + rewards.tobytes())
    assert digest.hexdigest() == STATES[world]["next_100_steps_sha256"]


def test_an_older_policy_loads_and_walks() -> None:
    policy = Policy.load(WRITTEN / "run" / "policy")
    assert policy.layer_sizes == [8, 8, 1]
    assert evaluate(policy, policy.config, episodes=4, seed=1).episodes == 4


def test_an_older_training_run_goes_on(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(WRITTEN / "run", folder)
    assert main(["--resume", str(folder), "--set", "training.total_steps=1024", "--quiet"]) == 0
    assert (folder / "checkpoints" / "000000001024").is_dir()
