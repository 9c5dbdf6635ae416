"""Optional dependencies: imported where they are used, with an error that says how to get them."""

from importlib import import_module
from typing import Any


def optional(module: str, extra: str | None = "plot") -> Any:  # noqa: ANN401 - a module has any attributes
    """Import `module`, or raise a ModuleNotFoundError that names what to install: the extra, or the module itself."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise missing(error.name or module, extra) from error


def missing(module: str, extra: str | None) -> ModuleNotFoundError:
    """Return the error of a module that is not installed: it names what to install."""
    package = module.partition(".")[0]
    hint = f"pip install {package}" if extra is None else f"pip install 'prosthesis-gym[{extra}]'"
    return ModuleNotFoundError(f"{package} is not installed; get it with: {hint}", name=module)
