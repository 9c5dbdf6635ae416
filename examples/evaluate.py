"""Which controller lets fewer walkers fall? The reference state machine, constant damping, and a trained policy.

    python examples/evaluate.py
    python examples/evaluate.py --episodes 2048 --policy runs/damper_ppo
    python examples/evaluate.py --scenario everything

All meet the same held-out episodes: by default a speed from 0.8 to 1.5 m/s, changed once, and a push of up to 300 N.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from prosthesis_gym import SCENARIOS
from prosthesis_gym.config import Config
from prosthesis_gym.console import clean_exit, spell_what_cannot_be_encoded
from prosthesis_gym.controller import Controller
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.evaluation import comparison_table, evaluate
from prosthesis_gym.policy import Policy


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    spell_what_cannot_be_encoded()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=512, metavar="N", help="default: %(default)s")
    parser.add_argument("--constant", type=float, default=5.0, metavar="N m s²/rad²", help="default: %(default)s")
    parser.add_argument("--policy", type=Path, metavar="FOLDER", help="a trained policy, as .ci/demo leaves behind")
    parser.add_argument("--scenario", metavar="NAME|FILE", help=f"{', '.join(SCENARIOS)}, or a file")
    options = parser.parse_args(arguments)
    with clean_exit(parser):
        compare(options)


def compare(options: argparse.Namespace) -> None:
    """Evaluate and print."""
    constant: Config = {"action": {"mode": "constant", DEVICES["damper"].constant_key: options.constant}}
    contenders: dict[str, tuple[Controller | None, Config]] = {
        "state machine": (None, {}),
        f"constant {options.constant:g}": (None, constant),
    }
    if options.policy is not None:
        contenders["policy"] = (Policy.load(options.policy), {})

    results = {}
    with Progress(console=Console(stderr=True), transient=True) as bar:
        for name, (controller, config) in contenders.items():
            task = bar.add_task(name)
            results[name] = evaluate(
                controller,
                config,
                scenario=options.scenario,
                episodes=options.episodes,
                progress=lambda steps, most, task=task: bar.update(task, completed=steps, total=most),
            )
    Console().print(comparison_table(results))


if __name__ == "__main__":
    main()
