"""Configurations laid over one another, where a user's setting that nothing would read is refused.

What a scenario, a reward or a command's own defaults say may serve any knee and any walk: what a scenario draws of
knees that the leg does not have is left out. What a user says (a mapping,
a file, `--set`) is refused where it has no effect: in the whole configuration, and in what it was laid over with its
own layer, so that a later layer may replace what it goes with. What turns something off (a force of zero, a start in
stride) may stand beside the settings of what it turns off: the baseline of a sweep. What has no effect, the core knows
(`_core.idle`).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from prosthesis_gym import _core
from prosthesis_gym.config import Config, is_section, merge, plain, resolve

#: Sections that are described whole, whatever of them is read: a body, all sensors of a leg, a reward for any knee.
#: What nothing reads may stand beside what is read.
_WHOLE = ("body", "sensors", "reward")

Completed = Callable[[Config], Mapping[str, Any]]


class Layer(NamedTuple):
    """A part of a configuration."""

    config: Mapping[str, Any]
    #: Whether a user gave it for this very walk, so that all of it must have an effect.
    given: bool = True


def laid_over(layers: Sequence[Layer], completed: Completed | None = None, ignored: Sequence[str] = ()) -> Config:
    """Return one configuration of many, later layers over earlier ones; missing keys are still missing.

    Args:
        layers: from the bottom to the top.
        completed: adds what is not in the layers, such as a controller's own sections.
        ignored: sections that are replaced on purpose, and not checked.

    Raises:
        ValueError: an impossible configuration, or a setting in a given layer that has no effect.

    """
    configs = [plain(layer.config) for layer in layers]
    kind = _knee(configs, completed)
    steps: list[Config] = [{}]
    for layer, config in zip(layers, configs, strict=True):
        steps.append(merge(steps[-1], config if layer.given else for_knee(config, kind)))
    whole = steps[-1]
    final = resolve(completed(whole) if completed else whole)
    for layer, config, below in zip(layers, configs, steps[1:], strict=True):
        if layer.given:
            _refuse_idle(config, below, final, ignored)
    return whole


def _knee(configs: Sequence[Config], completed: Completed | None) -> str:
    """Return the knee unit that the configurations make up, whatever their scenarios."""
    whole: Config = {}
    for config in configs:
        whole = merge(whole, {name: section for name, section in config.items() if name != "scenario"})
    kind: str = resolve(completed(whole) if completed else whole)["device"]["kind"]
    return kind


def for_knee(config: Config, kind: str | None = None) -> Config:
    """Return `config` without what its scenario draws of other knees than `kind`, by default its own."""
    scenario = config.get("scenario")
    if not isinstance(scenario, Mapping):
        return config
    if kind is None:
        kind = resolve({name: config[name] for name in ("device",) if name in config})["device"]["kind"]
    others = _of_other_knees(kind)
    fitting = dict(scenario)
    if isinstance(drawn := scenario.get("randomise"), Mapping):
        fitting["randomise"] = {name: one for name, one in drawn.items() if name not in others}
    if isinstance(variants := scenario.get("variants"), list):
        fitting["variants"] = [_without(one, others) if isinstance(one, Mapping) else one for one in variants]
    return config | {"scenario": fitting}


@cache
def _of_other_knees(kind: str) -> frozenset[str]:
    """Return the dotted keys that only other knees than `kind` read."""
    idle = _core.idle({"device": {"kind": kind}})
    return frozenset(key for key, (needs, _) in idle.items() if needs.startswith("device.kind = "))


def _without(config: Mapping[str, Any], keys: frozenset[str], above: str = "") -> Config:
    """Return `config` without some of its settings, and without sections that are empty then."""
    kept: Config = {}
    for name, value in config.items():
        key = f"{above}{name}"
        if is_section(value):
            if section := _without(value, keys, f"{key}."):
                kept[name] = section
        elif key not in keys:
            kept[name] = value
    return kept


def _refuse_idle(config: Config, below: Config, final: Config, ignored: Sequence[str]) -> None:
    """Raise where a setting of a layer is read neither in `final` nor in `below`, the layers up to this one."""
    idle = _core.idle(final)
    skipped = {*ignored, *_complete_sections(config)}
    # What is drawn of parts that the leg does not have, the core refuses.
    given = {key: value for key, value in _entries(config) if key.partition(".")[0] not in skipped}
    described = {key.partition(".")[0] for key in given if key not in idle}.intersection(_WHOLE)
    suspects = {key: idle[key] for key in given if key in idle and key.partition(".")[0] not in described}
    if not suspects:
        return
    idle_below = _idle_below(merge({"device": {"kind": final["device"]["kind"]}}, below))
    for key, (needs, switch) in suspects.items():
        switched = switch is not None and any(name == switch for name, _ in _entries(config))
        if not switched and (idle_below is None or key in idle_below):
            raise ValueError(f"{key} = {given[key]!r} has no effect: it needs {needs}{_instead(needs, final)}")


def _idle_below(below: Config) -> Mapping[str, tuple[str, str | None]] | None:
    try:
        return _core.idle(below)
    except ValueError:
        return None  # valid with a later layer alone


def _instead(needs: str, final: Config) -> str:
    """Say what stands where something else is needed."""
    section, _, name = needs.partition(" = ")[0].partition(".")
    return f", which is {final[section][name]!r}" if name in final.get(section, {}) else ""


@cache
def _defaults() -> Config:
    return resolve({})


def _complete_sections(config: Mapping[str, Any]) -> list[str]:
    """Return the sections that are whole, if most are: then they were filled up, and checked, before."""
    whole = [
        name
        for name, defaults in _defaults().items()
        if isinstance(config.get(name), Mapping) and set(defaults) <= set(config[name])
    ]
    return whole if len(whole) > len(_defaults()) // 2 else []


def _entries(config: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted key and value of every setting."""
    for name, value in config.items():
        key = f"{above}.{name}" if above else name
        if key != "scenario.randomise" and is_section(value):
            yield from _entries(value, key)
        else:
            yield key, value
