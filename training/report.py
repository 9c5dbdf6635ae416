"""The end of a run: its policy beside the state machine, in held-out episodes and in one undisturbed walk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console

from prosthesis_gym.config import merge, resolve
from prosthesis_gym.evaluation import comparison_table, evaluate
from prosthesis_gym.files import atomic_write
from prosthesis_gym.plotting import plot_gait
from prosthesis_gym.policy import Policy
from prosthesis_gym.progress import waiting
from prosthesis_gym.trial import run_trial
from training.settings import Settings

#: The walk that the gaits are compared in: straight and undisturbed, long enough for a dozen steady strides.
_WALK: dict[str, Any] = {
    "scenario": {
        "start": "standing",
        "duration_s": 25.0,
        "push_n": 0.0,
        "profile": [
            {"time_s": 0.0, "speed_m_s": 1.1, "walk": False},
            {"time_s": 1.0, "speed_m_s": 1.1, "walk": True},
        ],
    }
}


def write_report(folder: Path, settings: Settings, threads: int | None, console: Console) -> None:
    """Compare the policy in `folder` with the state machine: print and save the table, draw gait.png."""
    controllers = {"state machine": None, "policy": Policy.load(folder / "policy")}
    results = {}
    for name, controller in controllers.items():
        with waiting(f"evaluating the {name}", shown=not console.quiet):
            results[name] = evaluate(
                controller, settings.env, episodes=settings.training.final_episodes, threads=threads
            )
    table = comparison_table(results)
    console.print(table)
    with atomic_write(folder / "comparison.txt") as path, path.open("w", encoding="utf-8") as file:
        Console(file=file, width=100).print(table)

    trials = {}
    for name, controller in controllers.items():
        config = resolve(merge({**settings.env, "scenario": {}}, _WALK))
        with waiting(f"the {name} walks", shown=not console.quiet):
            trial = run_trial(config, policy=controller, progress=False)
        if trial.ended_early:
            console.print(f"gait.png lacks the {name}: it {trial.outcome} in an undisturbed walk at 1.1 m/s")
        else:
            trials[name] = trial
    written = "policy and comparison.txt"
    if trials:
        with waiting("drawing gait.png", shown=not console.quiet):
            plot_gait(trials, folder / "gait.png")
        written = "policy, comparison.txt and gait.png"
    console.print(f"{written} are in {folder}")
