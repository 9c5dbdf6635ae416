"""Are the hot loops vector code? What the processor's instructions in the built library say, on whatever machine.

The stepper is compiled once for each vector unit (`multiversion`, numerics/lanes.rs in the core), and its lane loops
are inlined into these bodies. A loop that LLVM no longer vectorises gives the same numbers several times as slowly,
which no other test notices. So the bodies are disassembled, and each function that runs in them lane by lane has to
do its arithmetic in registers as wide as the vector unit has them. Line tables tell which function an inlined
instruction belongs to; the editable installation has them.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from prosthesis_gym.extras import optional

#: Least share of a function's arithmetic that must be packed at full width.
LEAST_SHARE = 0.8
#: Walkers in a block: the bodies for one walker are scalar by design.
_LANES = 8
#: What multiversion calls the bodies of the vector units that numerics/lanes.rs lists, and f64 in their registers.
#: Processors without (before 2013) compute in software what the units fuse: nothing is asked of their version.
_UNITS = {"avx512": ("_avx512", 8), "avx2": ("_avx2_", 4)}
#: The functions compiled for each unit: the step of a block, and what looks at a block after resets.
BODIES = ("vector::block::step", "closed_loop::simulation::evaluate")
#: Functions that run lane by lane, by file, and the bodies that they are part of.
_SENSING = {
    "mechanics/compliant_ground.rs": ("contact",),
    "human/slip_leg.rs": ("trunk_force",),
    "human/impedance.rs": ("impedance",),
    "human/reference.rs": ("rough_thigh", "acceleration"),
    "plant/contact_force.rs": ("touch",),
    "plant/footing.rs": ("sense_feet", "sense_fall", "deformation_rates"),
    "plant/flow.rs": (
        "sense",
        "sense_walker",
        "sense_command",
        "rates",
        "follow_references",
        "drive_knee",
        "load_device",
        "move_mechanism",
        "move_walker",
        "turn_rotor",
    ),
    "plant/torques.rs": ("device_torque", "hip_torque"),
    "mechanics/equations.rs": ("solve", "apply", "turned"),
    "mechanics/motion.rs": ("rates",),
    "mechanics/walker.rs": ("kinematics", "acceleration", "foot_point"),
    "numerics/math.rs": ("sin_cos", "tanh"),
    "prosthesis/knee/friction/constant_friction.rs": ("friction_torque",),
    "prosthesis/end_stop.rs": ("extension_stop", "flexion_stop", "rubber"),
    "prosthesis/knee/motor/geared_motor.rs": ("signals", "motor_torque", "rotor_balance"),
    "prosthesis/knee/unit.rs": ("sense", "torques", "rates"),
    "prosthesis/knee/damper/variable_damper.rs": ("damper_torque",),
    "mechanics/terrain.rs": ("profile", "surface"),
}
_STEPPING = {
    "mechanics/compliant_ground.rs": ("deformation_rate",),
    "plant/contact_force.rs": ("point_force",),
    "plant/flow.rs": ("sense_trunk_forces", "accept"),
    "plant/outputs.rs": ("loads",),
    "plant/state.rs": ("add_scaled", "interpolate"),
    "numerics/integrator.rs": ("advance_step", "step"),
    "numerics/math.rs": ("exp", "ln"),
    "agent/action.rs": ("commands", "requests", "torque"),
    "agent/actuation.rs": ("through",),
    "prosthesis/knee/motor/geared_motor.rs": ("rotor_rates",),
    "sensors/channel.rs": ("sample", "digitise"),
    "sensors/mod.rs": ("sample",),
    "numerics/noise.rs": ("normal",),
    "closed_loop/simulation.rs": ("begin_period", "finish_period"),
}

_ARITHMETIC = re.compile(r"V?(?:ADD|SUB|MUL|DIV|SQRT|MIN|MAX|FN?M(?:ADD|SUB)(?:132|213|231))(PD|SD)")
#: Lines of addr2line: the address asked for, then pairs of function and place, from the innermost inlined one outwards.
_ADDRESS = re.compile(r"0x[0-9a-f]{16}")


@dataclass(frozen=True)
class Share:
    """How much of the arithmetic of a function, with all that is inlined into it, is packed at full width."""

    #: The vector unit that the body is compiled for.
    unit: str
    #: The body that it is part of, one of `BODIES`.
    body: str
    #: File below rust_core/src and function; the body itself has no file.
    function: str
    #: Arithmetic instructions on f64 at the unit's full width.
    packed: int
    #: All of them.
    instructions: int

    @property
    def share(self) -> float:
        """Packed over all; 0 if there are none."""
        return self.packed / self.instructions if self.instructions else 0.0

    @property
    def fault(self) -> str | None:
        """What is wrong with it."""
        where = f"{self.function} in {self.body} for {self.unit}"
        if not self.instructions:
            return f"{where}: not found; if it was renamed, rename it in prosthesis_gym/vector_code.py"
        if self.share < LEAST_SHARE:
            return (
                f"{where}: {self.packed} of {self.instructions} arithmetic instructions ({self.share:.0%}) are packed "
                f"at full width, must be {LEAST_SHARE:.0%}"
            )
        return None


def shares(library: Path) -> list[Share]:
    """Return what share of the arithmetic of each listed function is packed, for each vector unit.

    Args:
        library: the built core, an ELF file for x86-64 with symbols and line tables (`pip install -e .`).

    Raises:
        ValueError: another kind of file, or one without symbols.
        ModuleNotFoundError: the disassembler is not installed.

    """
    return [
        share
        for unit, (mark, width) in _UNITS.items()
        for body in BODIES
        for share in _shares_of(library, unit, body, _listed(body), (mark, width))
    ]


def _listed(body: str) -> list[str]:
    tables = (_SENSING, _STEPPING) if body == BODIES[0] else (_SENSING,)
    return [f"{file}: {name}" for table in tables for file, names in table.items() for name in names]


def _shares_of(library: Path, unit: str, body: str, listed: list[str], mark_width: tuple[str, int]) -> Iterator[Share]:
    mark, width = mark_width
    widths = _arithmetic(library, body, mark)
    counts: defaultdict[str, Counter[int]] = defaultdict(Counter)
    whole = f"the whole of {body}"
    for (_, doubles), frames in zip(widths, _frames(library, [address for address, _ in widths]), strict=True):
        if not any(f"<{_LANES}" in function for function, _ in frames):
            continue  # of the body for one walker
        for name in {whole, *filter(None, (_in_source(function, place) for function, place in frames))}:
            counts[name][doubles] += 1
    for name in (whole, *listed):
        yield Share(unit, body, name, counts[name][width], counts[name].total())


def _in_source(function: str, place: str) -> str | None:
    """Name an inlined function by its file below rust_core/src, without what its generic parameters are."""
    file = place.partition("rust_core/src/")[2].rpartition(":")[0]
    return f"{file}: {function.partition('<')[0]}" if file else None


def _arithmetic(library: Path, body: str, mark: str) -> list[tuple[int, int]]:
    """Return address and doubles per instruction of the arithmetic in a unit's versions of a body."""
    iced = optional("iced_x86", "dev")
    names = {number: name for name, number in vars(iced.Mnemonic).items() if isinstance(number, int)}
    register = iced.Register
    found = []
    for address, code in _functions(library, body, mark):
        for instruction in iced.Decoder(64, code, ip=address):
            kind = _ARITHMETIC.fullmatch(names[instruction.mnemonic])
            if kind is None:
                continue
            target = instruction.op0_register
            packed = 8 if target >= register.ZMM0 else 4 if target >= register.YMM0 else 2
            found.append((instruction.ip, packed if kind[1] == "PD" else 1))
    return found


def _functions(library: Path, body: str, mark: str) -> Iterator[tuple[int, bytes]]:
    """Yield address and code of the functions that multiversion made of a body for a vector unit."""
    elf: Any = optional("elftools.elf.elffile", "dev")
    crate, _, name = f"prosthesis_gym_core::{body}".rpartition("::")
    # Rust's mangling: each part of a path after its length.
    prefix = "".join(f"{len(part)}{part}" for part in (*crate.split("::"), name))
    with library.open("rb") as stream:
        if stream.read(4) != b"\x7fELF":
            raise ValueError(f"{library} must be an ELF file")
        file = elf.ELFFile(stream)
        if file.get_machine_arch() != "x64":
            raise ValueError(f"{library} is for {file.get_machine_arch()}, must be for x86-64")
        symbols, text = file.get_section_by_name(".symtab"), file.get_section_by_name(".text")
        if symbols is None or not file.has_dwarf_info():
            raise ValueError(f"{library} has no symbols and line tables: install with `pip install -e .`")
        code, start = text.data(), text["sh_addr"]
        for symbol in symbols.iter_symbols():
            if f"{prefix}" in symbol.name and f"{name}{mark}" in symbol.name:
                offset = symbol["st_value"] - start
                yield symbol["st_value"], code[offset : offset + symbol["st_size"]]


def _frames(library: Path, addresses: list[int]) -> list[list[tuple[str, str]]]:
    """Return function and place of each address, from the innermost inlined function outwards."""
    tool = shutil.which("addr2line")
    if tool is None:
        raise FileNotFoundError("addr2line, of the binutils that come with a C compiler, is not installed")
    asked = "\n".join(map(hex, addresses))
    command = [tool, "--addresses", "--functions", "--inlines", "--demangle", f"--exe={library}"]
    told = subprocess.run(command, input=asked, capture_output=True, text=True, check=True).stdout.splitlines()
    frames: list[list[tuple[str, str]]] = []
    lines = iter(told)
    for line in lines:
        if _ADDRESS.fullmatch(line):
            frames.append([])
        else:
            frames[-1].append((line, next(lines)))
    return frames
