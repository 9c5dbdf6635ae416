"""Trains a knee policy: `python -m training.train configs/train/damper_ppo.toml`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from prosthesis_gym.console import spell_what_cannot_be_encoded
from prosthesis_gym.extras import optional
from prosthesis_gym.progress import waiting
from training.settings import Settings

_EXAMPLES = """\
examples:
  python -m training.train configs/train/damper_ppo.toml
  python -m training.train configs/train/motor_ppo.toml --out runs/stronger --set env.action.residual_a=6.0
  python -m training.train --resume runs/stronger --set training.total_steps=12_000_000
  python -m training.train configs/train/damper_ppo.toml --seconds 60
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line. Exit code 0 for success, 2 for bad input, 128 + number for a signal."""
    spell_what_cannot_be_encoded()
    options = _parser().parse_args(arguments)
    try:
        return _main(options)
    except (ValueError, OSError, ModuleNotFoundError) as error:
        _console(stderr=True).print(f"error: {error}", style="red")
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
    folder, resume = options.resume or options.out or Path("runs") / source.stem, options.resume is not None
    with waiting("loading PyTorch", shown=not options.quiet):
        optional("stable_baselines3", "train")
        # What takes seconds to import comes after mistakes were named.
        from training.report import write_report  # noqa: PLC0415
        from training.run_folder import holds_a_run  # noqa: PLC0415
        from training.trainer import Trainer  # noqa: PLC0415
    if options.go_on and not resume:
        folder, resume = _where_to_go_on(folder, settings, holds_a_run)
    console, errors = _console(quiet=options.quiet), _console(stderr=True)
    with waiting("preparing", shown=not options.quiet):
        trainer = Trainer(settings, folder, resume=resume, quiet=options.quiet, tell=errors.print)
    with closing(trainer):
        console.print(f"{settings.num_envs} walkers, run in {folder}; Ctrl-C stops and saves")
        go_on = f"go on with: python -m training.train --resume {folder}"
        try:
            number = trainer.run()
        except OSError:
            errors.print(f"stopped by an error, below; when it is mended, {go_on}")
            raise
        if number:
            console.print(f"stopped; {go_on}")
            return 128 + number
        write_report(folder, settings, trainer.threads, console)
    return 0


def _where_to_go_on(folder: Path, settings: Settings, holds_a_run: Callable[[Path], bool]) -> tuple[Path, bool]:
    """Return the folder of a run of these settings and whether it exists: the first of folder, folder-2, ... ."""
    number, place = 1, folder
    while holds_a_run(place) and (place / "config.toml").is_file():
        if _trains_the_same(place / "config.toml", settings):
            return place, True
        number += 1
        place = folder.with_name(f"{folder.name}-{number}")
    return place, False


def _trains_the_same(path: Path, settings: Settings) -> bool:
    """Whether a run's file has these settings, but for those that only say when to stop and on how many threads."""
    try:
        others = Settings.load(path)
    except (ValueError, OSError):  # of another version, or of a preset that is no more
        return False

    def what(settings: Settings) -> Settings:
        training = replace(settings.training, seconds=1.0, env_threads=1, torch_threads=1)
        return replace(settings, training=training, table={})

    return what(others) == what(settings)


def _console(*, stderr: bool = False, quiet: bool = False) -> Console:
    """Return a console that leaves paths in one piece, and brackets in them what they are."""
    return Console(stderr=stderr, quiet=quiet, markup=False, highlight=False, soft_wrap=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m training.train",
        description="Train a knee policy with PPO.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("config", nargs="?", type=Path, help="TOML file, such as configs/train/damper_ppo.toml")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="for example ppo.gamma=0.99")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the run (runs/<name of the TOML file>)")
    parser.add_argument("--resume", type=Path, metavar="DIR", help="go on with the run in this folder")
    parser.add_argument(
        "--go-on",
        action="store_true",
        help="if the folder has a run of these settings, limit of time and threads apart, go on with it; if of others, "
        "take a new folder beside it",
    )
    parser.add_argument("--seconds", type=float, metavar="S", help="stop learning after this wall time")
    parser.add_argument("--quiet", action="store_true", help="no progress bar and no table")
    return parser


if __name__ == "__main__":
    sys.exit(main())
