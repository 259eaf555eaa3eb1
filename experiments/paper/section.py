"""The findings of one experiment: figures compared with the paper's, tables, pictures, remarks."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Self


@dataclass(frozen=True)
class Finding:
    """A line of the overview; figures are shares from 0 to 1, or None.

    Parameters
    ----------
    what : str
        What was scored.
    accuracy, balanced_accuracy, doorway_f1 : float or None
        Ours. Balanced accuracy is the mean recall of the labels.
    paper : float, str or None
        The paper's accuracy, or what else it found.
    interval : pair of float or None
        95 % confidence interval of the accuracy.
    counts : str
        Our result where it is not an accuracy.
    way : str
        The options: as the paper has them, or the defaults.
    """

    what: str
    accuracy: float | None = None
    balanced_accuracy: float | None = None
    doorway_f1: float | None = None
    paper: float | str | None = None
    interval: tuple[float, float] | None = None
    counts: str = ""
    way: str = "by default"


@dataclass(frozen=True)
class Table:
    """A table: a caption, a heading and rows of text."""

    caption: str
    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A PNG file of a section, and what it shows."""

    file: str
    caption: str


@dataclass(frozen=True)
class Outcome:
    """The outcome of an experiment.

    Parameters
    ----------
    setting : str
        The training and test data, in a sentence or two.
    findings, tables : tuple
    pictures : tuple of Picture
    files : mapping of str to bytes
        The PNG files by name.
    remarks : tuple of str
    """

    setting: str
    findings: tuple[Finding, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict, repr=False)
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Section:
    """A finished section, ready for a page; its pictures lie in its folder.

    Parameters
    ----------
    id, title, paper : str
        Its number, its name, and what the paper says; nothing for ablations.
    real : bool
        Whether the buildings were real; otherwise generated ones stood in for them.
    seconds : float
        How long it took.
    version : str
        Of this package.
    """

    id: str
    title: str
    paper: str
    real: bool
    seconds: float
    version: str
    setting: str
    findings: tuple[Finding, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def heading(self) -> str:
        """Number and title; ablations have no section number."""
        return f"{self.id} {self.title}" if self.paper else self.title

    def to_dict(self) -> dict[str, Any]:
        """The section as plain data, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The section that :meth:`to_dict` wrote."""
        rest = dict(content)
        findings = tuple(
            Finding(**{**item, "interval": _pair(item["interval"])})
            for item in rest.pop("findings")
        )
        tables = tuple(
            Table(item["caption"], tuple(item["heading"]), tuple(map(tuple, item["rows"])))
            for item in rest.pop("tables")
        )
        pictures = tuple(Picture(**item) for item in rest.pop("pictures"))
        remarks = tuple(rest.pop("remarks"))
        return cls(**rest, findings=findings, tables=tables, pictures=pictures, remarks=remarks)


def _pair(value: Any) -> tuple[float, float] | None:
    return None if value is None else (float(value[0]), float(value[1]))
