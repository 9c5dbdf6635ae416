"""The knee units, one entry each: what Python must know of them beside the core's schema."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Device:
    """A knee unit of the core (`device.kind`)."""

    #: Its Gymnasium environment.
    env_id: str
    #: Key of section `action` with the command of `action.mode = "constant"`.
    constant_key: str
    #: What that command is.
    command_name: str
    #: Its unit.
    command_unit: str
    #: Section and key of the largest command.
    full_command_key: tuple[str, str]
    #: Whether commands may be negative.
    signed: bool = False
    #: Whether its state machine tells the phases of the gait apart.
    has_phases: bool = True

    @property
    def command(self) -> str:
        """What a command is, with its unit."""
        return f"{self.command_name} in {self.command_unit}"


#: By `device.kind`.
DEVICES = {
    "damper": Device(
        env_id="prosthesis_gym/DamperKnee-v0",
        constant_key="constant_nms2_rad2",
        command_name="damping",
        command_unit="N m s²/rad²",
        full_command_key=("action", "max_command_nms2_rad2"),
    ),
    "motor": Device(
        env_id="prosthesis_gym/MotorKnee-v0",
        constant_key="constant_a",
        command_name="current",
        command_unit="A",
        full_command_key=("motor", "current_limit_a"),
        signed=True,
    ),
    "friction": Device(
        env_id="prosthesis_gym/FrictionKnee-v0",
        constant_key="constant_nm",
        command_name="friction",
        command_unit="N m",
        full_command_key=("friction_knee", "max_friction_nm"),
        has_phases=False,
    ),
}
