"""What the human intends over time: presets, and the same from TOML or CSV files."""

import csv
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any, Final

_PRESETS = resources.files("prosthesis_gym") / "presets" / "scenario"

#: Names of the shipped profiles; `trial40` is the 40 s trial of Figure 8.
PROFILES: Final = tuple(sorted(entry.name.removesuffix(".toml") for entry in _PRESETS.iterdir()))

_CSV_COLUMNS = ("time_s", "speed_m_s", "walk")
_TRUTH = {"1": True, "true": True, "0": False, "false": False}
#: A profile that names no duration runs on for this long after its last knot.
_REST_S = 5.0


def load_profile(source: str | Path) -> dict[str, Any]:
    """Read the `scenario` section of a preset, a TOML file, or a CSV file with the columns time_s, speed_m_s, walk.

    A TOML file holds a `[scenario]` section with a `profile`, or the `profile` list alone. The section always
    has a `profile` and a `duration_s`.
    """
    if source in PROFILES:
        return _section((_PRESETS / f"{source}.toml").read_text("utf-8"), str(source))
    path = Path(source)
    if path.suffix == ".toml" and path.is_file():
        return _section(path.read_text("utf-8"), str(path))
    if path.suffix == ".csv" and path.is_file():
        return _complete({"profile": _csv_knots(path)}, str(path))
    raise ValueError(
        f"profile = {str(source)!r}: neither one of {', '.join(PROFILES)} nor an existing .toml or .csv file"
    )


def _section(text: str, name: str) -> dict[str, Any]:
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{name}: {error}") from None
    scenario = content.get("scenario", {"profile": content.get("profile")})
    unknown = sorted(content.keys() - {"scenario", "profile"})
    if unknown:
        raise ValueError(f"{name}: unknown key {unknown[0]!r}; a profile has [scenario] or a list `profile`")
    return _complete(scenario, name)


def _complete(scenario: dict[str, Any], name: str) -> dict[str, Any]:
    knots = scenario.get("profile")
    if not isinstance(knots, list) or not knots:
        raise ValueError(f"{name}: profile = {knots!r} is not a list of {{time_s, speed_m_s, walk}}")
    if "duration_s" in scenario:
        return scenario
    try:
        return {**scenario, "duration_s": float(knots[-1]["time_s"]) + _REST_S}
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"{name}: last knot {knots[-1]!r} has no number time_s") from None


def _csv_knots(path: Path) -> list[dict[str, Any]]:
    with path.open(newline="", encoding="utf-8-sig") as file:
        rows = csv.DictReader(file, skipinitialspace=True)
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
