"""The folder of a training run: one process at a time, and a way to go on from whatever stopped the last one."""

import csv
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console
from rich.progress import Progress

from prosthesis_gym.policy import Policy
from training.callbacks import progress_columns
from training.train import main

ROOT = Path(__file__).parents[1]
TINY = """
[env]
num_envs = 16
[env.action]
mode = "residual"
hold = 4
[env.scenario]
duration_s = 2.0
[ppo]
n_steps = 32
batch_size = 256
n_epochs = 1
[policy]
hidden = [8]
[training]
total_steps = 1024
eval_every_steps = 512
eval_episodes = 8
final_episodes = 8
checkpoint_every_steps = 512
tensorboard = false
"""
UNLIMITED = "import sys; from training.train import main; sys.exit(main(sys.argv[1:]))"
LIMITED = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit})); " + UNLIMITED
ENDLESS = ["--set", "training.total_steps=100000000"]


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


def train(*arguments: str, limit_bytes: int | None = None) -> "subprocess.Popen[str]":
    """Start a training process, which may be forbidden to write files larger than a limit: a full disk to it."""
    program = LIMITED.format(limit=limit_bytes) if limit_bytes else UNLIMITED
    command = [sys.executable, "-c", program, "--quiet", *arguments]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_until(condition: Callable[[], bool], process: "subprocess.Popen[str]") -> None:
    deadline = time.monotonic() + 120.0
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)


def checkpoints(folder: Path) -> list[int]:
    return sorted(int(path.name) for path in (folder / "checkpoints").iterdir())


def steps(folder: Path) -> list[str]:
    with (folder / "evaluation.csv").open(newline="") as file:
        return [row["steps"] for row in csv.DictReader(file)]


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_second_training_is_refused_and_told_who_trains(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    never = ["--set", "training.checkpoint_every_steps=100000000", "--set", "training.eval_every_steps=100000000"]
    process = train(str(config), "--out", str(folder), *ENDLESS, *never)
    try:
        wait_until((folder / "config.toml").exists, process)
        before = files(folder)
        for arguments in ([str(config), "--out", str(folder)], ["--resume", str(folder)]):
            assert main([*arguments, "--quiet"]) == 2
            assert f"{folder} is in use: process {process.pid} on " in capsys.readouterr().err
        assert main([str(config), "--out", str(folder), *ENDLESS, *never, "--go-on", "--quiet"]) == 2
        assert files(folder) == before
    finally:
        process.kill()
        process.communicate()
    # Killed before its first checkpoint: what it left, its lock's files too, keeps nobody from starting again.
    assert (folder / "trainer.json").exists()
    assert main([str(config), "--out", str(folder), "--quiet"]) == 0
    assert "starting again" in capsys.readouterr().err
    assert checkpoints(folder) == [512, 1024]
    assert not (folder / "trainer.json").exists()


@pytest.mark.parametrize("command", ["start", "resume", "go on"])
def test_a_run_without_a_checkpoint_starts_again_and_mixes_nothing(
    config: Path, tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, untouched = tmp_path / "run", tmp_path / "untouched"
    assert main([str(config), "--out", str(untouched), "--quiet"]) == 0
    # Killed in the middle of its first checkpoint, after an evaluation.
    assert main([str(config), "--out", str(folder), "--quiet"]) == 0
    for entry in (folder / "checkpoints").iterdir():
        entry.rename(entry.with_name(f".{entry.name}-x2"))
    (folder / ".evaluation-x2.csv").write_text("steps")
    arguments = {
        "start": [str(config), "--out", str(folder)],
        "resume": ["--resume", str(folder)],
        "go on": [str(config), "--out", str(folder), "--go-on"],
    }
    capsys.readouterr()
    assert main([*arguments[command], "--quiet"]) == 0
    assert "starting again" in capsys.readouterr().err
    assert steps(folder) == ["512", "1024"]
    assert not list(folder.rglob(".*")), "temporary files are left"
    # What an earlier run found out is not lost.
    assert steps(folder / "unfinished-1") == ["512", "1024"]
    assert (folder / "policy/policy.safetensors").read_bytes() == (untouched / "policy/policy.safetensors").read_bytes()


def test_the_newest_whole_checkpoint_is_gone_on_from(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    assert main([str(config), "--out", str(folder), "--quiet"]) == 0
    model = folder / "checkpoints/000000001024/model.zip"
    model.write_bytes(model.read_bytes()[:-100])
    capsys.readouterr()
    assert main(["--resume", str(folder), "--quiet"]) == 0
    told = capsys.readouterr().err
    assert "skipping the damaged checkpoint" in told
    assert "model.zip is not what was written" in told
    # Trained once more from 512, the damaged one is replaced.
    assert json.loads((folder / "checkpoints/000000001024/progress.json").read_text())["resumptions"] == 1
    assert main(["--resume", str(folder), "--quiet"]) == 0
    assert "damaged" not in capsys.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="limits on files are a matter of POSIX")
def test_a_full_disk_is_named_and_loses_nothing(config: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert main([str(config), "--out", str(folder), "--quiet"]) == 0
    before = files(folder / "checkpoints") | files(folder / "policy")
    more = ["--set", "training.total_steps=2048", "--set", "training.eval_every_steps=100000"]
    process = train("--resume", str(folder), *more, limit_bytes=2500)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 2
    assert f"'{folder / 'checkpoints/000000001536'}'" in errors
    assert f"--resume {folder}" in errors
    assert "Traceback" not in errors
    assert files(folder / "checkpoints") | files(folder / "policy") == before
    assert not list(folder.rglob(".*")), "temporary files are left"
    assert main(["--resume", str(folder), *more, "--quiet"]) == 0
    assert checkpoints(folder) == [512, 1024, 1536, 2048]


def test_going_on_takes_the_same_run_or_a_new_folder(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    arguments = [str(config), "--out", str(folder), "--go-on"]
    assert main(arguments) == 0
    table = capsys.readouterr().out
    before = files(folder / "checkpoints") | {"": (folder / "evaluation.csv").read_bytes()}
    assert main(arguments) == 0
    again = capsys.readouterr().out
    assert table[table.index("Held-out") :] == again[again.index("Held-out") :]
    assert files(folder / "checkpoints") | {"": (folder / "evaluation.csv").read_bytes()} == before
    other = [*arguments, "--set", "ppo.gamma=0.9", "--quiet"]
    assert main(other) == 0
    assert main(other) == 0
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_dir()) == ["run", "run-2"]
    assert Policy.load(tmp_path / "run-2").layer_sizes == Policy.load(folder).layer_sizes


def test_folders_of_others_are_left_alone(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis/chapter.tex").write_text("x")
    assert main([str(config), "--out", str(tmp_path / "thesis"), "--quiet"]) == 2
    assert "exists, and is not empty" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "thesis").iterdir()] == ["chapter.tex"]
    (tmp_path / "empty").mkdir()
    assert main([str(config), "--out", str(tmp_path / "empty"), "--quiet"]) == 0


def test_the_choice_of_the_best_policy_is_the_same_in_every_run(config: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert main([str(config), "--out", str(tmp_path / name), "--quiet"]) == 0
    tables = []
    for name in ("a", "b"):
        with (tmp_path / name / "evaluation.csv").open(newline="") as file:
            tables.append([{**row, "seconds": ""} for row in csv.DictReader(file)])
    assert tables[0] == tables[1]
    assert files(tmp_path / "a/policy") == files(tmp_path / "b/policy")


def test_the_shipped_runs_end_by_their_steps_not_by_the_clock() -> None:
    for path in (ROOT / "configs/train").glob("*.toml"):
        assert "\nseconds" not in path.read_text(encoding="utf-8"), path.name


@pytest.mark.parametrize("total", [6_000_000, 1_000_000_000])
def test_the_numbers_of_the_bar_are_whole_at_80_columns(total: int) -> None:
    text = StringIO()
    console = Console(file=text, width=80, force_terminal=True, color_system=None)
    with Progress(*progress_columns(), console=console, expand=True) as bar:
        bar.add_task("training", total=total, completed=32_768, status="152,345/s, 33% fall")
    assert f"32,768 of {total:,} 152,345/s, 33% fall" in text.getvalue()
    assert "…" not in text.getvalue()
