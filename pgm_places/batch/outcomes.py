"""What becomes of a map in a batch: it is labelled, it fails, or somebody else is at it."""

from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True, kw_only=True)
class LabelledRow:
    """A map that is labelled.

    Parameters
    ----------
    name, map : str
        Its folder among the results, and its YAML file.
    kept : bool
        Whether an earlier run had labelled it.
    method : str
    n_places, n_connections : int
        Of the topological map.
    area_m2 : dict of str to float
        Per label.
    doubt : float or None
        Share of the area that is expected to be labelled wrongly; None if unknown.
    check_first : str
        The place with most area in doubt; empty where nothing is known.
    warnings : tuple of str
    seconds : float
        Wall clock of the run that labelled it.
    """

    name: str
    map: str
    kept: bool = False
    method: str
    n_places: int
    n_connections: int
    area_m2: dict[str, float]
    doubt: float | None
    check_first: str
    warnings: tuple[str, ...] = field(default=())
    seconds: float

    @property
    def total_m2(self) -> float:
        """Area of all labels."""
        return sum(self.area_m2.values())

    @property
    def is_sound(self) -> bool:
        """Whether every value is of its kind: a manifest may be damaged."""
        numbers = [self.n_places, self.n_connections, self.seconds, *self.area_m2.values()]
        numbers += [] if self.doubt is None else [self.doubt]
        texts = [self.method, self.check_first, *self.area_m2, *self.warnings]
        return all(isinstance(item, int | float) for item in numbers) and all(
            isinstance(item, str) for item in texts
        )

    @property
    def figures(self) -> dict[str, Any]:
        """What the manifest keeps of it."""
        left_out = ("name", "map", "kept")
        return {key: value for key, value in asdict(self).items() if key not in left_out}

    @classmethod
    def of_figures(cls, name: str, path: str, figures: dict[str, Any]) -> "LabelledRow":
        """The row of a map that an earlier run had labelled."""
        warnings = tuple(figures.pop("warnings"))
        return cls(name=name, map=path, kept=True, warnings=warnings, **figures)


@dataclass(frozen=True)
class Failure:
    """A map that could not be labelled.

    Parameters
    ----------
    name, map : str
        Its folder among the results, and its YAML file.
    kind : str
        The class of the error, such as ``MapError``.
    message : str
        One line.
    """

    name: str
    map: str
    kind: str
    message: str


@dataclass(frozen=True)
class Elsewhere:
    """A map that another batch on the same folder is labelling."""


Outcome = LabelledRow | Failure | Elsewhere
