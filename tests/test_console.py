"""No output of ours dies of a character, whatever the terminal can show."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from policies import save_policy

from prosthesis_gym.cli import main
from prosthesis_gym.console import spell_what_cannot_be_encoded

ROOT = Path(__file__).parents[1]
ENCODINGS = ["ascii", "cp932", "cp437"]
COMMANDS = ["walk", "render", "scenarios", "bodies", "accuracy", "bench", "torture", "parameters"]


def run(encoding: str, *arguments: str, folder: Path = ROOT) -> subprocess.CompletedProcess[bytes]:
    environment = os.environ | {"PYTHONIOENCODING": encoding, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, timeout=300, check=False)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_helps_tables_and_errors_are_printed_on_any_console(encoding: str, tmp_path: Path) -> None:
    """All commands in one process, which must have the encoding from its start."""
    save_policy(tmp_path / "naïve ² policy")
    calls = [[command, "--help"] for command in COMMANDS]
    calls += [
        ["--help"],
        ["parameters"],
        ["scenarios"],
        ["scenarios", "steady", "--episodes", "4"],
        ["walk", "--duration", "6", "--solver", "fast"],
        ["walk", "--duration", "1", "--controller", "naïve ² policy"],
        ["walk", "--controller", "ohne µ"],
        ["walk", "--set", "knee.spring_nm_rad=²"],
        ["walk", "--device", "motor", "--duration", "4", "--window", "1", "2"],
        ["bodies", "--mass", "75", "--height", "1.77", "--duration", "1", "--solver", "fast"],
        ["accuracy", "--episodes", "0", "--devices", "friction", "--speeds", "0.3"],
        ["torture", "--steps", "1000", "--walkers", "16"],
        ["bench", "--walkers", "1", "--devices", "damper", "--seconds", "0.01"],
    ]
    program = (
        "import json, sys\nfrom prosthesis_gym.cli import main\n"
        "for call in json.loads(sys.argv[1]):\n"
        "    try: main(call)\n"
        "    except SystemExit as stopped: assert not stopped.code, (call, stopped)\n"
    )
    result = run(encoding, "-c", program, json.dumps(calls), folder=tmp_path)
    assert result.returncode == 0, result.stderr.decode(encoding, "replace")[-2000:]
    printed = result.stdout.decode(encoding)
    assert "full strides" in printed
    assert "N m s^2/rad^2" in printed


@pytest.mark.parametrize("example", ["evaluate.py", "write_a_controller.py", "train_ppo_cleanrl.py"])
def test_examples_help_on_any_console(example: str) -> None:
    result = run("ascii", str(ROOT / "examples" / example), "--help")
    assert result.returncode == 0, result.stderr.decode()


def test_training_talks_on_any_console(tmp_path: Path) -> None:
    result = run("ascii", "-m", "training.train", "--help")
    assert result.returncode == 0, result.stderr.decode()
    (tmp_path / "²").mkdir()
    result = run("ascii", "-m", "training.train", str(tmp_path / "²" / "none.toml"))
    assert result.returncode == 2
    assert b"Traceback" not in result.stderr


def test_characters_are_spelt_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    content = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(content, encoding="ascii"))
    spell_what_cannot_be_encoded()
    print("5 N m s²/rad², ±3°, 20 µs, naïve – 中 ─│┼\udc80")
    sys.stdout.flush()
    assert content.getvalue() == b"5 N m s^2/rad^2, +-3deg, 20 us, naive - ? -|+?\n"


def test_version_and_module_are_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["--version"])
    assert stopped.value.code == 0
    version = capsys.readouterr().out
    assert version.startswith("prosthesis-gym 0.")
    module = run("utf-8", "-m", "prosthesis_gym", "--version")
    assert (module.returncode, module.stdout.decode()) == (0, version)
    assert run("utf-8", "-m", "prosthesis_gym", "walk", "--duration", "x").returncode == 2
