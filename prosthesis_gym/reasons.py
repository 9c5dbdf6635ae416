"""Why episodes end."""

from enum import IntEnum

from prosthesis_gym import _core

#: What `termination_reason` of an info stands for: NONE (0) while an episode goes on, else one of the core's reasons.
TerminationReason = IntEnum(  # type: ignore[misc] # the core's list is the only one
    "TerminationReason", [(name.upper(), number) for number, name in enumerate(_core.REASONS)], module=__name__
)
