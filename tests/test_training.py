"""Training end to end, in small: what a run leaves behind, how it goes on, stops, and says no."""

import csv
import os
import signal
import subprocess
import sys
import time
import tomllib
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from prosthesis_gym import _core
from prosthesis_gym.config import merge, resolve
from prosthesis_gym.evaluation import evaluate
from prosthesis_gym.policy import Policy
from prosthesis_gym.rewards import load_reward
from prosthesis_gym.sb3 import ProsthesisVecEnv, ProsthesisVecNormalize
from prosthesis_gym.scenarios import load_scenario
from training.checkpoint import latest_checkpoint, load_checkpoint, save_checkpoint
from training.export import export_policy
from training.settings import Settings
from training.train import main
from training.trainer import BoundedReward, Trainer

ROOT = Path(__file__).parents[1]
TINY = """
[env]
num_envs = 16
[env.action]
mode = "residual"
hold = 4
[env.observation]
frames = 2
[env.scenario]
duration_s = 3.0
[ppo]
n_steps = 32
batch_size = 256
n_epochs = 2
[policy]
hidden = [16, 8]
[training]
total_steps = 2048
eval_every_steps = 1024
eval_episodes = 16
final_episodes = 16
checkpoint_every_steps = 1024
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "evaluation.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def checkpoints(folder: Path) -> list[int]:
    return sorted(int(path.name) for path in (folder / "checkpoints").iterdir())


def test_a_run_leaves_everything_behind_and_can_be_resumed(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    assert main([str(config), "--out", str(folder), "--set", "ppo.gamma=0.98"]) == 0
    assert "95 % interval" in capsys.readouterr().out
    assert checkpoints(folder) == [1024, 2048]
    assert [row["steps"] for row in rows(folder)] == ["1024", "2048"]
    assert tomllib.loads((folder / "config.toml").read_text())["ppo"]["gamma"] == 0.98
    assert list((folder / "tensorboard").glob("events.*"))
    assert "state machine" in (folder / "comparison.txt").read_text()
    assert (folder / "gait.png").stat().st_size > 10_000
    assert not list(folder.rglob(".*")), "temporary files are left"
    best = min(rows(folder), key=lambda row: (float(row["failure_rate"]), -float(row["mean_return"])))
    settings = Settings.load(config)
    kept = evaluate(Policy.load(folder / "policy"), settings.env, episodes=16, seed=2_000_000_000)
    assert kept.mean_return == pytest.approx(float(best["mean_return"]), abs=1e-9)

    assert main([str(config), "--out", str(folder)]) == 2
    assert "exists" in capsys.readouterr().err
    assert main(["--resume", str(folder), "--set", "training.total_steps=3072", "--quiet"]) == 0
    assert checkpoints(folder) == [1024, 2048, 3072]
    assert [row["steps"] for row in rows(folder)] == ["1024", "2048", "3072"]
    assert float(rows(folder)[2]["seconds"]) >= float(rows(folder)[1]["seconds"])
    assert tomllib.loads((folder / "config.toml").read_text())["ppo"]["gamma"] == 0.98


def test_training_is_reproducible_and_resumes_from_the_very_weights(config: Path, tmp_path: Path) -> None:
    def train(name: str) -> Trainer:
        settings = Settings.load(config, ["training.tensorboard=false"])
        with closing(Trainer(settings, tmp_path / name, quiet=True)) as trainer:
            assert trainer.run() == 0
        return trainer

    first, second = train("a"), train("b")
    observations = np.random.default_rng(0).normal(size=(50, 16)).astype(np.float32)
    assert (first.policy().act(observations) == second.policy().act(observations)).all()
    resumed = Trainer(Settings.load(config), tmp_path / "a", resume=True, quiet=True)
    assert (resumed.policy().act(observations) == first.policy().act(observations)).all()
    assert resumed.model.num_timesteps == 2048
    for ours, theirs in zip(resumed.env.observation_moments, first.env.observation_moments, strict=True):
        assert (np.asarray(ours) == np.asarray(theirs)).all()
    assert resumed.normaliser.ret_rms.var == first.normaliser.ret_rms.var
    state, expected = (trainer.model.policy.optimizer.state_dict()["state"] for trainer in (resumed, first))
    assert state.keys() == expected.keys() != set()
    assert all(torch.equal(state[key]["exp_avg"], expected[key]["exp_avg"]) for key in state)


def test_a_resumed_run_shares_its_randomness_with_no_other(config: Path, tmp_path: Path) -> None:
    def draws(seed: int, name: str, *, resume: bool) -> tuple[float, ...]:
        settings = Settings.load(config, ["training.tensorboard=false", f"training.seed={seed}"])
        with closing(Trainer(settings, tmp_path / name, resume=resume, quiet=True)) as trainer:
            trainer.progress.steps += resume
            folder = tmp_path / name / "checkpoints"
            save_checkpoint(folder, trainer.model, trainer.normaliser, trainer.policy(), trainer.progress)
            return float(torch.rand(1)), float(np.random.rand()), float(trainer.model.action_space.sample()[0])  # noqa: NPY002

    # As many seeds apart as there are walkers, and their neighbours.
    seeds = (0, 1, 16, 17, 32)
    seen = [draws(seed, f"run-{seed}", resume=resume) for resume in (False, True, True) for seed in seeds]
    assert all(len(set(kind)) == len(seen) for kind in zip(*seen, strict=True))
    again = [draws(16, "again", resume=resume) for resume in (False, True, True)]
    assert again == seen[seeds.index(16) :: len(seeds)]


@pytest.mark.parametrize("kind", ["motor", "friction"])
def test_other_knees_are_trained_by_naming_them(config: Path, tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "run"
    assert main([str(config), "--out", str(folder), "--set", f"env.device.kind={kind}", "--quiet"]) == 0
    policy = Policy.load(folder / "policy")
    assert policy.device == kind
    assert policy.layer_sizes[0] == 2 * len(_core.channels({"device": {"kind": kind}}))
    with pytest.raises(ValueError, match="contradicts the policy"):
        evaluate(policy, Settings.load(config).env, episodes=2)


def test_the_exported_policy_acts_as_the_model_does(config: Path) -> None:
    torch.set_num_threads(1)
    settings = Settings.load(config)
    env = ProsthesisVecEnv(16, settings.env)
    normalised_env = ProsthesisVecNormalize(env, norm_reward=False, clip_obs=5.0)
    options: dict[str, Any] = {"net_arch": {"pi": [16, 8], "vf": [4]}, "activation_fn": torch.nn.Tanh}
    model = PPO(
        "MlpPolicy",
        normalised_env,
        n_steps=64,
        batch_size=64,
        learning_rate=0.01,
        policy_kwargs=options,
        device="cpu",
        seed=0,
    )
    model.learn(2048)
    moments = env.observation_moments
    policy = export_policy(model, moments, 5.0, settings.env)
    observations = np.random.default_rng(0).normal(scale=2.0, size=(2000, 16)).astype(np.float32)
    normalised = ((observations - moments.mean) / np.sqrt(moments.variance + 1e-8)).clip(-5.0, 5.0).astype(np.float32)
    expected, _ = model.predict(normalised, deterministic=True)
    np.testing.assert_allclose(policy.act(observations), expected[:, 0], atol=1e-5)
    assert np.ptp(expected) > 0.1
    assert policy.config == {section: settings.env[section] for section in ("action", "observation")}


def test_rewards_are_bounded_before_they_enter_any_statistics(config: Path) -> None:
    settings = Settings.load(config, ["env.reward.alive=1e6"])
    bounded = BoundedReward(ProsthesisVecEnv(4, settings.env), 5.0)
    normaliser = VecNormalize(bounded, gamma=0.0)
    normaliser.reset()
    for _ in range(3):
        normaliser.step(np.zeros((4, 1), np.float32))
    assert (normaliser.get_original_reward() == 5.0).all()
    assert abs(normaliser.ret_rms.mean - 5.0) < 0.01


def test_other_networks_are_not_exported(config: Path) -> None:
    settings = Settings.load(config)
    env = ProsthesisVecEnv(2, settings.env)
    model = PPO(
        "MlpPolicy",
        ProsthesisVecNormalize(env),
        n_steps=8,
        batch_size=16,
        policy_kwargs={"activation_fn": torch.nn.ReLU},
        device="cpu",
    )
    with pytest.raises(ValueError, match="ReLU"):
        export_policy(model, env.observation_moments, 10.0, settings.env)


@pytest.mark.skipif(os.name == "nt", reason="Windows cannot send a process SIGINT or SIGTERM that it may catch")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_and_saves(config: Path, tmp_path: Path, number: signal.Signals) -> None:
    folder = tmp_path / "run"
    command = [
        sys.executable,
        "-m",
        "training.train",
        str(config),
        "--out",
        str(folder),
        "--set",
        "training.total_steps=100000000",
    ]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60.0
    while not (folder / "evaluation.csv").exists():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(number)
    output, _ = process.communicate(timeout=30)
    assert process.returncode == 128 + number
    assert f"--resume {folder}" in output
    steps = checkpoints(folder)[-1]
    assert steps < 100_000_000
    assert rows(folder)[-1]["steps"] == str(steps)
    Policy.load(folder / "policy")
    resumed = Trainer(Settings.load(folder / "config.toml"), folder, resume=True, quiet=True)
    assert resumed.model.num_timesteps == steps


def test_a_time_limit_ends_learning(config: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    began = time.perf_counter()
    change = "training.total_steps=100000000"
    assert main([str(config), "--out", str(folder), "--quiet", "--seconds", "1.5", "--set", change]) == 0
    assert time.perf_counter() - began < 15.0
    assert checkpoints(folder)[-1] < 100_000_000
    assert (folder / "gait.png").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("ppo.gama=0.9", "unknown key ppo.gama"),
        ("policy.layers=[3]", "unknown key policy.layers"),
        ("training.step=3", "unknown key training.step"),
        ("trainin.seed=3", "unknown key trainin"),
        ("env.num_walkers=3", "num_walkers"),
        ("env.action.hodl=3", "action.hodl"),
        ("env.action.mode=constant", "env.action.mode = 'constant'"),
        ("env.num_envs=0", r"env.num_envs = 0 is outside its allowed range \[1, 1e\+06\]"),
        ("env=3", "env = 3 must be a section"),
        ("ppo=3", "ppo = 3 must be a section"),
        ("ppo.gamma=1.5", r"ppo.gamma = 1.5 is outside its allowed range \[0, 1\]"),
        ("ppo.gamma=nan", "ppo.gamma = nan is outside"),
        ("ppo.n_epochs=2.5", "ppo.n_epochs = 2.5 must be a whole number"),
        ("ppo.n_epochs=true", "must be a whole number"),
        ("ppo.learning_rate=fast", "ppo.learning_rate = 'fast' must be a number"),
        ("ppo.batch_size=100", "ppo.batch_size = 100 must divide env.num_envs . ppo.n_steps = 512"),
        ("policy.hidden=[]", "policy.hidden"),
        ("policy.hidden=64", "must be a list"),
        ("policy.hidden=[64, 0]", r"policy.hidden = \[64, 0\] is outside"),
        ("training.tensorboard=1", "training.tensorboard = 1 must be true or false"),
        ("training.seed=1000000000", "training.seed"),
    ],
)
def test_mistakes_are_named(config: Path, change: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Settings.load(config, [change])


def test_mistakes_on_the_command_line_leave_no_folder(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    for arguments, message in (
        ([str(config), "--out", str(folder), "--set", "ppo.gama=1"], "ppo.gama"),
        ([str(tmp_path / "none.toml"), "--out", str(folder)], "cannot read"),
        (["--out", str(folder)], "name a configuration"),
        (["--resume", str(folder)], "cannot read"),
        ([str(config), "--resume", str(folder)], "no checkpoint"),
        ([str(config), "--resume", str(folder), "--out", str(folder)], "exclude each other"),
    ):
        assert main(arguments) == 2
        assert message in capsys.readouterr().err
    assert not folder.exists()


def test_a_checkpoint_of_another_network_is_refused(config: Path, tmp_path: Path) -> None:
    trainer = Trainer(Settings.load(config), tmp_path / "run", quiet=True)
    save_checkpoint(tmp_path / "run/checkpoints", trainer.model, trainer.normaliser, trainer.policy(), trainer.progress)
    trainer.close()
    with pytest.raises(ValueError, match="cannot resume"):
        Trainer(Settings.load(config, ["policy.hidden=[32]"]), tmp_path / "run", resume=True, quiet=True)
    with pytest.raises(ValueError, match="cannot resume"):
        Trainer(Settings.load(config, ["env.observation.frames=1"]), tmp_path / "run", resume=True, quiet=True)
    latest = latest_checkpoint(tmp_path / "run/checkpoints", print)
    assert latest is not None
    (latest / "progress.json").write_text("{}")
    with pytest.raises(ValueError, match="cannot resume"):
        load_checkpoint(latest, trainer.model, trainer.normaliser)


def test_settings_survive_being_written(config: Path) -> None:
    profile = "env.scenario.profile=[{time_s = 0.0, speed_m_s = 1.1, walk = true}]"
    settings = Settings.load(config, ["ppo.learning_rate=1e-5", profile, "env.scenario.push_n=[0, 1e2]"])
    again = Settings.read(tomllib.loads(settings.to_toml()))
    assert again == settings


def test_settings_of_randomised_parameters_survive_being_written(config: Path) -> None:
    changes = [
        'env.scenario.randomise={"ground.slope_deg" = [-1, 1], "ground.friction" = {normal = [0.5, 0.05]}}',
        "env.scenario.variants=[{body = {trunk_mass_kg = 50.0}}]",
    ]
    settings = Settings.load(config, changes)
    assert settings.env["scenario"]["randomise"]["ground.friction"] == {"normal": [0.5, 0.05]}
    assert Settings.read(tomllib.loads(settings.to_toml())) == settings


def test_env_may_name_a_scenario_and_a_reward_that_other_keys_override(tmp_path: Path) -> None:
    path = tmp_path / "named.toml"
    path.write_text('[env]\nscenario = "pushes"\nreward = "safety"\n')
    settings = Settings.load(path, ["env.scenario.duration_s=4.0", "env.reward.energy=-0.5"])
    whole = merge(merge(load_scenario("pushes"), load_reward("safety")), {"reward": {"energy": -0.5}})
    assert settings.env == resolve(merge(whole, {"scenario": {"duration_s": 4.0}}))
    assert Settings.read(tomllib.loads(settings.to_toml())) == settings
    path.write_text(
        '[env.scenario]\npreset = "pushes"\nduration_s = 4.0\n[env.reward]\npreset = "safety"\nenergy = -0.5'
    )
    assert Settings.load(path).env == settings.env
    for text, message in (('scenario = "nowhere"', "'nowhere'"), ("reward.preset = 3", r"reward\.preset = 3")):
        path.write_text(f"[env]\n{text}\n")
        with pytest.raises(ValueError, match=message):
            Settings.load(path)


def test_a_curriculum_leads_from_its_first_difficulty_to_the_whole_scenario(config: Path, tmp_path: Path) -> None:
    changes = ["training.curriculum_steps=1024", "training.start_difficulty=0.2", "training.tensorboard=false"]
    trainer = Trainer(Settings.load(config, changes), tmp_path / "run", quiet=True)
    assert trainer.env.get_attr("difficulty", 0) == [0.2]
    seen: list[float] = []
    step = trainer.env.step_wait

    def step_wait() -> Any:  # noqa: ANN401 - what it wraps
        seen.append(trainer.env.get_attr("difficulty", 0)[0])
        return step()

    trainer.env.step_wait = step_wait  # type: ignore[method-assign]
    assert trainer.run() == 0
    trainer.close()
    # Rollouts of 512 env steps.
    assert seen[::32] == pytest.approx([0.2, 0.6, 1.0, 1.0])
    resumed = Trainer(Settings.load(config, changes), tmp_path / "run", resume=True, quiet=True)
    assert resumed.env.get_attr("difficulty", 0) == [1.0]


def test_without_a_curriculum_every_episode_is_at_full_difficulty(config: Path, tmp_path: Path) -> None:
    trainer = Trainer(Settings.load(config), tmp_path / "run", quiet=True)
    assert trainer.env.get_attr("difficulty", 0) == [1.0]


@pytest.mark.parametrize("path", sorted((ROOT / "configs" / "train").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_configurations_are_valid(path: Path) -> None:
    settings = Settings.load(path)
    assert settings.training.total_steps >= 1_000_000
    assert settings.training.torch_threads == 1
