"""The training configuration: what may stand in a file of `configs/train/`, checked before anything starts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Self

import tomli_w

from prosthesis_gym.config import Config, apply_settings, merge, resolve
from prosthesis_gym.evaluation import HELD_OUT_SEED
from prosthesis_gym.files import read_toml
from prosthesis_gym.layers import Layer, laid_over
from prosthesis_gym.rewards import load_reward
from prosthesis_gym.scenarios import read_scenario


def _within(low: float, high: float) -> dict[str, tuple[float, float]]:
    """Metadata of a field: the range, both ends included, that its number or numbers must lie in."""
    return {"range": (low, high)}


@dataclass(frozen=True)
class _Section:
    @classmethod
    def read(cls, name: str, table: object) -> Self:
        """Read the section from its TOML table; unknown keys, wrong types and impossible values are ValueErrors."""
        allowed = {entry.name: entry.metadata.get("range", (0.0, 0.0)) for entry in fields(cls)}
        defaults, values = vars(cls()), {}
        for key, value in _section(name, table).items():
            if key not in allowed:
                raise ValueError(f"unknown key {name}.{key}; expected one of {', '.join(allowed)}")
            if problem := _problem(value, defaults[key], allowed[key]):
                raise ValueError(f"{name}.{key} = {value!r} {problem}")
            values[key] = float(value) if isinstance(defaults[key], float) else value
        return cls(**values)


#: Sections of [env] that may name a preset or file, and what reads it.
_PRESETS: dict[str, Callable[[str], Config]] = {"scenario": read_scenario, "reward": load_reward}


def _spelt_out(table: Mapping[str, Any]) -> Config:
    """Return the table with `scenario = "pushes"` as `scenario.preset`, which other keys of the section may go with."""
    env = table.get("env")
    named = [key for key in _PRESETS if isinstance(env.get(key), str)] if isinstance(env, Mapping) else []
    return merge(table, {"env": {key: {"preset": table["env"][key]} for key in named}} if named else {})


def _with_presets(env: Mapping[str, Any]) -> Config:
    """Return the sections of [env] on top of the presets that they name."""
    base, sections = Config(), merge({}, env)
    for key, load in _PRESETS.items():
        section = sections.get(key)
        if isinstance(section, dict) and "preset" in section:
            preset = section.pop("preset")
            if not isinstance(preset, str):
                raise ValueError(f"{key}.preset = {preset!r} must be a name or a path")
            base = merge(base, load(preset))
    return laid_over([Layer(base, given=False), Layer(sections)])


def _section(name: str, table: object) -> Mapping[str, Any]:
    if isinstance(table, Mapping):
        return table
    raise ValueError(f"{name} = {table!r} must be a section")


def _problem(value: object, default: object, limits: tuple[float, float]) -> str | None:
    """Return what is wrong with a value in place of `default`."""
    if isinstance(default, bool):
        return None if isinstance(value, bool) else "must be true or false"
    if isinstance(default, list):
        if not isinstance(value, list) or not value:
            return "must be a list with at least one entry"
        return next((problem for entry in value if (problem := _problem(entry, default[0], limits))), None)
    if isinstance(value, bool) or not isinstance(value, int if isinstance(default, int) else int | float):
        return f"must be a {'whole ' if isinstance(default, int) else ''}number"
    low, high = limits
    return None if low <= value <= high else f"is outside its allowed range [{low:g}, {high:g}]"


@dataclass(frozen=True)
class PpoSettings(_Section):
    """Section [ppo]: hyperparameters of Stable-Baselines3's PPO."""

    learning_rate: float = field(default=3e-4, metadata=_within(1e-8, 1.0))
    #: The learning rate goes linearly from `learning_rate` to this at `training.total_steps`.
    final_learning_rate: float = field(default=3e-4, metadata=_within(0.0, 1.0))
    #: Env steps per walker and rollout.
    n_steps: int = field(default=32, metadata=_within(1, 1_000_000))
    batch_size: int = field(default=4096, metadata=_within(2, 100_000_000))
    n_epochs: int = field(default=10, metadata=_within(1, 1000))
    gamma: float = field(default=0.99, metadata=_within(0.0, 1.0))
    gae_lambda: float = field(default=0.95, metadata=_within(0.0, 1.0))
    clip_range: float = field(default=0.2, metadata=_within(1e-6, 10.0))
    ent_coef: float = field(default=0.0, metadata=_within(0.0, 10.0))
    vf_coef: float = field(default=0.5, metadata=_within(0.0, 100.0))
    max_grad_norm: float = field(default=0.5, metadata=_within(1e-6, 1e6))


@dataclass(frozen=True)
class PolicySettings(_Section):
    """Section [policy]: the networks of actor and critic, and what they see."""

    #: Widths of the hidden layers.
    hidden: list[int] = field(default_factory=lambda: [64, 64], metadata=_within(1, 65_536))
    #: Natural logarithm of the standard deviation of the action at the start.
    log_std_init: float = field(default=0.0, metadata=_within(-10.0, 2.0))
    #: Normalised observations are limited to +- this.
    clip_observation: float = field(default=10.0, metadata=_within(0.1, 1e6))


@dataclass(frozen=True)
class TrainingSettings(_Section):
    """Section [training]: how long, how often, on what."""

    #: Env steps (actions) of all walkers together.
    total_steps: int = field(default=1_000_000, metadata=_within(1, 10**12 - 1))
    #: Wall time after which training ends even so, s.
    seconds: float = field(default=1e9, metadata=_within(0.1, 1e9))
    #: Env steps over which `difficulty` goes linearly from `start_difficulty` to 1; 0 for full difficulty throughout.
    #: Evaluations are always at full difficulty.
    curriculum_steps: int = field(default=0, metadata=_within(0, 10**12 - 1))
    start_difficulty: float = field(default=0.0, metadata=_within(0.0, 1.0))
    eval_every_steps: int = field(default=500_000, metadata=_within(1, 10**12 - 1))
    eval_episodes: int = field(default=256, metadata=_within(1, 100_000))
    #: Episodes of the comparison with the state machine at the end.
    final_episodes: int = field(default=512, metadata=_within(1, 100_000))
    checkpoint_every_steps: int = field(default=1_000_000, metadata=_within(1, 10**12 - 1))
    seed: int = field(default=0, metadata=_within(0, HELD_OUT_SEED // 2))
    #: More than one makes torch's threads fight the environment's for the cores.
    torch_threads: int = field(default=1, metadata=_within(1, 1024))
    #: Threads that step the walkers; 0 takes all cores.
    env_threads: int = field(default=0, metadata=_within(0, 1024))
    #: The reward of an env step is limited to +- this: one walker that diverges must not distort the statistics of all.
    clip_reward: float = field(default=100.0, metadata=_within(1e-6, 1e12))
    #: Whether rewards are scaled by the running deviation of the return.
    normalise_reward: bool = True
    tensorboard: bool = True


@dataclass(frozen=True)
class Settings:
    """A complete training configuration; `table` is what the file and the command line said.

    `[env] scenario = "pushes"` and `reward = "safety"` name presets or files, as does `preset` in their sections
    `[env.scenario]` and `[env.reward]`, whose other keys override it.
    """

    num_envs: int
    env: dict[str, Any]
    ppo: PpoSettings
    policy: PolicySettings
    training: TrainingSettings
    table: dict[str, Any]

    @classmethod
    def load(cls, path: str | Path, changes: Iterable[str] = ()) -> Settings:
        """Read a TOML file and apply `key=value` changes to it."""
        try:
            table = read_toml(path)
        except OSError as error:
            raise ValueError(f"cannot read {path}: {error.strerror}") from None
        return cls.read(apply_settings(_spelt_out(table), changes))

    @classmethod
    def read(cls, table: Mapping[str, Any]) -> Settings:
        """Check a nested table."""
        table = _spelt_out(table)
        if unknown := [key for key in table if key not in ("env", "ppo", "policy", "training")]:
            raise ValueError(f"unknown key {unknown[0]}; expected one of env, ppo, policy, training")
        overrides = dict(_section("env", table.get("env", {})))
        num_envs = overrides.pop("num_envs", 1024)
        if problem := _problem(num_envs, 1024, (1, 1_000_000)):
            raise ValueError(f"env.num_envs = {num_envs!r} {problem}")
        try:
            env = resolve(_with_presets(overrides))
        except ValueError as error:
            raise ValueError(f"in section env: {error}") from None
        if env["action"]["mode"] not in ("direct", "residual"):
            mode = env["action"]["mode"]
            raise ValueError(f"env.action.mode = {mode!r} must be direct or residual: others ignore the policy")
        ppo = PpoSettings.read("ppo", table.get("ppo", {}))
        if num_envs * ppo.n_steps < 2 or (num_envs * ppo.n_steps) % ppo.batch_size:
            raise ValueError(
                f"ppo.batch_size = {ppo.batch_size} must divide env.num_envs * ppo.n_steps = {num_envs * ppo.n_steps}"
            )
        policy = PolicySettings.read("policy", table.get("policy", {}))
        training = TrainingSettings.read("training", table.get("training", {}))
        if "start_difficulty" in table.get("training", {}) and training.curriculum_steps == 0:
            raise ValueError(
                f"training.start_difficulty = {training.start_difficulty} has no effect: it needs "
                "training.curriculum_steps other than 0"
            )
        return cls(num_envs, env, ppo, policy, training, table)

    def to_toml(self) -> str:
        """Write what the file and the command line said as one TOML text."""
        return tomli_w.dumps(self.table)
