"""Writes saved states for `tests/test_older_files.py` with whatever version of the package is installed.

`python tests/data/write.py tests/data/written_<date>`; the training run beside them is
`python -m training.train tests/data/written_<date>/run/config.toml --out <folder>`, without its pictures and its log.
"""

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from prosthesis_gym import ProsthesisVectorEnv

WORLDS: dict[str, dict[str, Any]] = {
    "damper": {
        "observation": {"frames": 3, "groups": ["knee", "load", "shank", "command", "phase", "privileged"]},
        "action": {"delay_samples": 3, "filter_s": 0.02},
        "sensors": {"knee_encoder": {"delay_samples": 2, "noise": 0.01}},
    },
    "motor": {"device": {"kind": "motor"}, "action": {"mode": "impedance"}},
    "friction": {"device": {"kind": "friction"}, "scenario": {"randomise": {"ground.slope_deg": [-1.0, 1.0]}}},
    "socket": {
        "socket": {"connection": "compliant"},
        "tube": {"connection": "compliant"},
        "mechanism": {"trunk": "forward"},
    },
}


def main(folder: Path) -> None:
    """Write the state of three walkers of each world after 300 random steps, and a digest of the next 100."""
    folder.mkdir(parents=True, exist_ok=True)
    told = {}
    for name, config in WORLDS.items():
        envs = ProsthesisVectorEnv(3, config)
        envs.reset(seed=5)
        rng = np.random.default_rng(7)
        actions = [rng.uniform(-1, 1, envs.action_space.shape or ()).astype(np.float32) for _ in range(400)]
        for action in actions[:300]:
            envs.step(action)
        (folder / f"{name}.state").write_bytes(envs.get_state([0, 1, 2]))
        digest = hashlib.sha256()
        for action in actions[300:]:
            observations, rewards, *_ = envs.step(action)
            digest.update(observations.tobytes() + rewards.tobytes())
        told[name] = {"config": config, "next_100_steps_sha256": digest.hexdigest()}
    (folder / "states.json").write_text(json.dumps(told, indent=2) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
