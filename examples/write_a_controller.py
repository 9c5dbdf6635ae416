"""A knee controller of one's own, seen walking: edit `damping_nms2_rad2` and run this file again.

python examples/write_a_controller.py --out my_walk.png
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from prosthesis_gym.console import clean_exit, spell_what_cannot_be_encoded
from prosthesis_gym.controller import Readings, SensorController
from prosthesis_gym.plotting import check_plot_path, plot_trial
from prosthesis_gym.progress import waiting
from prosthesis_gym.trial import run_trial

#: From standing to 1.1 m/s, without pushes; `prosthesis-gym parameters scenario` has the rest.
WALK = {"scenario": {"start": "standing", "speed_m_s": 1.1, "walk_s": 1.0, "push_n": 0.0}}


def damping_nms2_rad2(sensors: Readings) -> NDArray[np.float64]:
    """Firm while the leg is loaded, until push-off; in swing free, but braked before the knee is straight."""
    stance = (sensors["tube_force_bw"] > 0.05) & (sensors["tube_moment_nm_kg"] < 0.7)
    nearly_straight = (sensors["knee_angle_rad"] < np.radians(20.0)) & (sensors["knee_speed_rad_s"] < 0.0)
    return np.where(stance, 10.0, np.where(nearly_straight, 3.0, 0.0))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    spell_what_cannot_be_encoded()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("my_walk.png"), metavar="FILE", help="default: %(default)s")
    parser.add_argument("--seconds", type=float, default=10.0, metavar="S", help="default: %(default)s")
    parser.add_argument("--force", action="store_true", help="overwrite an existing figure")
    parser.add_argument("--sensors", action="store_true", help="only list the sensors")
    options = parser.parse_args(arguments)

    controller = SensorController(damping_nms2_rad2, device="damper")
    if options.sensors:
        print("\n".join(f"{name:24} {meaning}" for name, meaning in controller.sensors.items()))
        return
    with clean_exit(parser):
        check_plot_path(options.out)
        if options.out.exists() and not options.force:
            raise ValueError(f"{options.out} exists; --force overwrites it")
        trial = run_trial(WALK, policy=controller, duration_s=options.seconds)
        with waiting(f"drawing {options.out}"):
            plot_trial(trial, options.out)
    print(f"{trial.outcome} after {trial.end_s:.2f} s; wrote {options.out}")


if __name__ == "__main__":
    main()
