"""Units of laser and space features by their names, for explanations."""

_LASER = {
    "m": ("f2", "f2_sd", "f3", "f6", "f8", "f8_sd", "f9", "f9_sd", "f17", "f18", "f25"),
    "m²": ("f5",),
    "1/m": ("f7",),
    "rad": ("f26",),
}
_SPACE = {
    "m": (
        *("radius", "clearance", "short", "long", "widest", "largest_radius"),
        *("way_out", "way_out_width"),
    ),
    "m²": ("area", "neighbour_area", "largest_area"),
    "1/m": (
        *("opening_density", "narrow_density"),
        *("gate_density", "gates_along", "one_gate_density"),
    ),
}
_OF_LASER, _OF_SPACE = (
    {name: unit for unit, names in table.items() for name in names} for table in (_LASER, _SPACE)
)


def value_with_unit(name: str, value: float, *, of_space: bool) -> str:
    """A feature's value to three digits, with its unit if it has one.

    Examples
    --------
    >>> value_with_unit("way_out[0.9]", 3.14159, of_space=True)
    '3.14 m'
    >>> value_with_unit("f14[0.5]", 12.0, of_space=False)
    '12'
    """
    unit = (_OF_SPACE if of_space else _OF_LASER).get(name.partition("[")[0], "")
    return f"{value:.3g} {unit}".rstrip()
