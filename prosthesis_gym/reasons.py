"""Why episodes end."""

from enum import IntEnum

from prosthesis_gym import _core

_NUMBERS = {name: number for number, name in enumerate(_core.REASONS)}


class TerminationReason(IntEnum):
    """What `termination_reason` of an info stands for; the core's numbers and names, these in capitals."""

    #: The episode goes on.
    NONE = _NUMBERS["none"]
    #: The hip fell below `termination.hip_height_m`.
    HIP_HEIGHT = _NUMBERS["hip_height"]
    #: Knee or ankle went beyond its limit.
    JOINT_LIMIT = _NUMBERS["joint_limit"]
    #: The integration diverged.
    NON_FINITE = _NUMBERS["non_finite"]
    #: Its time is over: truncated, not terminated.
    TIME_LIMIT = _NUMBERS["time_limit"]
