"""`prosthesis-gym render`: one trial as a video clip or a picture."""

import argparse
import re
from pathlib import Path

from prosthesis_gym.cli.parsers import Commands, check_overwrite, new_parser
from prosthesis_gym.cli.trial_options import add_controller_argument, add_trial_options, configure
from prosthesis_gym.draws import drawn_line, left_to_chance
from prosthesis_gym.progress import waiting
from prosthesis_gym.rendering.clip import check_clip_path, check_frame_rate, save_clip, save_picture
from prosthesis_gym.rendering.renderer import check_size
from prosthesis_gym.trial import run_trial

_EXAMPLES = """\
examples:
  prosthesis-gym render --out walk.mp4                                  the state machine, 10 s
  prosthesis-gym render --scenario trial40 --window 0 12 --out start.gif --fps 25 --size 960x540
  prosthesis-gym render constant:5 --speed 0.9 --slow-motion 4 --out slow.mp4
  prosthesis-gym render runs/damper_ppo/policy --scenario pushes --out pushed.mp4
  prosthesis-gym render --device motor --out stride.png                 six pictures of the last full stride
  prosthesis-gym render --set ground.slope_deg=-1 --at 5.2 --out down.png
"""


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = new_parser(commands, "render", "show one walking trial as a video clip or a picture", _EXAMPLES)
    add_controller_argument(parser)
    add_trial_options(parser)
    add = parser.add_argument_group("what comes out").add_argument
    add(
        "--out",
        type=Path,
        metavar="FILE",
        required=True,
        help="a clip as .mp4 or .gif; as .png a strip of the last full stride, or the picture of --at",
    )
    add("--fps", type=float, metavar="N", help="frames per second of a clip (default: 50)")
    add("--slow-motion", type=float, metavar="FACTOR", help="how many times slower (default: 1)")
    add("--window", nargs=2, type=float, metavar=("START", "END"), help="part of the trial that a clip shows, s")
    add("--at", type=float, metavar="S", help="time of a single picture")
    add("--size", type=_size, metavar="WxH", help="pixels (default: 1280x720; each picture of a strip: 360x640)")
    add("--force", action="store_true", help="overwrite an existing file")
    parser.set_defaults(run=run)


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT, such as 1280x720")
    return int(match[1]), int(match[2])


def run(arguments: argparse.Namespace) -> None:
    """Simulate, then draw."""
    out = arguments.out
    check_clip_path(out)
    check_overwrite(out, arguments.force)
    fps, slow_motion = (
        given if given is not None else usual for given, usual in ((arguments.fps, 50.0), (arguments.slow_motion, 1.0))
    )
    check_frame_rate(fps, slow_motion)
    if arguments.size is not None:
        check_size(arguments.size)
    for option, given in (("--fps", arguments.fps), ("--slow-motion", arguments.slow_motion)):
        if out.suffix == ".png" and given is not None:
            raise ValueError(f"{option} {given:g}: {out} is no clip")
    if out.suffix == ".png" and arguments.window is not None:
        raise ValueError(f"--window {arguments.window[0]:g} {arguments.window[1]:g}: {out} is no clip; see --at")
    if out.suffix != ".png" and arguments.at is not None:
        raise ValueError(f"--at {arguments.at:g}: {out} is no .png")
    config, policy = configure(arguments)
    trial = run_trial(config, policy=policy, seed=arguments.seed)
    if out.suffix == ".png":
        with waiting(f"drawing {out}"):
            save_picture(trial, out, at_s=arguments.at, size=arguments.size)
        shown = "a picture" if arguments.at is not None else "a strip"
    else:
        frames = save_clip(
            trial,
            out,
            fps=fps,
            slow_motion=slow_motion,
            window=arguments.window,
            size=arguments.size or (1280, 720),
        )
        shown = f"{frames} frames"
    if drawn := left_to_chance(trial):
        print(drawn_line(trial.seed, drawn))
    print(f"{trial.outcome} after {trial.end_s:.2f} s")
    print(f"wrote {out}: {shown}")
