"""Trains a knee policy: `python -m training.train configs/train/damper_ppo.toml`.

Everything of a run lies in one folder: policy/ (the best so far, by its falls in validation episodes), checkpoints/,
evaluation.csv, tensorboard/, config.toml, and at the end comparison.txt and gait.png.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from stable_baselines3 import PPO
from stable_baselines3.common import logger as sb3_logger
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecNormalize
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from prosthesis_gym.evaluation import VALIDATION_SEED, evaluate
from prosthesis_gym.files import atomic_write
from prosthesis_gym.policy import Policy
from prosthesis_gym.sb3 import ProsthesisVecEnv, ProsthesisVecNormalize
from prosthesis_gym.seeding import run_seed
from training.callbacks import (
    CurriculumCallback,
    EvaluationLog,
    EveryCallback,
    ProgressCallback,
    StopCallback,
    StopSignals,
)
from training.checkpoint import Progress, latest_checkpoint, load_checkpoint, save_checkpoint
from training.export import export_policy
from training.report import write_report
from training.settings import Settings


class BoundedReward(VecEnvWrapper):
    """Limits the reward of a step to +-`limit`."""

    def __init__(self, env: VecEnv, limit: float) -> None:
        super().__init__(env)
        self._limit = limit

    def reset(self) -> VecEnvObs:
        """Reset the walkers."""
        return self.venv.reset()

    def step_wait(self) -> VecEnvStepReturn:
        """Step the walkers."""
        observations, rewards, dones, infos = self.venv.step_wait()
        return observations, np.clip(rewards, -self._limit, self._limit), dones, infos


class Trainer:
    """One run in one folder."""

    def __init__(self, settings: Settings, folder: Path, *, resume: bool = False, quiet: bool = False) -> None:
        if folder.exists() and not resume:
            raise ValueError(f"{folder} exists: resume it with --resume {folder}, or choose another folder with --out")
        checkpoint = latest_checkpoint(folder / "checkpoints") if resume else None
        self.settings = settings
        self.folder = folder
        self.quiet = quiet
        options = settings.training
        self.threads = options.env_threads or None
        torch.set_num_threads(options.torch_threads)
        self.env = ProsthesisVecEnv(
            settings.num_envs,
            settings.env,
            threads=self.threads,
            staggered=True,
        )
        observed = ProsthesisVecNormalize(self.env, norm_reward=False, clip_obs=settings.policy.clip_observation)
        self.normaliser = VecNormalize(
            BoundedReward(observed, options.clip_reward),
            norm_obs=False,
            norm_reward=options.normalise_reward,
            gamma=settings.ppo.gamma,
        )
        self.model = _model(settings, self.normaliser)
        self.progress = Progress()
        if checkpoint is not None:
            self.progress = load_checkpoint(checkpoint, self.model, self.normaliser)
            self.progress.resumptions += 1
            self.model.num_timesteps = self.progress.steps
        self.curriculum: CurriculumCallback | None = None
        if options.curriculum_steps > 0:
            self.curriculum = CurriculumCallback(options.curriculum_steps, options.start_difficulty)
            # Learning resets the environment before its first rollout.
            self.env.set_attr("difficulty", self.curriculum.difficulty(self.progress.steps))
        # Resumed walkers must not live through the first episodes once more, nor those of runs with other seeds.
        self.model.set_random_seed(options.seed + self.progress.resumptions * settings.num_envs)
        self.env.seed(run_seed(options.seed, self.progress.resumptions))
        folder.mkdir(parents=True, exist_ok=True)
        with atomic_write(folder / "config.toml") as path:
            path.write_text(settings.to_toml(), encoding="utf-8")
        self.log = EvaluationLog(folder / "evaluation.csv")
        formats = ["tensorboard"] if options.tensorboard else []
        self.model.set_logger(sb3_logger.configure(str(folder / "tensorboard"), formats))

    def run(self) -> int:
        """Train to the end, or to a signal; return the number of that signal or 0."""
        options = self.settings.training
        remaining = options.total_steps - self.progress.steps
        began, before_s = time.perf_counter(), self.progress.seconds

        def update_progress() -> None:
            self.progress.steps = self.model.num_timesteps
            self.progress.seconds = before_s + time.perf_counter() - began

        def checkpoint() -> None:
            update_progress()
            save_checkpoint(self.folder / "checkpoints", self.model, self.normaliser, self.policy(), self.progress)

        def evaluation() -> None:
            update_progress()
            bar.print(self.evaluate())

        bar = ProgressCallback(self.env, self.settings.env["reward"], options.total_steps, shown=not self.quiet)
        with StopSignals() as signals:
            callbacks: list[BaseCallback] = [
                StopCallback(signals, began + options.seconds),
                bar,
                EveryCallback(options.eval_every_steps, evaluation),
                EveryCallback(options.checkpoint_every_steps, checkpoint),
            ]
            if self.curriculum is not None:
                callbacks.append(self.curriculum)
            if remaining > 0:
                try:
                    self.model.learn(remaining, CallbackList(callbacks), reset_num_timesteps=False)
                finally:
                    bar.close()
            checkpoint()
            evaluation()
            return signals.received or 0

    def policy(self) -> Policy:
        """Return the present policy."""
        clip = self.settings.policy.clip_observation
        return export_policy(self.model, self.env.observation_moments, clip, self.settings.env)

    def evaluate(self) -> str:
        """Run the validation episodes, keep the policy if it is the best so far, and say how it went."""
        policy, options = self.policy(), self.settings.training
        result = evaluate(
            policy, self.settings.env, episodes=options.eval_episodes, seed=VALIDATION_SEED, threads=self.threads
        )
        best = self.log.is_best(result)
        if best:
            policy.save(self.folder / "policy")
        self.log.append(self.progress.steps, self.progress.seconds, result)
        self.model.logger.record("evaluation/fall_rate", result.fall_rate)
        self.model.logger.record("evaluation/mean_return", result.mean_return)
        self.model.logger.dump(self.progress.steps)
        low, high = result.interval
        line = f"{self.progress.steps:>12,} steps, {self.progress.seconds:4.0f} s: {result.fall_rate:.1%} fall "
        line += f"({low:.1%} to {high:.1%}), return {result.mean_return:.2f}"
        return f"{line}, best so far" if best else line


def _model(settings: Settings, env: VecNormalize) -> PPO:
    ppo = dict(vars(settings.ppo))
    first, last = ppo.pop("learning_rate"), ppo.pop("final_learning_rate")
    return PPO(
        "MlpPolicy",
        env,
        learning_rate=lambda remaining: last + (first - last) * remaining,
        policy_kwargs={
            "net_arch": {"pi": settings.policy.hidden, "vf": settings.policy.hidden},
            "activation_fn": torch.nn.Tanh,
            "log_std_init": settings.policy.log_std_init,
        },
        device="cpu",
        seed=settings.training.seed,
        **ppo,
    )


def _console(*, stderr: bool = False, quiet: bool = False) -> Console:
    """Return a console that leaves paths in one piece, and brackets in them what they are."""
    return Console(stderr=stderr, quiet=quiet, markup=False, highlight=False, soft_wrap=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    console = _console(stderr=True)
    try:
        return _main(_parser().parse_args(arguments))
    except (ValueError, OSError) as error:
        console.print(f"error: {error}", style="red")
        return 2


def _main(options: argparse.Namespace) -> int:
    if options.config is None and options.resume is None:
        raise ValueError("name a configuration, or a run to --resume")
    if options.out is not None and options.resume is not None:
        raise ValueError("--out and --resume exclude each other: a resumed run stays in its folder")
    changes = list(options.set)
    if options.seconds is not None:
        changes.append(f"training.seconds={options.seconds}")
    source = options.config or options.resume / "config.toml"
    settings = Settings.load(source, changes)
    folder = options.resume or options.out or Path("runs") / source.stem
    trainer = Trainer(settings, folder, resume=options.resume is not None, quiet=options.quiet)
    console = _console(quiet=options.quiet)
    console.print(f"{settings.num_envs} walkers, run in {folder}; Ctrl-C stops and saves")
    number = trainer.run()
    if number:
        console.print(f"stopped; go on with: python -m training.train --resume {folder}")
        return 128 + number
    write_report(folder, settings, trainer.threads, console)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m training.train", description="Train a knee policy with PPO.")
    parser.add_argument("config", nargs="?", type=Path, help="TOML file, such as configs/train/damper_ppo.toml")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="for example ppo.gamma=0.99")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the run (runs/<name of the TOML file>)")
    parser.add_argument("--resume", type=Path, metavar="DIR", help="go on with the run in this folder")
    parser.add_argument("--seconds", type=float, metavar="S", help="stop learning after this wall time")
    parser.add_argument("--quiet", action="store_true", help="no progress bar and no table")
    return parser


if __name__ == "__main__":
    sys.exit(main())
