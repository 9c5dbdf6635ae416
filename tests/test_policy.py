"""A policy on disk is the policy in memory, and nothing but a policy is taken for one."""

import dataclasses
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym.config import resolve
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.policy import Normalisation, Policy

CONFIG = {"action": {"mode": "residual", "hold": 4}, "observation": {"frames": 2}}


def make_policy(sizes: tuple[int, ...] = (16, 64, 32, 1), seed: int = 0) -> Policy:
    rng = np.random.default_rng(seed)
    layers = [
        (rng.normal(size=(rows, columns)).astype(np.float32), rng.normal(size=columns).astype(np.float32))
        for rows, columns in pairwise(sizes)
    ]
    normalisation = Normalisation(rng.normal(size=sizes[0]), rng.uniform(0.1, 2.0, sizes[0]), clip=5.0)
    return Policy(layers, normalisation, CONFIG)


def observe(count: int, size: int = 16) -> NDArray[np.float32]:
    return np.random.default_rng(1).normal(scale=3.0, size=(count, size)).astype(np.float32)


def test_save_and_load_give_the_same_actions_to_the_last_bit(tmp_path: Path) -> None:
    policy = make_policy()
    policy.save(tmp_path / "policy")
    loaded = Policy.load(tmp_path / "policy")
    assert loaded.config == CONFIG
    assert loaded.layer_sizes == [16, 64, 32, 1]
    assert (loaded.act(observe(100)) == policy.act(observe(100))).all()
    assert sorted(path.name for path in (tmp_path / "policy").iterdir()) == ["policy.json", "policy.safetensors"]


def test_the_environment_it_was_trained_in_goes_with_it(tmp_path: Path) -> None:
    for kind, device in DEVICES.items():
        policy = dataclasses.replace(make_policy(), device=kind)
        policy.save(tmp_path / kind)
        assert json.loads((tmp_path / kind / "policy.json").read_text())["env_id"] == device.env_id
        assert Policy.load(tmp_path / kind).device == kind


def test_it_brings_its_knee_unit_and_sections_and_works_with_no_other_unit() -> None:
    policy = dataclasses.replace(make_policy(), device="motor")
    for config in ({"ground": {"slope_deg": 1.0}}, {"ground": {"slope_deg": 1.0}, "device": {"kind": "motor"}}):
        configured = policy.configure(config)
        assert configured == {**CONFIG, "ground": {"slope_deg": 1.0}, "device": {"kind": "motor"}}
    with pytest.raises(ValueError, match=r"device\.kind = 'damper' contradicts the policy.*trained with 'motor'"):
        policy.configure({"device": {"kind": "damper"}})
    with pytest.raises(ValueError, match="contradicts"):
        policy.configure(resolve({}))
    with pytest.raises(ValueError, match=r"device\.kind = 'piston' must be"):
        policy.configure({"device": {"kind": "piston"}})
    with pytest.raises(ValueError, match="device = 'piston' must be one of damper, motor, friction"):
        dataclasses.replace(policy, device="piston")


def test_weights_may_be_transposed_views(tmp_path: Path) -> None:
    policy = make_policy()
    layers = [(np.ascontiguousarray(weights.T).T, biases) for weights, biases in policy.layers]
    assert not layers[0][0].flags.c_contiguous
    transposed = Policy(layers, policy.normalisation, CONFIG)
    transposed.save(tmp_path)
    for same in (transposed, Policy.load(tmp_path)):
        assert (same.act(observe(500)) == policy.act(observe(500))).all()


def test_actions_equal_the_textbook_network() -> None:
    policy = make_policy()
    values = (observe(300) - policy.normalisation.mean) / np.sqrt(policy.normalisation.variance + 1e-8)
    values = np.clip(values, -5.0, 5.0)
    for index, (weights, biases) in enumerate(policy.layers):
        values = values @ weights.astype(float) + biases
        values = np.tanh(values) if index < 2 else np.clip(values, -1.0, 1.0)
    actions = policy.act(observe(300))
    assert actions.shape == (300,)
    assert actions.dtype == np.float64
    np.testing.assert_allclose(actions, values[:, 0], atol=2e-5)


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 1000])
def test_an_action_does_not_depend_on_the_batch(count: int) -> None:
    policy = make_policy()
    observations = observe(1000)
    together = policy.act(observations)
    assert (policy.act(observations[:count]) == together[:count]).all()
    assert (policy.act(observations[::-1]) == together[::-1]).all()


def test_no_observation_gives_no_action() -> None:
    assert make_policy().act(np.zeros((0, 16))).shape == (0,)


@pytest.mark.parametrize("shape", [(16,), (3, 15), (2, 2, 16)])
def test_observations_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"shape \(N, 16\)"):
        make_policy().act(np.zeros(shape))


def test_layers_must_chain_and_be_finite() -> None:
    policy = make_policy()
    with pytest.raises(ValueError, match="must chain"):
        Policy(policy.layers[:-1], policy.normalisation, CONFIG)
    with pytest.raises(ValueError, match="finite"):
        Policy([(np.full((16, 1), np.nan, np.float32), np.zeros(1, np.float32))], policy.normalisation, CONFIG)
    with pytest.raises(ValueError, match="at least one layer"):
        Policy([], policy.normalisation, CONFIG)


def test_a_missing_policy_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=str(tmp_path / "nothing")):
        Policy.load(tmp_path / "nothing")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 2}, "format = 2"),
        ({"env_id": "Other-v0"}, "env_id = 'Other-v0'"),
        ({"activation": "relu"}, "activation = 'relu'"),
        ({"layer_sizes": [16, 64, 1]}, "layer_sizes|must chain"),
        ({"observation": {"mean": [0.0], "var": [1.0], "clip": 5.0, "epsilon": 1e-8}}, "must chain"),
        ({"observation": {"mean": [0.0]}}, "missing key 'var'"),
        ({"config": {}}, "sections action and observation"),
        ({"weights_sha256": "0"}, "not the one"),
    ],
)
def test_a_foreign_description_is_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    make_policy().save(tmp_path)
    path = tmp_path / "policy.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ValueError, match=message):
        Policy.load(tmp_path)


@pytest.mark.parametrize("content", ["[]", "3", "{", '{"format": 1}'])
def test_a_damaged_description_is_a_value_error(tmp_path: Path, content: str) -> None:
    make_policy().save(tmp_path)
    (tmp_path / "policy.json").write_text(content)
    with pytest.raises(ValueError, match="policy"):
        Policy.load(tmp_path)


def test_damaged_or_mixed_weights_are_refused(tmp_path: Path) -> None:
    make_policy().save(tmp_path / "a")
    make_policy(seed=1).save(tmp_path / "b")
    weights = tmp_path / "a" / "policy.safetensors"
    weights.write_bytes((tmp_path / "b" / "policy.safetensors").read_bytes())
    with pytest.raises(ValueError, match="not the one"):
        Policy.load(tmp_path / "a")
    weights.write_bytes(b"")
    with pytest.raises(ValueError, match="not the one"):
        Policy.load(tmp_path / "a")
