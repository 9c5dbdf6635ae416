"""The knee units, as the core describes them."""

from dataclasses import dataclass

from prosthesis_gym import _core


@dataclass(frozen=True)
class Device:
    """A knee unit of the core (`device.kind`)."""

    #: Its Gymnasium environment.
    env_id: str
    #: What a command is.
    command_name: str
    #: Its unit.
    command_unit: str
    #: Whether commands may be negative: then they are proportional to an action, else quadratic from 0 at -1.
    signed: bool
    #: Whether its state machine tells the phases of the gait apart.
    has_phases: bool
    #: Key of section `action` with the command of `action.mode = "constant"`.
    constant_key: str
    #: Key of section `action` with the command of action +1; None where that is all that the unit can do.
    full_key: str | None

    @property
    def command(self) -> str:
        """What a command is, with its unit."""
        return f"{self.command_name} in {self.command_unit}"


#: By `device.kind`.
DEVICES = {kind: Device(**description) for kind, description in _core.devices().items()}
