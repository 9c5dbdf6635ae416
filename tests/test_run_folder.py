"""The folder of a training run: one process at a time, and a way to go on from whatever stopped the last one."""

import contextlib
import csv
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from io import StringIO
from pathlib import Path

import pytest
from filelock import FileLock
from rich.console import Console
from rich.progress import Progress

from prosthesis_gym.files import atomic_write
from prosthesis_gym.policy import Policy
from training.callbacks import progress_columns
from training.checkpoint import latest_checkpoint
from training.run_folder import RunFolder
from training.settings import Settings
from training.train import main
from training.trainer import Trainer

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


def temporary_of(path: Path) -> Path:
    """Return a name that `path` has while it is being written, as a kill leaves it."""
    with contextlib.suppress(KeyboardInterrupt), atomic_write(path) as temporary:
        raise KeyboardInterrupt
    return temporary


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
        entry.rename(temporary_of(entry))
    temporary_of(folder / "evaluation.csv").write_text("steps")
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


def test_no_more_checkpoints_are_read_than_the_newest_whole_one_needs(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "run"
    assert main([str(config), "--out", str(folder), "--set", "training.total_steps=2048", "--quiet"]) == 0
    newest = sorted((folder / "checkpoints").iterdir())[::-1]
    assert len(newest) == 4
    (newest[0] / "model.zip").write_bytes(b"")
    read: list[Path] = []
    read_bytes = Path.read_bytes

    def recorded(path: Path) -> bytes:
        read.append(path)
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", recorded)
    told: list[str] = []
    assert latest_checkpoint(folder / "checkpoints", told.append) == newest[1]
    assert {path.parent for path in read} == set(newest[:2])
    assert told == [f"skipping the damaged checkpoint {newest[0]}: model.zip is not what was written"]


@pytest.mark.skipif(os.name == "nt", reason="a full disk is imitated by RLIMIT_FSIZE, which Windows lacks")
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


@pytest.mark.parametrize("command", ["start", "resume", "go on"])
@pytest.mark.parametrize(
    "names",
    [
        ["chapter.tex"],
        ["config.toml"],
        ["config.toml", ".git/HEAD", ".env", "src/main.py"],
        ["config.toml", ".git/HEAD", "checkpoints/.hidden", "checkpoints/best/model.zip", "policy/.env"],
        ["trainer.json", "unfinished-1/config.toml", ".hidden/x"],
    ],
    ids=" ".join,
)
def test_folders_of_others_are_left_alone(
    config: Path, tmp_path: Path, names: list[str], command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "thesis"
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        # Settings of a training, as far as it is no more than their file.
        (folder / name).write_text(TINY)
    before = files(folder)
    arguments = {
        "start": [str(config), "--out", str(folder)],
        "resume": [str(config), "--resume", str(folder)],
        "go on": [str(config), "--out", str(folder), "--go-on"],
    }
    # A refusal must not make the folder a run's.
    for _ in range(2):
        assert main([*arguments[command], "--quiet"]) == 2
        expected = "nothing to resume" if command == "resume" else "exists, and is not empty"
        assert f"{folder}" in (told := capsys.readouterr().err)
        assert expected in told
        assert files(folder) == before
    assert [path.name for path in tmp_path.iterdir() if path.is_dir()] == ["thesis"]


def test_what_a_user_put_into_a_run_stays_where_it_is(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    assert main([str(config), "--out", str(folder), "--set", "training.tensorboard=true", "--quiet"]) == 0
    left = {path.name for path in folder.iterdir()}
    shutil.rmtree(folder / "checkpoints")
    for name in ("notes.md", ".git/HEAD", ".env", "policy/.env", "unfinished-1/notes.md", "mine/a.csv"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("mine")
    assert main([str(config), "--out", str(folder), "--quiet"]) == 0
    assert f"what was there is in {folder / 'unfinished-2'}" in capsys.readouterr().err
    # All that a run leaves but the mark of a run, and nothing else, goes aside.
    assert {path.name for path in (folder / "unfinished-2").iterdir()} == left - {"run.lock", "checkpoints"}
    mine = {name for name, content in files(folder).items() if content == b"mine"}
    assert mine == {"notes.md", ".git/HEAD", ".env", "unfinished-2/policy/.env", "unfinished-1/notes.md", "mine/a.csv"}


def test_what_was_being_written_is_removed_from_a_run_and_no_other_hidden_file(config: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert main([str(config), "--out", str(folder), "--quiet"]) == 0
    partial, mine = [], []
    for place in (folder, folder / "checkpoints", folder / "policy"):
        partial += [temporary_of(place / "a.csv"), temporary_of(place / "b")]
        partial[-2].write_text("half")
        (partial[-1] / "c").mkdir(parents=True)
        mine += [place / ".env", place / ".a-x2.csv"]
        for path in mine[-2:]:
            path.write_text("mine")
    assert main(["--resume", str(folder), "--quiet"]) == 0
    assert not any(path.exists() for path in partial)
    assert all(path.read_text() == "mine" for path in mine)


def test_runs_from_before_the_lock_are_gone_on_with(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    assert main([str(config), "--out", str(folder), "--quiet"]) == 0
    for arguments in (["--resume", str(folder)], [str(config), "--out", str(folder), "--go-on"]):
        (folder / "run.lock").unlink()
        assert main([*arguments, "--quiet"]) == 0
    (folder / "run.lock").unlink()
    capsys.readouterr()
    assert main([str(config), "--out", str(folder), "--quiet"]) == 2
    assert f"resume it with --resume {folder}" in capsys.readouterr().err
    assert checkpoints(folder) == [512, 1024]


def test_a_second_trainer_of_the_same_process_is_refused_too(config: Path, tmp_path: Path) -> None:
    settings, folder = Settings.load(config), tmp_path / "run"
    first = Trainer(settings, folder, quiet=True)
    for resume in (False, True):
        with pytest.raises(ValueError, match=f"is in use: process {os.getpid()} on "):
            Trainer(settings, folder, resume=resume, quiet=True)
    assert json.loads((folder / "trainer.json").read_text())["pid"] == os.getpid()
    first.close()
    with contextlib.closing(Trainer(settings, folder, quiet=True)):
        # One that is closed already takes nothing from the next.
        first.close()
        assert (folder / "trainer.json").exists()
        with pytest.raises(ValueError, match="is in use"):
            RunFolder(folder)


def test_a_folder_that_cannot_be_written_to_is_not_held(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    RunFolder(folder).release()
    # The name of the owner's file is taken by a folder.
    (folder / "trainer.json").mkdir()
    with pytest.raises(OSError, match=r"trainer\.json") as caught:
        RunFolder(folder)
    with FileLock(folder / "run.lock", timeout=0):
        # What was raised has kept alive all that was being made.
        assert caught.tb is not None


def test_an_empty_folder_becomes_a_run_s(config: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert main([str(config), "--out", str(tmp_path / "empty"), "--quiet"]) == 0


def test_going_on_asks_what_is_trained_not_for_how_long_or_by_how_many_threads(config: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    # A limit that is over before the first rollout is.
    arguments = [str(config), "--out", str(folder), "--go-on", "--quiet"]
    assert main([*arguments, "--set", "training.total_steps=100000", "--seconds", "0.1"]) == 0
    stopped = checkpoints(folder)[-1]
    assert stopped < 100_000
    same = ["--set", "training.total_steps=100_000", "--set", "ppo.gamma=0.99", "--seconds", "0.2"]
    threads = ["--set", "training.env_threads=1", "--set", "training.torch_threads=2"]
    assert main([*arguments, *same, *threads]) == 0
    assert checkpoints(folder)[-1] > stopped
    assert [path.name for path in tmp_path.iterdir() if path.is_dir()] == ["run"]
    # What another version wrote is another run.
    (folder / "config.toml").write_text("[ppo]\ngama = 0.9\n")
    assert main(arguments) == 0
    assert checkpoints(tmp_path / "run-2") == [512, 1024]


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
