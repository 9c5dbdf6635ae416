"""What users give is read in any form that editors write, and what is written for them is whole or not there."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest
from policies import save_policy

from prosthesis_gym import ProsthesisVectorEnv
from prosthesis_gym.bodies import scaled_body
from prosthesis_gym.config import load_config, resolve
from prosthesis_gym.evaluation import evaluate
from prosthesis_gym.files import atomic_folder, atomic_write, is_temporary, read_json
from prosthesis_gym.policy import Policy
from prosthesis_gym.rewards import load_reward
from prosthesis_gym.scenarios import load_scenario
from prosthesis_gym.trial import run_trial
from training.settings import Settings

TOML = {
    load_config: "[knee]\nspring_nm_rad = 1.0\n",
    load_scenario: "[scenario]\nspeed_m_s = 1.0\n",
    load_reward: "[reward]\nfall = -3.0\n",
    Settings.load: "[training]\nseed = 3\n",
}
CSV = "time_s,speed_m_s,walk\n0,1.1,0\n1,1.1,1\n"


@pytest.mark.parametrize("reader", TOML, ids=lambda reader: reader.__qualname__)
def test_every_reader_of_toml_takes_a_byte_order_mark_and_names_what_it_cannot_read(
    reader: object, tmp_path: Path
) -> None:
    assert callable(reader)
    text, path = TOML[reader], tmp_path / "file.toml"  # type: ignore[index]
    path.write_bytes(text.encode())
    expected = reader(path)
    path.write_bytes(text.encode("utf-8-sig").replace(b"\n", b"\r\n"))
    assert reader(path) == expected
    for encoding in ("utf-16", "utf-16-le", "utf-16-be", "utf-32"):
        path.write_bytes(text.encode(encoding))
        with pytest.raises(ValueError, match=r"file\.toml: looks like UTF-16 or UTF-32, .*with the encoding UTF-8"):
            reader(path)
    path.write_bytes((text + "# 5\u00b0").encode("latin-1"))
    with pytest.raises(ValueError, match=r"file\.toml, line 3: byte 0xb0 is not UTF-8: save the file"):
        reader(path)
    path.write_text(text + "oops\n")
    with pytest.raises(ValueError, match=r"file\.toml: .*line 3"):
        reader(path)


def test_speeds_in_csv_too(tmp_path: Path) -> None:
    path = tmp_path / "speeds.csv"
    path.write_bytes(CSV.encode())
    expected = load_scenario(path)
    path.write_bytes(CSV.encode("utf-8-sig"))
    assert load_scenario(path) == expected
    path.write_bytes(CSV.encode("utf-16"))
    with pytest.raises(ValueError, match=r"speeds\.csv: looks like UTF-16"):
        load_scenario(path)


def test_a_policy_is_found_where_a_run_keeps_it_and_what_is_wrong_with_it_is_placed(tmp_path: Path) -> None:
    run = tmp_path / "damper_ppo"
    save_policy(run / "policy")
    path = run / "policy/policy.json"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert Policy.load(run).config == Policy.load(run / "policy").config
    path.write_text('{\n  "format": 1,\n  oops\n}')
    with pytest.raises(ValueError, match=r"policy/policy\.json: no JSON: .*line 3 column 3"):
        Policy.load(run)
    path.write_text("[1]")
    with pytest.raises(ValueError, match=r"policy\.json, line 1: .* must hold an object"):
        Policy.load(run)
    (run / "policy").rename(run / "elsewhere")
    with pytest.raises(
        ValueError, match=r"no policy in .*damper_ppo: neither it nor its folder 'policy' has a policy.json"
    ):
        Policy.load(run)


@pytest.mark.parametrize(
    "given",
    [
        {"scenario": {"speed_m_s": np.float32(1.25)}},
        {"scenario": {"speed_m_s": np.array(1.25)}},
        {"scenario": {"speed_m_s": np.array([1.25, 1.5])}},
        {"scenario": {"speed_m_s": (np.float64(1.25), np.float16(1.5))}},
        {"scenario": {"speed_m_s": {"choice": np.array([1.25, 1.5], dtype=np.float32)}}},
        {"action": {"hold": np.uint8(4)}},
        {"state_machine": {"recovery": np.False_}},
        {"observation": {"groups": np.array(["knee", "load"])}},
        {"scenario": {"randomise": {"ground.slope_deg": np.array([-1.5, 1.5])}}},
        {"scenario": {"variants": np.array([{"ground": {"slope_deg": np.float32(0.5)}}])}},
        {"scenario": {"profile": ({"time_s": np.int64(0), "speed_m_s": np.float32(1.25), "walk": np.True_},)}},
    ],
)
def test_a_configuration_may_hold_what_numpy_has(given: dict[str, object]) -> None:
    plain = json.loads(json.dumps(given, default=lambda value: value.tolist()))
    assert resolve(given) == resolve(plain)
    assert load_config(given) == plain
    assert ProsthesisVectorEnv(2, given).config == resolve(plain)
    assert evaluate(None, given, episodes=2, threads=1) == evaluate(None, plain, episodes=2, threads=1)
    assert run_trial(given, duration_s=0.1).config == run_trial(plain, duration_s=0.1).config


def test_keys_that_are_no_names_are_named() -> None:
    with pytest.raises(ValueError, match=r"scenario: key 3 must be a name"):
        resolve({"scenario": {3: 1.0}})
    with pytest.raises(ValueError, match=r"mass_kg = heavy must be a number"):
        scaled_body("heavy")  # type: ignore[arg-type]


def test_an_older_file_stays_until_the_new_one_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(TypeError), atomic_write(path) as temporary:
        temporary.write_bytes(b"half" + temporary)  # type: ignore[operator]
    assert path.read_text() == "old"
    with atomic_write(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    with pytest.raises(IsADirectoryError), atomic_folder(tmp_path / "b") as folder:
        folder.write_text("half")
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("name", ["v1", "v1.2", ".v1", "v1.tar.gz"])
@pytest.mark.parametrize("writer", [atomic_write, atomic_folder])
def test_an_error_names_what_was_wanted_not_the_temporary(
    writer: Callable[[Path], AbstractContextManager[Path]], name: str, tmp_path: Path
) -> None:
    target = tmp_path / "runs.d" / name
    with pytest.raises(OSError, match=re.escape(f"'{target}'")) as caught, writer(target) as temporary:
        # Where a file is, there is no folder; and the other way round.
        (temporary / "part" / "file").read_bytes()
    assert caught.value.filename == str(target)
    assert not list(target.parent.iterdir())
    target.mkdir()
    (target / "part").touch()
    with pytest.raises(OSError, match=re.escape(f"'{target}'")) as caught, writer(target):
        pass
    assert caught.value.filename == str(target)
    # A file of the user's own that is missing keeps its name.
    other = tmp_path / f".{name}-mine"
    with pytest.raises(FileNotFoundError) as caught, writer(tmp_path / name):
        other.read_bytes()
    assert caught.value.filename == str(other)


def test_temporaries_are_told_from_the_files_of_users(tmp_path: Path) -> None:
    with atomic_write(tmp_path / "a.csv") as file, atomic_folder(tmp_path / "b.d") as folder:
        assert is_temporary(file)
        assert is_temporary(folder)
        # Writers choose their format by it.
        assert file.suffix == ".csv"
    for name in ("a.csv", ".git", ".env", ".a-x2.csv", "prosthesis_gym", ".prosthesis_gym"):
        assert not is_temporary(tmp_path / name)


@pytest.mark.parametrize("reader", TOML, ids=lambda reader: reader.__qualname__)
@pytest.mark.parametrize("nested", ["[" * 5000, "{a = " * 5000])
def test_toml_that_is_nested_too_deeply_is_named(reader: Callable[[Path], object], nested: str, tmp_path: Path) -> None:
    path = tmp_path / "deep.toml"
    path.write_text(f"a = {nested}")
    with pytest.raises(ValueError, match=r"deep\.toml: .* nested too deeply"):
        reader(path)


def test_json_that_is_nested_too_deeply_is_named(tmp_path: Path) -> None:
    path = tmp_path / "deep.json"
    path.write_text('{"a":' * 200_000)
    with pytest.raises(ValueError, match=r"deep\.json: .* nested too deeply"):
        read_json(path)


@pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="tells which file is synced by /proc/self/fd, which only Linux has"
)
def test_content_is_on_the_disk_before_its_name_and_the_name_before_the_return(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    sync, rename = os.fsync, os.rename

    def fsync(handle: int) -> None:
        calls.append(f"sync {Path(f'/proc/self/fd/{handle}').readlink().name}")
        sync(handle)

    def replace(old: Path, new: Path) -> None:
        calls.append("rename")
        rename(old, new)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(os, "replace", replace)
    with atomic_write(tmp_path / "a.txt") as temporary:
        temporary.write_text("x")
    assert calls == [f"sync {temporary.name}", "rename", f"sync {tmp_path.name}"]
    calls.clear()
    with atomic_folder(tmp_path / "b") as folder:
        (folder / "part").write_text("x")
    assert calls == ["sync part", f"sync {folder.name}", "rename", f"sync {tmp_path.name}"]


@pytest.mark.parametrize(
    "file", ["walk.csv", "walk.parquet", "walk.png", "walk.pdf", "clip.mp4", "clip.gif", "one.png"]
)
def test_a_full_disk_is_told_with_the_file_and_leaves_nothing(file: str, tmp_path: Path) -> None:
    """Files of more than 200 bytes are forbidden, which to whoever writes them is a full disk."""
    option = {"walk": ["walk", "--plot" if file.endswith(("png", "pdf")) else "--out"], "clip": ["render", "--out"]}
    command = option.get(file.partition(".")[0], ["render", "--at", "1", "--out"])
    program = (
        "import resource, sys, matplotlib.font_manager; resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200));"
        "from prosthesis_gym.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    arguments = [*command, str(tmp_path / file), "--duration", "2", "--solver", "fast"]
    result = subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, text=True, timeout=120, check=False
    )
    assert result.returncode == 2, result.stderr
    assert str(tmp_path / file) in result.stderr
    assert "Traceback" not in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_policy_can_be_loaded_wherever_saving_another_was_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    observations = np.ones((1, 8), dtype=np.float32)
    old, new = (save_policy(tmp_path / name, gain).act(observations) for name, gain in (("old", 0.1), ("new", 0.02)))
    replace, outcomes = Path.replace, set()
    for survived in range(20):
        save_policy(tmp_path / "policy", 0.1)
        renames = 0

        def interrupted(path: Path, target: Path, survived: int = survived) -> Path:
            nonlocal renames
            renames += 1
            if renames > survived:
                raise KeyboardInterrupt
            return replace(path, target)

        monkeypatch.setattr(Path, "replace", interrupted)
        try:
            save_policy(tmp_path / "policy", 0.02)
        except KeyboardInterrupt:
            finished = False
        else:
            finished = True
        monkeypatch.setattr(Path, "replace", replace)
        found = Policy.load(tmp_path / "policy").act(observations)
        outcomes.add("old" if found == old else "new")
        assert found in (old, new)
        # The next one, interrupted at once, loses nothing either.
        monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt()))
        with pytest.raises(KeyboardInterrupt):
            save_policy(tmp_path / "policy", 0.3)
        monkeypatch.setattr(Path, "replace", replace)
        assert Policy.load(tmp_path / "policy").act(observations) == found
        if finished:
            break
    assert finished
    assert outcomes == {"old", "new"}
