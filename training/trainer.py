"""One training run: what learns, on what, and when it is saved and judged.

Everything of a run lies in one folder: policy/ (the best so far, by its falls in validation episodes), checkpoints/,
evaluation.csv, tensorboard/, config.toml, and at the end comparison.txt and gait.png.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common import logger as sb3_logger
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecNormalize
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from prosthesis_gym.evaluation import VALIDATION_SEED, evaluate
from prosthesis_gym.files import atomic_write
from prosthesis_gym.policy import Policy
from prosthesis_gym.progress import waiting
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
from training.checkpoint import Progress, load_checkpoint, save_checkpoint
from training.export import export_policy
from training.run_folder import (
    CHECKPOINTS,
    EVALUATIONS_FILE,
    POLICY,
    SETTINGS_FILE,
    TENSORBOARD,
    RunFolder,
    holds_a_run,
)
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
    """One run in one folder, which no other trainer may train in until `close`.

    Args:
        settings: what to train.
        folder: where; a run in it that was stopped before its first checkpoint starts again.
        resume: go on from the newest whole checkpoint in it.
        quiet: show no progress.
        tell: takes a line that says what is out of the ordinary in the folder.

    Raises:
        ValueError: nothing to resume, a run that could be resumed, or a folder that is another trainer's or no run's.

    """

    def __init__(
        self,
        settings: Settings,
        folder: Path,
        *,
        resume: bool = False,
        quiet: bool = False,
        tell: Callable[[str], None] = print,
    ) -> None:
        if resume and not holds_a_run(folder):
            raise ValueError(f"nothing to resume: no checkpoint in {folder}")
        self.settings = settings
        self.folder = folder
        self.quiet = quiet
        self._claim = RunFolder(folder)
        try:
            self._set_up(self._starting_point(resume, tell))
        except BaseException:
            self.close()
            raise

    def _starting_point(self, resume: bool, tell: Callable[[str], None]) -> Path | None:
        """Return the checkpoint to go on from, or None after making room for a start."""
        checkpoint = self._claim.newest_checkpoint(tell)
        if checkpoint is None:
            self._claim.clear(tell)
        elif not resume:
            raise ValueError(
                f"{self.folder} exists: resume it with --resume {self.folder}, or choose another folder with --out"
            )
        return checkpoint

    def close(self) -> None:
        """Leave the folder to others."""
        self._claim.release()

    def _set_up(self, checkpoint: Path | None) -> None:
        settings, folder = self.settings, self.folder
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
        # A resumed run must not draw its first actions and live through its first episodes once more, nor those of runs
        # with other seeds.
        seed = run_seed(options.seed, self.progress.resumptions)
        self.model.set_random_seed(_seed_of_32_bits(seed) if self.progress.resumptions else options.seed)
        self.env.seed(seed)
        with atomic_write(folder / SETTINGS_FILE) as path:
            path.write_text(settings.to_toml(), encoding="utf-8")
        self.log = EvaluationLog(folder / EVALUATIONS_FILE)
        formats = ["tensorboard"] if options.tensorboard else []
        self.model.set_logger(sb3_logger.configure(str(folder / TENSORBOARD), formats))

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
            save_checkpoint(self.folder / CHECKPOINTS, self.model, self.normaliser, self.policy(), self.progress)

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
                    bar.open()
                    self.model.learn(remaining, CallbackList(callbacks), reset_num_timesteps=False)
                finally:
                    bar.close()
                checkpoint()
            if remaining > 0 or self.log.last_steps != self.progress.steps:
                with waiting("validating", shown=not self.quiet):
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
            policy.save(self.folder / POLICY)
        self.log.append(self.progress.steps, self.progress.seconds, result)
        self.model.logger.record("evaluation/fall_rate", result.fall_rate)
        self.model.logger.record("evaluation/mean_return", result.mean_return)
        self.model.logger.dump(self.progress.steps)
        low, high = result.interval
        line = f"{self.progress.steps:>12,} steps, {self.progress.seconds:4.0f} s: {result.fall_rate:.1%} fall "
        line += f"({low:.1%} to {high:.1%}), return {result.mean_return:.2f}"
        return f"{line}, best so far" if best else line


def _seed_of_32_bits(seed: int) -> int:
    """Return what PyTorch's and NumPy's global generators take in place of a seed of any size."""
    return int(np.random.SeedSequence(seed).generate_state(1)[0])


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
