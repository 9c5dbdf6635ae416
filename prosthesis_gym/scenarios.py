"""What a walker meets: presets, and the same from TOML files, or from CSV files of speeds over time."""

import csv
import io
import tomllib
from collections.abc import Mapping
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Any, Final

from prosthesis_gym.arguments import file_path
from prosthesis_gym.bodies import scaled_body
from prosthesis_gym.config import Config, resolve
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.files import read_text, read_toml
from prosthesis_gym.layers import for_knee

_PRESETS = resources.files("prosthesis_gym") / "presets" / "scenario"

#: Names of the shipped scenarios; `trial40` is the 40 s trial of Figure 8.
SCENARIOS: Final = tuple(sorted(entry.name.removesuffix(".toml") for entry in _PRESETS.iterdir()))

#: Sections that say who walks and how, not what is met: they come with the environment, or with a policy.
_FOREIGN: Final = ("device", "action", "observation", "reward", "solver")
_BODIES = ("mass_kg", "height_m")
_CSV_COLUMNS = ("time_s", "speed_m_s", "walk")
_TRUTH = {"1": True, "true": True, "0": False, "false": False}
#: What a scenario with a profile leaves unsaid: nobody disturbs its walk.
_UNDISTURBED: Final = {"start": "standing", "push_n": 0.0}
#: A profile that names no duration runs on for this long after its last knot.
_REST_S = 5.0


def load_scenario(source: str | Path, device: str | None = None) -> Config:
    """Return the partial configuration of a preset, a TOML file or a CSV file, as it is for one knee unit.

    A TOML file holds `[scenario]` and any other section of what a walker meets or is, such as `[ground]`, `[sensors]`
    or `[body]`; a table `[bodies]` with lists `mass_kg` and `height_m` makes every combination a variant of which
    episodes draw one (`prosthesis_gym.bodies.scaled_body`). A list `profile` alone, or a CSV file with the columns
    time_s, speed_m_s, walk, is a scenario too. A scenario with a profile starts from standing, has no push and ends
    5 s after the last knot, unless it says otherwise.

    Args:
        source: one of `SCENARIOS`, or the path of a .toml or .csv file.
        device: what it draws of other knee units is left out; by default those are all but its own, or the damper.

    Raises:
        ValueError: no such scenario or knee unit, a section that is not a scenario's, or an impossible value.

    """
    if device is not None and device not in DEVICES:
        raise ValueError(f"device = {device!r} must be one of {', '.join(DEVICES)}")
    return for_knee(read_scenario(source), device)


def read_scenario(source: str | Path) -> Config:
    """Read a scenario as it is for whatever knee unit: `laid_over` leaves out what it draws of others."""
    if isinstance(source, str) and source in SCENARIOS:
        return _completed(tomllib.loads(_preset_text(str(source))), str(source))
    path = file_path("scenario", source)
    if path.suffix == ".toml" and path.is_file():
        return _completed(read_toml(path), str(path))
    if path.suffix == ".csv" and path.is_file():
        return _complete({"scenario": {"profile": _csv_knots(path)}}, str(path))
    raise ValueError(
        f"scenario = {str(source)!r}: neither one of {', '.join(SCENARIOS)} nor an existing .toml or .csv file"
    )


def scenario_description(name: str) -> str:
    """Return what a preset is for: the comment that its file begins with.

    Raises:
        ValueError: `name` is not one of `SCENARIOS`.

    """
    if name not in SCENARIOS:
        raise ValueError(f"scenario = {name!r} must be one of {', '.join(SCENARIOS)}")
    comment = _preset_text(name).partition("\n\n")[0]
    return " ".join(line.removeprefix("#").strip() for line in comment.splitlines())


def _preset_text(name: str) -> str:
    return (_PRESETS / f"{name}.toml").read_text("utf-8")


def _completed(content: Config, name: str) -> Config:
    if content.keys() == {"profile"}:
        content = {"scenario": content}
    if foreign := [section for section in _FOREIGN if section in content]:
        raise ValueError(
            f"{name}: section {foreign[0]!r} is not a scenario's: give it to the environment, beside the scenario"
        )
    if "bodies" in content:
        bodies = _bodies(content.pop("bodies"), name)
        scenario = content.setdefault("scenario", {})
        if "variants" in scenario:
            raise ValueError(f"{name}: bodies and scenario.variants exclude each other")
        scenario["variants"] = bodies
    return _complete(content, name)


def _bodies(table: object, name: str) -> list[Config]:
    """Return the sections of a body for every mass with every height."""
    if not isinstance(table, Mapping) or sorted(table) != sorted(_BODIES):
        raise ValueError(f"{name}: bodies = {table!r} must be a table of {' and '.join(_BODIES)}")
    for key in _BODIES:
        values = table[key]
        numbers = isinstance(values, list) and all(type(value) in (int, float) for value in values)
        if not numbers or not values:
            raise ValueError(f"{name}: bodies.{key} = {values!r} must be a list of numbers")
    try:
        return [scaled_body(mass_kg, height_m) for mass_kg, height_m in product(*(table[key] for key in _BODIES))]
    except ValueError as error:
        raise ValueError(f"{name}: bodies: {error}") from None


def _complete(config: Config, name: str) -> Config:
    scenario = config.get("scenario")
    if isinstance(scenario, dict) and "profile" in scenario:
        config = {**config, "scenario": {**_UNDISTURBED, **_with_duration(scenario, name)}}
    try:
        resolve(for_knee(config))
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    return config


def _with_duration(scenario: dict[str, Any], name: str) -> dict[str, Any]:
    knots = scenario["profile"]
    if not isinstance(knots, list) or not knots:
        raise ValueError(f"{name}: profile = {knots!r} is not a list of {{time_s, speed_m_s, walk}}")
    if "duration_s" in scenario:
        return scenario
    try:
        return {**scenario, "duration_s": float(knots[-1]["time_s"]) + _REST_S}
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"{name}: last knot {knots[-1]!r} has no number time_s") from None


def _csv_knots(path: Path) -> list[dict[str, Any]]:
    rows = csv.DictReader(io.StringIO(read_text(path), newline=""), skipinitialspace=True)
    if sorted(rows.fieldnames or ()) != sorted(_CSV_COLUMNS):
        raise ValueError(f"{path}: columns are {rows.fieldnames}, must be {', '.join(_CSV_COLUMNS)}")
    knots: list[dict[str, Any]] = []
    for row in rows:
        walk = _TRUTH.get(str(row["walk"]).strip().lower())
        if walk is None:
            raise ValueError(f"{path}, line {rows.line_num}: walk = {row['walk']!r} is none of 0, 1, false, true")
        knot: dict[str, Any] = {"walk": walk}
        for name in ("time_s", "speed_m_s"):
            try:
                knot[name] = float(row[name])
            except (TypeError, ValueError):
                raise ValueError(f"{path}, line {rows.line_num}: {name} = {row[name]!r} is not a number") from None
        knots.append(knot)
    return knots
