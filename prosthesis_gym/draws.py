"""What a trial's episode drew of what its configuration leaves to chance."""

import math
from collections.abc import Mapping
from typing import Any

from prosthesis_gym.bodies import HEIGHT_M, scaled_body
from prosthesis_gym.config import merge, resolve
from prosthesis_gym.trial import Trial

_STARTS = ("standing", "cyclic")
_SEGMENTS = ("trunk", "thigh", "calf", "foot")


def left_to_chance(trial: Trial) -> dict[str, Any]:
    """Return what was drawn, by name: start, speeds, push, parameters, body and variations of the human; {} if nothing.

    Values are as drawn at full difficulty, in the unit that their name ends with; `push_n` is negative backward.
    """
    if not (drawn := trial.drawn):
        return {}
    scenario = trial.config["scenario"]
    found: dict[str, Any] = {}
    if scenario["start"] == "random":
        found["start"] = _STARTS[drawn["start"]]
    if not scenario["profile"]:
        found |= _speeds(trial)
    if not scenario["pushes"] and drawn["push_n"]:
        found |= {"push_n": drawn["push_n"], "push_s": drawn["push_s"]}
    found |= {key: drawn[key] for key in scenario["randomise"]}
    if scenario["variants"]:
        found |= _variant(trial, int(drawn["variant"]))
    return found | {key: drawn[key] for key, given in scenario["human"].items() if not isinstance(given, float)}


def _speeds(trial: Trial) -> dict[str, float]:
    scenario, drawn = trial.config["scenario"], trial.drawn
    if isinstance(scenario["speed_m_s"], float):
        return {}
    change_s = scenario["speed_change_s"]
    if isinstance(change_s, float) and change_s >= scenario["duration_s"]:
        return {"speed_m_s": drawn["first_speed_m_s"]}
    return {"first_speed_m_s": drawn["first_speed_m_s"], "last_speed_m_s": drawn["last_speed_m_s"]}


def _variant(trial: Trial, index: int) -> dict[str, Any]:
    """Return the number of a variant and, of one of the bodies of a table, mass and height."""
    variant = trial.config["scenario"]["variants"][index]
    body = merge(trial.config["body"], variant.get("body", {}))
    mass_kg = sum(body[f"{segment}_mass_kg"] for segment in _SEGMENTS)
    height_m = HEIGHT_M * body["thigh_length_m"] / resolve({})["body"]["thigh_length_m"]
    found: dict[str, Any] = {"variant": index}
    try:
        expected = scaled_body(mass_kg, height_m)["body"]
    except ValueError:
        return found
    if variant.get("body") and all(math.isclose(body[key], value, rel_tol=1e-6) for key, value in expected.items()):
        found |= {"body_mass_kg": round(mass_kg, 6), "body_height_m": round(height_m, 6)}
    return found


def drawn_line(seed: int, drawn: Mapping[str, Any]) -> str:
    """Say in a line what was drawn."""
    return f"drawn with seed {seed}: " + ", ".join(f"{name} = {_shown(value)}" for name, value in drawn.items())


def _shown(value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    return f"{value:.0f}" if value.is_integer() else f"{value:.4g}"
