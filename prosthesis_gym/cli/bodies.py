"""`prosthesis-gym bodies`: which body sizes walk, and which fall."""

import argparse
from pathlib import Path

from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

from prosthesis_gym.bodies import HEIGHT_M, scaled_body
from prosthesis_gym.body_walks import BodyResult, save_bodies, walk_bodies
from prosthesis_gym.cli.parsers import Commands, new_parser
from prosthesis_gym.cli.trial_options import DEFAULTS, SOLVERS
from prosthesis_gym.config import apply_settings, merge, resolve
from prosthesis_gym.layers import Layer, laid_over

_EXAMPLES = """\
examples:
  prosthesis-gym bodies
  prosthesis-gym bodies --mass 60 75 90 --height 1.6 1.77 --speed 1.2 --out bodies.csv
  prosthesis-gym bodies --set ground.slope_deg=2

Each body starts from standing, intends to walk from 1 s on, and walks with the damper knee's state
machine. A cell is the speed (m/s) of a walk's last stride, or when and why the body fell.
"""
_MASSES_KG = [45.0, 60.0, 75.0, 90.0, 105.0, 120.0]
_HEIGHTS_M = [1.5, 1.6, 1.7, HEIGHT_M, 1.8, 1.9, 2.0]


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = new_parser(commands, "bodies", "walk bodies of many sizes and tell which fall", _EXAMPLES)
    add = parser.add_argument
    add("--mass", type=float, nargs="+", default=_MASSES_KG, metavar="KG", help="default: 45 to 120")
    add("--height", type=float, nargs="+", default=_HEIGHTS_M, metavar="M", help="default: 1.5 to 2.0")
    add("--speed", type=float, default=1.1, metavar="M/S", help="intended speed (default: 1.1)")
    add("--duration", type=float, default=20.0, metavar="S", help="length of each trial (default: 20)")
    add("--solver", choices=sorted(SOLVERS), default="reference", help="reference: converged (default); fast")
    add("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings", help="any parameter (repeatable)")
    add("--out", type=Path, metavar="FILE", help="one row per body, as .csv")
    add("--force", action="store_true", help="overwrite an existing file")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Walk every body, then write and print."""
    out: Path | None = arguments.out
    if out is not None:
        if out.suffix != ".csv":
            raise ValueError(f"{out}: bodies are saved as .csv, not {out.suffix or 'without an ending'}")
        if out.exists() and not arguments.force:
            raise ValueError(f"{out} exists; --force overwrites it")
    scenario = {"speed_m_s": arguments.speed, "duration_s": arguments.duration}
    scaled = scaled_body()
    for setting in arguments.settings:
        section, _, key = setting.partition("=")[0].strip().partition(".")
        if key in scaled.get(section, {}):
            raise ValueError(f"--set {setting}: each body has its own, by its mass and height")
    layers = [
        Layer(merge(DEFAULTS, SOLVERS[arguments.solver]), given=False),
        Layer({"scenario": scenario}),
        Layer(apply_settings({}, arguments.settings)),
    ]
    config = resolve(laid_over(layers))
    count = len(arguments.mass) * len(arguments.height)
    walks = walk_bodies(arguments.mass, arguments.height, config)
    results = list(track(walks, "walking", count, console=Console(stderr=True), transient=True))
    if out is not None:
        save_bodies(results, out)
    Console().print(_table(results))
    print(f"{sum(result.walks for result in results)} of {count} bodies walk for {arguments.duration:g} s")
    if out is not None:
        print(f"wrote {out}")


def _table(results: list[BodyResult]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1))
    table.add_column("height\nm", justify="right")
    masses = dict.fromkeys(result.mass_kg for result in results)
    for mass in masses:
        table.add_column(f"{mass:g}\nkg", justify="right")
    for height in dict.fromkeys(result.height_m for result in results):
        row = {result.mass_kg: _cell(result) for result in results if result.height_m == height}
        table.add_row(f"{height:.2f}", *(row[mass] for mass in masses))
    return table


def _cell(result: BodyResult) -> str:
    if result.walks and result.speed_m_s is not None:
        return f"{result.speed_m_s:.2f}"
    return f"[red]{result.outcome.removeprefix('fell: ')}\n{result.end_s:.1f} s[/]"
