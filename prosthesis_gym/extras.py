"""Optional dependencies: imported where they are used, with an error that says how to get them."""

from importlib import import_module
from typing import Any


def optional(module: str, extra: str = "plot") -> Any:  # noqa: ANN401 - a module has any attributes
    """Import `module`, or raise a ModuleNotFoundError that names the extra to install."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        hint = f"pip install 'prosthesis-gym[{extra}]'"
        raise ModuleNotFoundError(f"{module.partition('.')[0]} is not installed; get it with: {hint}") from error
