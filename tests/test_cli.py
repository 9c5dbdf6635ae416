"""The command line: what it prints, writes, refuses and returns."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from policies import save_policy
from rich.console import Console

from prosthesis_gym import _core, progress
from prosthesis_gym.cli import main, new_parser, trial_options, walk
from prosthesis_gym.config import merge, resolve
from prosthesis_gym.plotting import plot_gait, plot_trial
from prosthesis_gym.policy import Normalisation, Policy
from prosthesis_gym.scenarios import load_scenario
from prosthesis_gym.trial import Trial, load_trial, run_trial

matplotlib_image = pytest.importorskip("matplotlib.image")
SHORT = ["walk", "--duration", "5"]


def assert_picture(path: Path) -> None:
    pixels = matplotlib_image.imread(path)[..., :3]
    assert min(pixels.shape[:2]) > 500
    painted = (pixels < 0.99).any(axis=-1)
    assert 0.02 < painted.mean() < 0.6
    # Every band of a tenth of the height holds something.
    assert all(band.any() for band in np.array_split(painted, 10))


def test_walk_prints_strides_and_outcome(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(SHORT) == 0
    output = capsys.readouterr()
    assert "walking after 5.00 s, 2 full strides" in output.out
    assert "stance" in output.out
    assert output.err == ""


def test_json_is_all_that_is_on_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*SHORT, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["outcome"] == "walking"
    assert [round(stride["heel_strike_s"], 2) for stride in content["strides"]] == [2.21, 3.36]


@pytest.mark.parametrize("name", ["trial.parquet", "trial.csv", "trial.png", "trial.svg", "trial.pdf"])
def test_files_are_written_and_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    path = tmp_path / name
    option = "--out" if path.suffix in (".parquet", ".csv") else "--plot"
    assert main([*SHORT, option, str(path)]) == 0
    written = path.read_bytes()
    assert written
    assert main([*SHORT, option, str(path)]) == 2
    assert f"{path} exists; --force overwrites it" in capsys.readouterr().err
    assert path.read_bytes() == written
    path.write_bytes(b"old")
    assert main([*SHORT, option, str(path), "--force"]) == 0
    assert path.stat().st_size > 3
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


def test_saved_trial_is_the_one_walked(tmp_path: Path) -> None:
    path = tmp_path / "trial.parquet"
    assert main([*SHORT, "--solver", "fast", "--set", "knee.spring_nm_rad=1.5", "--out", str(path)]) == 0
    trial = load_trial(path)
    assert trial.config["knee"]["spring_nm_rad"] == 1.5
    assert trial.config["solver"] == {"stepper": "two_stage_w", "steps": 0}
    assert trial.end_s == pytest.approx(5.0)


def test_scenario_brings_its_duration_and_options_override_it(tmp_path: Path) -> None:
    path = tmp_path / "trial.parquet"
    assert main(["walk", "--scenario", "start_stop", "--solver", "fast", "--out", str(path)]) == 0
    assert load_trial(path).end_s == pytest.approx(25.0)
    assert main(["walk", "--profile", "start_stop", "--duration", "2", "--out", str(path), "--force"]) == 0
    assert load_trial(path).end_s == pytest.approx(2.0)


def test_scenario_brings_every_section_in_place_of_the_commands_own_scenario(tmp_path: Path) -> None:
    scenario, path = tmp_path / "slope.toml", tmp_path / "trial.parquet"
    scenario.write_text('[scenario]\nstart = "cyclic"\nduration_s = 0.5\n[ground]\nslope_deg = -1.0\n')
    assert main(["walk", "--scenario", str(scenario), "--solver", "fast", "--out", str(path)]) == 0
    config = load_trial(path).config
    assert config["ground"]["slope_deg"] == -1.0
    assert config["scenario"] == resolve(load_scenario(scenario))["scenario"]
    assert config["scenario"]["push_n"] == [0.0, 300.0]


def test_configuration_file_lies_between_defaults_and_options(tmp_path: Path) -> None:
    config, path = tmp_path / "config.toml", tmp_path / "trial.parquet"
    config.write_text(
        '[scenario]\nduration_s = 2.0\nspeed_m_s = 1.3\n[solver]\nstepper = "linearly_implicit_euler"\nsteps = 5\n'
    )
    assert main(["walk", "--config", str(config), "--speed", "1.2", "--out", str(path)]) == 0
    trial = load_trial(path)
    assert trial.end_s == pytest.approx(2.0)
    assert trial["intended_speed_m_s"][-1] == 1.2
    assert trial.config["solver"]["steps"] == 5
    assert trial.config["scenario"]["push_n"] == 0.0


@pytest.mark.parametrize(("controller", "commands"), [("constant:7.5", {7.5}), ("constant:0", {0.0})])
def test_constant_controller(tmp_path: Path, controller: str, commands: set[float]) -> None:
    path = tmp_path / "trial.parquet"
    assert main(["walk", "--duration", "1", "--start", "cyclic", "--controller", controller, "--out", str(path)]) == 0
    assert set(load_trial(path)["command"][1:]) == commands


def test_policy_folder_controls_with_its_own_configuration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    size = len(_core.channels({}))
    layer = (np.zeros((size, 1), np.float32), np.full(1, 1.0, np.float32))
    config = {"action": {"mode": "direct", "max_command_nms2_rad2": 12.0}, "observation": {"frames": 1}}
    Policy([layer], Normalisation(np.zeros(size), np.ones(size)), config).save(tmp_path / "policy")
    path = tmp_path / "trial.parquet"
    assert main(["walk", "--duration", "1", "--controller", str(tmp_path / "policy"), "--out", str(path)]) == 0
    assert set(load_trial(path)["command"][1:]) == {12.0}
    assert main(["walk", "--controller", str(tmp_path / "policy"), "--set", "action.hold=2"]) == 2
    assert "--set action.hold=2" in capsys.readouterr().err


def test_policy_folder_brings_its_knee_and_contradicts_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    size = len(_core.channels({}))
    layer = (np.zeros((size, 1), np.float32), np.full(1, 1.0, np.float32))
    config = {"action": {"mode": "direct"}, "observation": {"frames": 1}}
    Policy([layer], Normalisation(np.zeros(size), np.ones(size)), config, "friction").save(tmp_path / "policy")
    path = tmp_path / "trial.parquet"
    arguments = ["walk", "--duration", "1", "--controller", str(tmp_path / "policy")]
    assert main([*arguments, "--out", str(path)]) == 0
    trial = load_trial(path)
    assert trial.config["device"]["kind"] == "friction"
    assert set(trial["command"][1:]) == {trial.config["friction_knee"]["max_friction_nm"]}
    assert main([*arguments, "--device", "friction"]) == 0
    for other in (["--device", "motor"], ["--set", "device.kind=damper"]):
        capsys.readouterr()
        assert main([*arguments, *other]) == 2
        assert "contradicts the policy, which was trained with 'friction'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "kind"),
    [
        (["--device", "friction"], "friction"),
        (["--set", "device.kind=motor"], "motor"),
        (["--config", "friction.toml"], "friction"),
        (["--config", "friction.toml", "--device", "motor"], "motor"),
    ],
)
def test_constant_command_is_that_of_the_knee_however_it_is_chosen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], kind: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("friction.toml").write_text('[device]\nkind = "friction"\n')
    assert main(["walk", "--duration", "0.1", "--controller", "constant:3", "--out", "t.parquet", *arguments]) == 0
    trial = load_trial("t.parquet")
    assert trial.config["device"]["kind"] == kind
    assert set(trial["command"][1:]) == {3.0}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--set", "knee.spring=1"], "knee.spring"),
        (["--set", "knee.spring_nm_rad=-1"], "knee.spring_nm_rad = -1"),
        (["--set", "knee"], "section.key=value"),
        (["--speed", "9"], "scenario.speed_m_s = 9"),
        (["--speed", "1.2", "--scenario", "steady"], "--scenario steady"),
        (["--duration", "nan"], "scenario.duration_s = NaN"),
        (["--profile", "nowhere"], "'nowhere'"),
        (["--controller", "magic"], "controller magic"),
        (["--controller", "constant:lots"], "'lots' is not a number"),
        (["--controller", "constant"], "controller constant"),
        (["--controller", "."], "no policy in ."),
        (["--config", "missing.toml"], "missing.toml"),
        (["--out", "trial.xlsx"], ".parquet or .csv"),
        (["--plot", "trial.bmp"], ".png, .pdf, .svg"),
        (["--seed", "-1"], "--seed = -1"),
    ],
)
def test_bad_input_is_one_clear_line_and_exit_code_2(
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*SHORT, *arguments]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.count("\n") == 1
    assert message in output.err
    assert not list(tmp_path.iterdir())


def test_interrupt_is_exit_code_130(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> Trial:
        raise KeyboardInterrupt

    monkeypatch.setattr(walk, "run_trial", interrupted)
    assert main(["walk"]) == 130


def test_missing_extra_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["walk", "--out", str(tmp_path / "trial.parquet")]) == 2
    assert "pip install 'prosthesis-gym[plot]'" in capsys.readouterr().err


def test_slow_simulations_show_a_bar_on_standard_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "_PATIENCE_S", 0.0)
    monkeypatch.setattr(progress, "Console", lambda **_: Console(file=sys.stderr, force_terminal=True))
    assert main([*SHORT, "--json"]) == 0
    output = capsys.readouterr()
    assert "simulating" in output.err
    assert json.loads(output.out)["outcome"] == "walking"


def test_closed_pipe_is_no_error() -> None:
    """As in `prosthesis-gym parameters | head -1`."""
    code = "import sys; from prosthesis_gym.cli import main; sys.exit(main(['parameters', '--json']))"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.wait(60) == 0
    assert process.stderr.read() == b""
    process.stderr.close()


def test_parameters_lists_every_key_with_its_range(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["parameters"]) == 0
    output = capsys.readouterr().out
    assert all(f"{row['key']} = {row['default']}" in output for row in _core.parameters())


def test_parameters_are_filtered_by_every_word(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["parameters", "motor.", "SPRING", "--json"]) == 0
    assert [row["key"] for row in json.loads(capsys.readouterr().out)] == ["motor.spring_nm_rad"]
    assert main(["parameters", "no_such_word"]) == 2
    assert "no_such_word" in capsys.readouterr().err


def test_bench_measures_every_size(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["bench", "--walkers", "1", "16", "--threads", "1", "--seconds", "0.05"]
    assert main([*arguments, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert set(content["machine"]) == {"cpu", "cores", "date"}
    assert 0.5 < content["kib_per_walker"] < 16.0
    settings = [(device, walkers) for device in ("damper", "motor") for walkers in (1, 16)]
    for result, (device, walkers) in zip(content["results"], settings, strict=True):
        assert (result["device"], result["walkers"], result["threads"]) == (device, walkers, 1)
        assert result["simulated_s_per_s"] == pytest.approx(0.005 * result["env_steps_per_s"])
        assert result["env_steps_per_s"] == pytest.approx(walkers * 1e6 / result["us_per_call"])
    assert main(arguments) == 0
    assert "memory per walker" in capsys.readouterr().out


def test_bench_says_which_peers_are_not_installed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("mujoco", "mujoco.rollout", "imageio", "envpool"):
        monkeypatch.setitem(sys.modules, module, None)
    arguments = ["bench", "--walkers", "1", "--devices", "damper", "--seconds", "0.01", "--peers"]
    assert main(arguments) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "not measured: MuJoCo rollout, the same mechanism, 0.5 ms: mujoco is not installed" in printed
    assert "get it with: pip install 'prosthesis-gym[dev]'" in printed
    assert "get it with: pip install envpool" in printed


def test_mean_powers_of_a_knee_without_a_motor_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["walk", "--window", "1", "2"]) == 2
    assert "--window is for a motor knee, and this one is 'damper'" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["--seconds", "0"], ["--threads", "0"], ["--walkers", "0"], ["--walkers", "-1"]])
def test_bench_refuses_impossible_arguments(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--seconds", "0.05", *arguments]) == 2
    assert capsys.readouterr().err.startswith("prosthesis-gym: error: ")


@pytest.mark.parametrize("command", [[], ["walk"], ["render"], ["bodies"], ["accuracy"], ["bench"], ["parameters"]])
def test_help_ends_with_examples(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([*command, "--help"])
    assert stopped.value.code == 0
    assert "examples:\n  prosthesis-gym " in capsys.readouterr().out


def examples_of_help(command: str, capsys: pytest.CaptureFixture[str]) -> list[list[str]]:
    with pytest.raises(SystemExit):
        main([command, "--help"])
    lines = capsys.readouterr().out.partition("examples:\n")[2].splitlines()
    # Without what is said about them, and without a shell's redirection.
    commands = [re.split(r"\s{3,}|\s>", line.strip())[0] for line in lines if line.startswith("  prosthesis-gym ")]
    return [shlex.split(line)[1:] for line in commands]


@pytest.mark.parametrize("command", ["walk", "render"])
def test_examples_of_help_are_possible(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my_speeds.csv").write_text("time_s,speed_m_s,walk\n0,1.1,0\n1,1.1,1\n")
    save_policy(tmp_path / "runs/damper_ppo/policy")
    examples = examples_of_help(command, capsys)
    assert len(examples) >= 6
    for arguments in examples:
        config, _ = trial_options.configure(new_parser().parse_args(arguments))
        assert resolve(config) == config


@pytest.mark.parametrize("command", ["scenarios", "bodies", "accuracy", "bench", "torture", "parameters"])
def test_examples_of_other_helps_parse(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in examples_of_help(command, capsys):
        assert callable(new_parser().parse_args(arguments).run)


@pytest.fixture(scope="module")
def trial() -> Trial:
    return run_trial(trial_options.DEFAULTS, duration_s=12.0)


def test_trial_figure_is_not_blank(trial: Trial, tmp_path: Path) -> None:
    plot_trial(trial, tmp_path / "trial.png")
    assert_picture(tmp_path / "trial.png")


@pytest.mark.parametrize("window", [(0.0, 0.0), (-1.0, 5.0), (12.0, 20.0), (5.0, float("nan"))])
def test_window_outside_the_trial_is_refused(trial: Trial, tmp_path: Path, window: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="window = "):
        plot_trial(trial, tmp_path / "trial.png", window)
    assert not list(tmp_path.iterdir())


def test_gait_figure_compares_controllers(trial: Trial, tmp_path: Path) -> None:
    other = run_trial(merge(trial_options.DEFAULTS, {"knee": {"spring_nm_rad": 1.5}}), duration_s=12.0)
    plot_gait({"spring 2 N m/rad": trial, "spring 1.5 N m/rad": other}, tmp_path / "gait.png")
    assert_picture(tmp_path / "gait.png")


def test_gait_figure_needs_steady_strides(tmp_path: Path) -> None:
    short = run_trial(trial_options.DEFAULTS, duration_s=3.0)
    with pytest.raises(ValueError, match=r"'short'.* no steady stride"):
        plot_gait({"short": short}, tmp_path / "gait.png")
    with pytest.raises(ValueError, match="trials: 0 of them"):
        plot_gait({}, tmp_path / "gait.png")
    assert not list(tmp_path.iterdir())


def test_figure_of_a_fall(tmp_path: Path) -> None:
    fall = run_trial(merge(trial_options.DEFAULTS, {"scenario": {"speed_m_s": 0.5}}), duration_s=12.0)
    assert fall.fell
    plot_trial(fall, tmp_path / "fall.png")
    assert_picture(tmp_path / "fall.png")
