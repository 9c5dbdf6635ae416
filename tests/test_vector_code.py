"""The guard of the hot loops: it passes the built library, and fails one in which a single lane loop is scalar."""

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from prosthesis_gym import _core, vector_code
from prosthesis_gym.vector_code import BODIES, LEAST_SHARE, Share, shares

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64",
    reason="the guard disassembles ELF libraries for x86-64: elsewhere none is built",
)
ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def built() -> list[Share]:
    return shares(Path(_core.__file__))


def test_the_arithmetic_of_every_listed_function_is_packed_at_full_width(built: list[Share]) -> None:
    assert [share.fault for share in built if share.fault is not None] == []
    assert {(share.unit, share.body) for share in built} == {(u, b) for u in ("avx512", "avx2") for b in BODIES}
    for share in built:
        assert share.share >= LEAST_SHARE
        assert share.packed <= share.instructions


def test_a_function_that_is_missing_or_renamed_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = {"mechanics/compliant_ground.rs": ("contact", "contact_as_it_was_called_once")}
    monkeypatch.setattr(vector_code, "_SENSING", listed)
    faults = [share.fault for share in shares(Path(_core.__file__)) if share.fault is not None]
    assert len(faults) == 4
    assert all("contact_as_it_was_called_once" in fault and "not found" in fault for fault in faults)


def test_a_body_that_is_missing_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vector_code, "BODIES", ("block::stride",))
    faults = [share.fault for share in shares(Path(_core.__file__))]
    assert all(fault is not None and "not found" in fault for fault in faults)


def test_other_files_are_refused(tmp_path: Path) -> None:
    text = tmp_path / "core.so"
    text.write_text("not a library")
    with pytest.raises(ValueError, match="must be an ELF file"):
        shares(text)


@pytest.mark.timeout(1800)
def test_a_build_in_which_one_lane_loop_is_scalar_fails(tmp_path: Path) -> None:
    cargo = shutil.which("cargo")
    assert cargo is not None, "the editable installation was built with cargo"
    for name in ("Cargo.toml", "Cargo.lock", "rust_core"):
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tmp_path / name)
    source = tmp_path / "rust_core/src/plant/flow.rs"
    before, loop, after = source.read_text().partition("fn load_device<const FLEXED: bool>")
    assert loop
    # The loop's bounds hidden from the compiler: it cannot be unrolled into vectors.
    hidden = after.replace("for lane in 0..L {", "for lane in std::hint::black_box(0..L) {", 1)
    assert hidden != after
    source.write_text(before + loop + hidden)

    command = [cargo, "build", "--quiet", "--locked", "--profile=editable", "--lib", "--package=prosthesis_gym_core"]
    command += ["--features=python,pyo3/extension-module", f"--target-dir={ROOT / 'target'}"]
    # What maturin told PyO3 about this Python: without it PyO3 would be built anew, and by the next installation again.
    told = next(ROOT.glob("target/maturin/pyo3-config-*.txt"), None)
    environment = os.environ | ({} if told is None else {"PYO3_CONFIG_FILE": str(told)})
    subprocess.run(command, cwd=tmp_path, env=environment, check=True)

    library = ROOT / "target/editable/libprosthesis_gym_core.so"
    faults = [share.fault for share in shares(library) if share.fault is not None]
    library.unlink()  # lest anybody installs it
    for unit in ("avx512", "avx2"):
        assert any("load_device in vector::block::step" in fault and unit in fault for fault in faults), faults
    # The rest is as it was: the guard names the loop, not the library.
    assert not any("kinematics" in fault or "whole" in fault for fault in faults), faults
