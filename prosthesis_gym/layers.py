"""Configurations laid over one another, where a user's setting that nothing would read is refused.

What a scenario, a reward or a command's own defaults say may serve any knee and any walk: what a scenario draws of
knees that the leg does not have is left out. What a user says (a mapping,
a file, `--set`) is refused where it has no effect: in the whole configuration, and in what it was laid over with its
own layer, so that a later layer may replace what it goes with. What turns something off (a force of zero, a start in
stride) may stand beside the settings of what it turns off: the baseline of a sweep.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

from prosthesis_gym import _core
from prosthesis_gym.config import Config, is_section, merge, plain, resolve
from prosthesis_gym.devices import DEVICES


class Layer(NamedTuple):
    """A part of a configuration."""

    config: Mapping[str, Any]
    #: Whether a user gave it for this very walk, so that all of it must have an effect.
    given: bool = True


class _View:
    """A complete configuration, asked by dotted keys."""

    def __init__(self, config: Config) -> None:
        self._config = config
        scenario = config["scenario"]
        self._drawn = {*scenario["randomise"], *(key for one in scenario["variants"] for key, _ in _entries(one))}

    def __getitem__(self, key: str) -> Any:  # noqa: ANN401 - whatever the schema has there
        value: Any = self._config
        for name in key.split("."):
            value = value[name]
        return value

    def is_on(self, key: str) -> bool:
        """Whether a number is, or may be drawn, other than 0."""
        return key in self._drawn or self[key] not in (0.0, [0.0, 0.0], [])


@dataclass(frozen=True)
class _Use:
    """When some keys are read."""

    #: Dotted keys, or sections of them.
    keys: Sequence[str]
    #: What must hold, for the message.
    needs: str
    holds: Callable[[_View], bool]
    #: Keys or sections beside which they may stand unread: what turns them on and off, or others of their kind.
    beside: Sequence[str] = ()


def _switched(switch: str, *keys: str) -> _Use:
    return _Use(keys, f"{switch} other than 0", lambda view: view.is_on(switch), [switch])


def _chosen(key: str, values: Sequence[str], keys: Sequence[str]) -> _Use:
    needed = " or ".join(map(repr, values))
    return _Use(keys, f"{key} = {needed}", lambda view: view[key] in values)


def _of_device(kind: str) -> list[_Use]:
    device = DEVICES[kind]
    return [
        _chosen("device.kind", [kind], device.own_keys),
        _chosen("action.mode", ["residual"], [f"action.{device.residual_key}"]),
        _chosen("action.mode", ["constant"], [f"action.{device.constant_key}"]),
    ]


_MOTOR_SENSORS = ("sensors.motor_position", "sensors.motor_speed", "sensors.motor_current")

_USES: Sequence[_Use] = (
    *(use for kind in DEVICES for use in _of_device(kind)),
    _chosen(
        "action.mode",
        ["impedance"],
        ["action.max_stiffness_nm_rad", "action.max_damping_nms_rad", "action.max_rest_angle_deg"],
    ),
    _chosen("action.mode", ["direct", "residual", "impedance"], ["action.latch"]),
    _Use(
        ["action.latch"],
        "a knee whose state machine tells the phases of the gait apart",
        lambda view: view["action.latch"] != "phase" or DEVICES[view["device.kind"]].has_phases,
    ),
    _Use(
        ["sensors.motor_position"],
        "a controller that reads the motor's position, which none does",
        lambda _: False,
        ["sensors.knee_encoder"],
    ),
    # What is wrong with all sensors may be said of a motor's as well, whatever the knee.
    _Use(
        _MOTOR_SENSORS,
        "device.kind = 'motor'",
        lambda view: view["device.kind"] == "motor",
        ["sensors.knee_encoder"],
    ),
    # So may the weights of all terms of the reward.
    _Use(
        ["reward.electricity"],
        "device.kind = 'motor'",
        lambda view: view["device.kind"] == "motor",
        [f"reward.{term}" for term in _core.TERMS if term != "electricity"],
    ),
    _chosen(
        "socket.connection",
        ["compliant"],
        ["socket.place", "socket.pistoning_m", "socket.tilt_rad", "socket.damping_ratio"],
    ),
    _chosen(
        "tube.connection", ["compliant"], ["tube.stiffness_n_m", "tube.bending_stiffness_nm_rad", "tube.damping_ratio"]
    ),
    _chosen(
        "mechanism.trunk",
        ["forward"],
        [
            "human.trunk_stiffness_nm_rad",
            "human.trunk_damping_nms_rad",
            "human.trunk_limit_nm_kg",
            "human.standing_trunk_stiffness_nm_rad",
            "human.standing_trunk_damping_nms_rad",
            "human.standing_trunk_limit_nm_kg",
        ],
    ),
    _chosen(
        "mechanism.hip",
        ["forward"],
        [
            "human.hip_stiffness_nm_rad",
            "human.hip_damping_nms_rad",
            "human.hip_limit_nm_kg",
            "human.standing_hip_stiffness_nm_rad",
            "human.standing_hip_limit_nm_kg",
        ],
    ),
    # A body is described whole, whatever of it moves a leg.
    _Use(
        ["body.trunk_inertia_kg_m2"],
        "mechanism.trunk = 'forward'",
        lambda view: view["mechanism.trunk"] == "forward",
        ["body.trunk_mass_kg"],
    ),
    _Use(["body.sole_radius_m"], "body.sole_points of more than 2", lambda view: view["body.sole_points"] > 2),
    _switched("ground.step_height_m", "ground.step_x_m"),
    _switched("ground.stair_rise_m", "ground.stair_run_m", "ground.stair_start_x_m", "ground.stair_count"),
    _switched("ground.roughness_m", "ground.roughness_length_m", "ground.roughness_seed"),
    _Use(
        ["ground.edge_m"],
        "ground.step_height_m or ground.stair_rise_m other than 0",
        lambda view: view.is_on("ground.step_height_m") or view.is_on("ground.stair_rise_m"),
    ),
    _Use(
        ["scenario.push_s", "scenario.push_duration_s", "scenario.push_phase"],
        "an empty list scenario.pushes",
        lambda view: not view["scenario.pushes"],
    ),
    # A list that is given with what it replaces may have been laid over it on purpose.
    _Use(
        ["scenario.push_n"],
        "an empty list scenario.pushes",
        lambda view: not view["scenario.pushes"],
        ["scenario.pushes"],
    ),
    _switched("scenario.push_n", "scenario.push_s", "scenario.push_duration_s", "scenario.push_phase"),
    _switched("scenario.gust.force_n", "scenario.gust.duration_s", "scenario.gust.pause_s"),
    _Use(
        ["scenario.speed_m_s", "scenario.speed_change_s", "scenario.walk_s"],
        "an empty list scenario.profile",
        lambda view: not view["scenario.profile"],
        ["scenario.profile"],
    ),
    _Use(
        ["scenario.walk_s"],
        "scenario.start = 'standing' or 'random'",
        lambda view: view["scenario.start"] != "cyclic",
        ["scenario.start"],
    ),
)


def laid_over(
    layers: Sequence[Layer],
    completed: Callable[[Config], Mapping[str, Any]] | None = None,
    ignored: Sequence[str] = (),
) -> Config:
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
    final = _View(resolve(completed(whole) if completed else whole))
    for layer, below in zip(layers, steps[1:], strict=True):
        if layer.given:
            _refuse_idle(layer, below, final, ignored)
    return whole


def _knee(configs: Sequence[Config], completed: Callable[[Config], Mapping[str, Any]] | None) -> str:
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
    others = [key for other, device in DEVICES.items() if other != kind for key in device.own_keys]
    others += _MOTOR_SENSORS if kind != "motor" else ()
    fitting = dict(scenario)
    if isinstance(drawn := scenario.get("randomise"), Mapping):
        kept = {name: one for name, one in drawn.items() if not any(_is_part(name, other) for other in others)}
        fitting["randomise"] = kept
    if isinstance(variants := scenario.get("variants"), list):
        fitting["variants"] = [
            {name: section for name, section in one.items() if name not in others} if isinstance(one, Mapping) else one
            for one in variants
        ]
    return config | {"scenario": fitting}


def _is_part(key: str, of: str) -> bool:
    return key == of or key.startswith(f"{of}.")


def _refuse_idle(layer: Layer, below: Config, final: _View, ignored: Sequence[str]) -> None:
    """Raise where a setting of the layer is read neither in `final` nor in `below`, the layers up to this one."""
    complete = _complete_sections(layer.config)
    # What is drawn of parts that the leg does not have, the core refuses.
    for key, value in _entries(plain(layer.config)):
        if key.partition(".")[0] in (*ignored, *complete):
            continue
        for use in _USES:
            if not any(_is_part(key, one) for one in use.keys) or use.holds(final):
                continue
            if any(_names(layer.config, other) for other in use.beside):
                continue
            if not _holds_below(use, merge({"device": {"kind": final["device.kind"]}}, below)):
                raise ValueError(f"{key} = {value!r} has no effect: it needs {use.needs}{_instead(use, final)}")


def _holds_below(use: _Use, below: Config) -> bool:
    try:
        return use.holds(_View(resolve(below)))
    except ValueError:
        return False  # valid with a later layer alone


def _instead(use: _Use, final: _View) -> str:
    key, equals, _ = use.needs.partition(" = ")
    return f", which is {final[key]!r}" if equals else ""


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


def _names(config: Mapping[str, Any], key: str) -> bool:
    return any(_is_part(name, key) for name, _ in _entries(config))


def _entries(config: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted key and value of every setting."""
    for name, value in config.items():
        key = f"{above}.{name}" if above else name
        if key != "scenario.randomise" and is_section(value):
            yield from _entries(value, key)
        else:
            yield key, value
