"""What lint-imports cannot see: modules take nothing from the package itself but its core and its own modules."""

import ast
from pathlib import Path

import pytest

import prosthesis_gym

PACKAGE = Path(prosthesis_gym.__file__).parent
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def taken(source: str) -> set[str]:
    """Return the names that a source imports from `prosthesis_gym` itself."""
    nodes = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom)]
    return {alias.name for node in nodes if node.module == "prosthesis_gym" for alias in node.names}


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_modules_import_the_core_or_each_other_but_nothing_that_the_package_collects(path: Path) -> None:
    collected = {name for name in taken(path.read_text()) if name != "_core" and not (PACKAGE / f"{name}.py").exists()}
    assert not collected, f"{collected} would import all of the package, whatever floor it is on"


def test_what_the_package_collects_is_found() -> None:
    assert taken("from prosthesis_gym import ProsthesisEnv, _core\nimport numpy") == {"ProsthesisEnv", "_core"}
