"""The generated tables of the documentation pages, each as Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from typing import TYPE_CHECKING, Final

from prosthesis_gym import _core
from prosthesis_gym.config import resolve
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.reasons import TerminationReason

if TYPE_CHECKING:
    from prosthesis_gym._core import ParameterDoc

#: What ends an episode, by the name of its `TerminationReason`, in small letters.
_REASONS: Final = {
    "hip_height": ("terminated", "A fall: the hip is less than `termination.hip_height_m` above the ground."),
    "joint_limit": ("terminated", "Knee or ankle beyond `termination.knee_*_deg` or `termination.ankle_deg`."),
    "non_finite": (
        "terminated",
        "The integration diverged, by the reference too: a state that is not finite, a segment or stop beyond what is "
        "possible.",
    ),
    "time_limit": ("truncated", "The time limit is reached."),
}


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; cells may hold any text, code in backticks."""
    lines = ["| " + " | ".join(map(_cell, line)) + " |" for line in (head, *rows)]
    lines.insert(1, "|---" * len(head) + "|")
    return "\n".join(lines)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|")


def _code(text: str) -> str:
    return f"`{text}`" if text else ""


def parameter_table(prefix: str, parameters: Iterable[ParameterDoc] | None = None) -> str:
    """Return the parameters directly below `prefix` (such as "scenario."), or the given ones, without that prefix."""
    if parameters is None:
        below = [row for row in _core.parameters() if row["key"].startswith(prefix)]
        parameters = [row for row in below if "." not in row["key"].removeprefix(prefix)]
    rows = [
        (_code(row["key"].removeprefix(prefix)), _code(row["default"]), row["unit"], _code(row["range"]), row["doc"])
        for row in parameters
    ]
    if not rows:
        raise ValueError(f"no parameter starts with {prefix!r}")
    return markdown(("key", "default", "unit", "range", "meaning"), rows)


def all_parameters() -> str:
    """List the parameters of every section below a heading."""
    sections: dict[str, list[ParameterDoc]] = {}
    for row in _core.parameters():
        sections.setdefault(row["key"].rpartition(".")[0], []).append(row)
    tables = (f"## `{section}`\n\n{parameter_table(f'{section}.', rows)}" for section, rows in sections.items())
    return "\n\n".join(tables)


def environments() -> str:
    """List the registered environments with the shapes of their default spaces."""
    rows = []
    for kind, device in DEVICES.items():
        config = resolve({"device": {"kind": kind}})
        frame = len(_core.channels(config)) * config["observation"]["frames"]
        full = f"{_core.command_limits(config)[1]:g} {device.command_unit}"
        rows.append((_code(device.env_id), device.command_name, full, f"({_core.action_size(config)},)", f"({frame},)"))
    return markdown(("id", "command", "command of action +1", "action", "observation"), rows)


def observation() -> str:
    """List every channel, group by group, with its place in the default observation of each knee unit."""
    groups = _parameter("observation.groups")["range"].removeprefix("list of ").split(", ")
    places = {kind: _places(kind) for kind in DEVICES}
    # Only a motor knee has the channels of all groups.
    config = resolve({"device": {"kind": "motor"}, "observation": {"groups": groups}})
    rows = []
    for group, (name, low, high, doc) in zip(_core.channel_groups(config), _core.channels(config), strict=True):
        index = [str(place.get(name, "")) for place in places.values()]
        rows.append((_code(group), _code(name), f"[{low:g}, {high:g}]", *index, f"{doc}."))
    return markdown(("group", "channel", "bounds", *places, "meaning"), rows)


def _places(kind: str) -> dict[str, int]:
    channels = _core.channels(resolve({"device": {"kind": kind}}))
    return {name: place for place, (name, *_) in enumerate(channels)}


def action_modes() -> str:
    """Tell how many numbers an action has, by mode and knee unit."""
    modes = _parameter("action.mode")["range"].split(" | ")
    rows = [(_code(mode), *(_action_size(mode, kind) for kind in DEVICES)) for mode in modes]
    return markdown(("`action.mode`", *DEVICES), rows)


def _action_size(mode: str, kind: str) -> str:
    try:
        return str(_core.action_size({"action": {"mode": mode}, "device": {"kind": kind}}))
    except ValueError:  # a mode that this knee unit does not have
        return "–"


def reward() -> str:
    """List the terms of the reward in the order of `TERMS`."""
    parameters = {term: _parameter(f"reward.{term}") for term in _core.TERMS}
    rows = [(_code(term), row["default"], row["unit"], row["doc"]) for term, row in parameters.items()]
    return markdown(("term", "weight", "unit of the weight", "term, with its unit"), rows)


def reasons() -> str:
    """List the reasons for the end of an episode by their numbers."""
    return markdown(
        ("`termination_reason`", "ends as", "when"),
        [
            (f"{_code(reason.name)} ({reason})", *_REASONS[reason.name.lower()])
            for reason in TerminationReason
            if reason != TerminationReason.NONE
        ],
    )


def sensors() -> str:
    """List the sensors with their units and what is not ideal by default."""
    sections: dict[str, list[ParameterDoc]] = {}
    for row in _sensor_parameters():
        sections.setdefault(row["key"].split(".")[1], []).append(row)
    rows = []
    for sensor, parameters in sections.items():
        meaning = parameters[0]["doc"].partition("\n")[0]
        defaults = (f"`{row['key'].split('.')[2]} = {float(row['default']):.4g}`" for row in parameters if _set(row))
        rows.append((_code(f"sensors.{sensor}"), meaning, parameters[0]["unit"], ", ".join(defaults) or "ideal"))
    return markdown(("section", "sensor", "unit", "by default"), rows)


def sensor_options() -> str:
    """Explain what every sensor has."""
    parameters = _sensor_parameters()
    first = parameters[0]["key"].split(".")[1]
    rows = [
        (_code(row["key"].split(".")[2]), row["doc"].partition("\n")[2])
        for row in parameters
        if row["key"].split(".")[1] == first
    ]
    return markdown(("key", "meaning"), rows)


def _sensor_parameters() -> list[ParameterDoc]:
    return [row for row in _core.parameters() if row["key"].startswith("sensors.") and row["key"].count(".") == 2]


def _set(row: ParameterDoc) -> bool:
    return float(row["default"]) != 0.0


def presets() -> str:
    """List the files below `prosthesis_gym/presets` with their first comments."""
    root = resources.files("prosthesis_gym") / "presets"
    rows = [
        (kind.name, _code(entry.name.removesuffix(".toml")), _first_comment(entry.read_text(encoding="utf-8")))
        for kind in _sorted(root)
        if kind.is_dir()
        for entry in _sorted(kind)
        if entry.name.endswith(".toml")
    ]
    return markdown(("kind", "preset", "meaning"), rows)


def _sorted(folder: Traversable) -> list[Traversable]:
    return sorted(folder.iterdir(), key=lambda entry: entry.name)


def _first_comment(text: str) -> str:
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.lstrip("# "))
    return " ".join(lines)


def _parameter(key: str) -> ParameterDoc:
    return next(row for row in _core.parameters() if row["key"] == key)


TABLES: Final[dict[str, Callable[[], str]]] = {
    "environments": environments,
    "observation": observation,
    "observation-parameters": lambda: parameter_table("observation."),
    "action-modes": action_modes,
    "action-parameters": lambda: parameter_table("action."),
    "reward": reward,
    "reasons": reasons,
    "termination-parameters": lambda: parameter_table("termination."),
    "scenario-parameters": lambda: parameter_table("scenario."),
    "gust-parameters": lambda: parameter_table("scenario.gust."),
    "human-variations": lambda: parameter_table("scenario.human."),
    "presets": presets,
    "sensors": sensors,
    "sensor-options": sensor_options,
    "sensor-parameters": lambda: parameter_table("sensors."),
    "parameters": all_parameters,
}
"""By the name in the pages' markers."""
