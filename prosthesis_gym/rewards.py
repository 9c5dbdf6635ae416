"""What counts as good walking: presets of the reward's weights, and the same from TOML files."""

from importlib import resources
from pathlib import Path
from typing import Final

from prosthesis_gym.arguments import file_path
from prosthesis_gym.config import Config, load_config

_PRESETS = resources.files("prosthesis_gym") / "presets" / "reward"

#: Names of the shipped rewards.
REWARDS: Final = tuple(sorted(entry.name.removesuffix(".toml") for entry in _PRESETS.iterdir()))


def load_reward(source: str | Path) -> Config:
    """Return the partial configuration, section `reward` alone, of a preset or a TOML file.

    Args:
        source: one of `REWARDS`, or the path of a .toml file with a section `[reward]`.

    Raises:
        ValueError: no such reward, another section, or an impossible weight.

    """
    if isinstance(source, str) and source in REWARDS:
        with resources.as_file(_PRESETS / f"{source}.toml") as path:
            return load_config(path)
    path = file_path("reward", source)
    if path.suffix != ".toml" or not path.is_file():
        raise ValueError(f"reward = {str(source)!r}: neither one of {', '.join(REWARDS)} nor an existing .toml file")
    config = load_config(path)
    if config.keys() != {"reward"}:
        raise ValueError(f"{path}: sections {', '.join(config) or 'none'}, must be reward alone")
    return config
