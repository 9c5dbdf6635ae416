"""Bodies of other mass and height than Table 1's."""

from typing import Final

import numpy as np

from prosthesis_gym.config import Config, resolve

HEIGHT_M: Final = 1.77
"""Body height that Table 1's lengths belong to: the median adult man of the U.S. population (section 3)."""

MASS_RANGE_KG: Final = (45.0, 120.0)
HEIGHT_RANGE_M: Final = (1.50, 2.00)


def scaled_body(mass_kg: float | None = None, height_m: float | None = None) -> Config:
    """Return the sections of a configuration that make a body of this total mass and height.

    Trunk and thigh are human and keep the proportions of Table 1: lengths in proportion to height, masses so that
    human and prosthesis together weigh `mass_kg`, inertias with mass times height squared. Calf, tube and foot are the
    prosthesis and keep their masses and inertias, calf and foot also their size; the tube is cut so that knee and hip
    are at their share of the height. The ankle has its stiffness per body mass; the first stride that the human
    expects and the hip height that counts as a fall are in proportion to height.

    Args:
        mass_kg: mass of human and prosthesis, kg; None keeps the 75 kg of Table 1.
        height_m: body height, m; None keeps the 1.77 m of Table 1.

    Raises:
        ValueError: a body outside `MASS_RANGE_KG` or `HEIGHT_RANGE_M`.

    """
    table = resolve({})
    body, stiffness = table["body"], table["ankle"]["stiffness_nm_rad"]
    prosthesis_kg = body["calf_mass_kg"] + body["foot_mass_kg"]
    table_kg = body["trunk_mass_kg"] + body["thigh_mass_kg"] + prosthesis_kg
    mass_kg = table_kg if mass_kg is None else mass_kg
    height_m = HEIGHT_M if height_m is None else height_m
    for name, value, (low, high) in (("mass_kg", mass_kg, MASS_RANGE_KG), ("height_m", height_m, HEIGHT_RANGE_M)):
        if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
            raise ValueError(f"{name} = {value} must be a number in [{low:g}, {high:g}]")  # noqa: TRY004
        if not low <= value <= high:
            raise ValueError(f"{name} = {value} is outside its allowed range [{low:g}, {high:g}]")
    heavier = (mass_kg - prosthesis_kg) / (table_kg - prosthesis_kg)
    longer = height_m / HEIGHT_M
    scale = {"mass_kg": heavier, "inertia_kg_m2": heavier * longer**2, "_m": longer}
    scaled = {
        key: value * scale[next(unit for unit in scale if key.endswith(unit))]
        for key, value in body.items()
        if key.startswith(("trunk_", "thigh_"))
    }
    below_knee = body["calf_length_m"] + body["tube_length_m"] + body["foot_height_m"]
    scaled["tube_length_m"] = body["tube_length_m"] + (longer - 1.0) * below_knee
    return {
        "body": scaled,
        "ankle": {"stiffness_nm_rad": stiffness * (mass_kg / table_kg)},
        "human": {"first_stride_m": table["human"]["first_stride_m"] * longer},
        "termination": {"hip_height_m": table["termination"]["hip_height_m"] * longer},
    }
