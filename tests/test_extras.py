"""What is not installed is named, with the extra that brings it."""

import subprocess
import sys
from pathlib import Path

import pytest

from prosthesis_gym.extras import optional

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("missing", "statement", "hint"),
    [
        ("stable_baselines3", "import prosthesis_gym.sb3", "pip install 'prosthesis-gym[train]'"),
        ("torch", "import prosthesis_gym.sb3", "pip install 'prosthesis-gym[train]'"),
        (
            "stable_baselines3",
            "from training.train import main; sys.exit(main(['configs/train/damper_ppo.toml', '--out', 'x']))",
            "pip install 'prosthesis-gym[train]'",
        ),
        (
            "matplotlib",
            "import sys; from prosthesis_gym.cli import main; sys.exit(main(['walk', '--plot', 'x.png']))",
            "pip install 'prosthesis-gym[plot]'",
        ),
        (
            "pygame",
            "import sys; from prosthesis_gym.cli import main; sys.exit(main(['render', '--out', 'x.png']))",
            "pip install 'prosthesis-gym[render]'",
        ),
    ],
)
def test_a_missing_package_is_named_with_its_extra(missing: str, statement: str, hint: str) -> None:
    """A process in which the package cannot be imported, as where it is not installed."""
    program = f"import sys; sys.modules[{missing!r}] = None\n{statement}"
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert result.returncode != 0
    last = result.stderr.strip().splitlines()[-1]
    assert f"{missing} is not installed; get it with: {hint}" in last
    assert not (ROOT / "x").exists()


def test_what_another_package_lacks_is_named_not_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "needs_more.py").write_text("import no_such_dependency\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="no_such_dependency is not installed; get it with: pip install 'pro"):
        optional("needs_more", "plot")
