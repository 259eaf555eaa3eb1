"""Axes to draw on: the caller's, or new ones; pictures for notebook cells."""

import io
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DPI = 100


class Plotted:
    """A record with ``plot(ax)``, which notebooks display as a picture."""

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw on the axes."""
        raise NotImplementedError

    def _repr_png_(self) -> bytes:
        """The plot as a PNG file; pyplot's current figure is not changed."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.4, 4.8), dpi=_DPI, layout="constrained", facecolor="white")
        FigureCanvasAgg(figure)
        self.plot(figure.add_subplot())
        file = io.BytesIO()
        figure.savefig(file, format="png", metadata={"Software": None})
        return file.getvalue()


def axes_or_new(ax: "Axes | None") -> "Axes":
    """The axes, or those of a new figure of pyplot."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def legend_beside(ax: "Axes", handles: list[Any]) -> None:
    """A legend to the right of the axes."""
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1), frameon=False)


def data_frame(columns: dict[str, Any], index: str) -> Any:
    """A table of pandas, which is optional.

    Raises
    ------
    InputError
        pandas is not installed.
    """
    from pgm_places._extras import needed

    pandas = needed("pandas", extra="notebook", purpose="a table of pandas")
    return pandas.DataFrame(columns).set_index(index)
