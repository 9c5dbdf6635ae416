"""Configuration: TOML and dictionaries in, one nested dictionary out. The schema itself lives in the Rust core."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from prosthesis_gym import _core
from prosthesis_gym.arguments import file_path
from prosthesis_gym.files import read_toml

Config = dict[str, Any]

CONTROL_PERIOD_S = _core.CONTROL_PERIOD_S
"""Control period of the prosthesis (200 Hz). One env step advances `action.hold` of them."""

FAST_SOLVER: Config = {"solver": {"stepper": "two_stage_w", "steps": 0}}
"""The fast stepper, the default: in as many steps as its accuracy takes with the walker's knee."""

REFERENCE_SOLVER: Config = {"solver": {"stepper": "rk4", "steps": 50}}
"""The converged reference stepper: RK4 at 0.1 ms with located events."""

#: Levels of a configuration at most, as in the core.
_DEEPEST = 32

#: What the core says of a value that Python could not turn into one of the schema's type.
_WRONG_TYPE = re.compile(
    r"([\w.]+)(?:\[\d+\])?: (?:(?:Type|Overflow|Value)Error: |unknown variant|unexpected type|expected either)"
)

_DISTRIBUTIONS = frozenset({"uniform", "log_uniform", "normal", "choice"})


def load_config(source: str | Path | Mapping[str, Any] | None = None) -> Config:
    """Read a configuration and check it against the schema.

    Args:
        source: path of a TOML file, a nested mapping, or None for the defaults. Missing keys take their defaults.

    Returns:
        The configuration as given (not filled up; see `resolve`), as a fresh nested dictionary.

    Raises:
        ValueError: the file is not UTF-8 or not TOML, a key is unknown, or a value lies outside its range.
        FileNotFoundError: there is no such file.

    """
    config = read_config(source)
    resolve(config)
    return config


def read_config(source: str | Path | Mapping[str, Any] | None = None) -> Config:
    """Read a part of a configuration that need not be valid alone; otherwise as `load_config`."""
    if source is None:
        return {}
    if isinstance(source, Mapping):
        return merge({}, plain(source))
    return read_toml(file_path("config", source))


def plain(value: Any, key: str = "", depth: int = 0) -> Any:  # noqa: ANN401 - a configuration's values are of any type
    """Return a configuration, or a part of it, as TOML could hold it: what NumPy has of numbers, flags and arrays too.

    Raises:
        ValueError: a key that is not a name, or a configuration that is too deep, such as one that holds itself.

    """
    if depth > _DEEPEST:
        raise ValueError(f"{key[:80]}...: a configuration must not be more than {_DEEPEST} levels deep")
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist(), key, depth)
    if isinstance(value, Mapping):
        for name in value:
            if not isinstance(name, str):
                raise ValueError(f"{key or 'configuration'}: key {name!r} must be a name")  # noqa: TRY004
        return {str(name): plain(item, f"{key}.{name}" if key else name, depth + 1) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, f"{key}[{index}]", depth + 1) for index, item in enumerate(value)]
    return value


def resolve(config: Mapping[str, Any]) -> Config:
    """Return the complete, validated configuration that a partial one stands for.

    Raises:
        ValueError: names the key, its value and what is allowed.

    """
    given = plain(config)
    try:
        resolved = _core.resolve(given)
    except ValueError as error:
        wrong = _WRONG_TYPE.match(str(error))
        if wrong is None or _row(wrong[1]) is None:
            raise
        raise ValueError(f"{wrong[1]} = {_at(given, wrong[1])!r} must be {_allowed(wrong[1])}") from None
    _refuse_flags(given, resolved, "")
    return resolved


def _at(config: Config, key: str) -> Any:  # noqa: ANN401 - whatever stands there
    """Return what stands at a dotted key, or None."""
    value: Any = config
    for name in key.split("."):
        value = value.get(name) if isinstance(value, Mapping) else None
    return value


def _allowed(key: str) -> str:
    """Say what the schema has at a key."""
    row = _row(key)
    if row is None:
        return "a number"
    number = "a number in " if row["range"].startswith(("[", "(")) else ""
    return f"{number}{row['range']} {row['unit']}".rstrip()


def _row(key: str) -> "_core.ParameterDoc | None":
    return next((row for row in _core.parameters() if row["key"] == key), None)


def _refuse_flags(given: object, resolved: Any, key: str) -> None:  # noqa: ANN401 - whatever the schema has there
    """Raise where one of `given` and the schema has true or false and the other has not.

    Python counts them among the numbers, and takes whatever is not empty for true.
    """
    if isinstance(given, bool) and not isinstance(resolved, bool):
        raise ValueError(f"{key} = {str(given).lower()} must be {_allowed(key)}")  # noqa: TRY004 - as all bad values
    if isinstance(resolved, bool) and not isinstance(given, bool):
        raise ValueError(f"{key} = {given!r} must be true or false")  # noqa: TRY004 - as all bad values
    if isinstance(given, Mapping) and isinstance(resolved, Mapping):
        for name, value in given.items():
            _refuse_flags(value, resolved.get(name), f"{key}.{name}" if key else name)
    elif isinstance(given, list) and isinstance(resolved, list):
        for index, (value, other) in enumerate(zip(given, resolved, strict=False)):
            _refuse_flags(value, other, f"{key}[{index}]")


def merge(base: Mapping[str, Any], override: Mapping[str, Any]) -> Config:
    """Return `base` with the entries of `override` in their place, section by section. Neither argument is changed.

    A distribution such as `{normal = [1.1, 0.1]}` is one value, not a section.
    """
    merged: Config = {key: merge({}, value) if isinstance(value, Mapping) else value for key, value in base.items()}
    for key, value in override.items():
        if isinstance(value, Mapping):
            section = merged.get(key)
            merged[key] = merge(section if is_section(section) and is_section(value) else {}, value)
        else:
            merged[key] = value
    return merged


def is_section(value: object) -> TypeGuard[Mapping[str, Any]]:
    """Whether a value is a section of settings, rather than one, such as a distribution."""
    return isinstance(value, Mapping) and not (len(value) == 1 and _DISTRIBUTIONS.issuperset(value))


def apply_settings(config: Mapping[str, Any], settings: Iterable[str]) -> Config:
    """Return `config` with `section.key=value` settings applied.

    Values are read as TOML (`1.5`, `true`, `[0.8, 1.5]`); what is not TOML is taken as a bare word.

    Raises:
        ValueError: a setting is not of the form `section.key=value`.

    """
    merged = merge({}, config)
    for setting in settings:
        if not isinstance(setting, str):
            raise ValueError(f"setting {setting!r} must have the form section.key=value")  # noqa: TRY004
        path, equals, text = setting.partition("=")
        *sections, key = path.strip().split(".")
        if not (equals and key and all(sections)):
            raise ValueError(f"setting {setting!r} must have the form section.key=value")
        override: Config = {key: _toml_value(text.strip())}
        for section in reversed(sections):
            override = {section: override}
        merged = merge(merged, override)
    return merged


def _toml_value(text: str) -> Any:  # noqa: ANN401 - a TOML value is of any type
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
    except RecursionError:
        raise ValueError(f"{text[:80]}...: its brackets are nested too deeply to be read") from None
