"""The knee units, one entry each: what Python must know of them beside the core's schema."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Device:
    """A knee unit of the core (`device.kind`)."""

    #: Its Gymnasium environment.
    env_id: str
    #: Key of section `action` with the command of `action.mode = "constant"`.
    constant_key: str
    #: What that command is, with its unit.
    command: str


#: By `device.kind`.
DEVICES = {
    "damper": Device("prosthesis_gym/DamperKnee-v0", "constant_nms2_rad2", "damping in N m s²/rad²"),
    "motor": Device("prosthesis_gym/MotorKnee-v0", "constant_a", "current in A"),
    "friction": Device("prosthesis_gym/FrictionKnee-v0", "constant_nm", "friction in N m"),
}
