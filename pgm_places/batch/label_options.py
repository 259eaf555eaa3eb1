"""How maps are to be labelled: the model, its method, and what departs from its options."""

from dataclasses import dataclass, field
from pathlib import Path

from pgm_places.options import UnknownGrey
from pgm_places.report.outputs import Outputs
from pgm_places.trained import model_folder


@dataclass(frozen=True, kw_only=True)
class LabelOptions:
    """The choices of ``pgm-places label``, apart from the maps.

    Parameters
    ----------
    model : str
        A folder, or the name of a model that ships with the package.
    method : str, optional
        One of the model's; its last one by default.
    doorways, halls : str, optional
        Instead of what the model's tables ``[topology]`` and ``[labels]`` say.
    doorway_depth_m : float, optional
        Instead of what the model's table ``[labels]`` says.
    disc_radius_m : float, optional
    unentered : bool, optional
        Instead of what the model's table ``[entered]`` says:
        :class:`~pgm_places.spaces.entered_options.EnteredOptions`.
    unknown_value : int or "none", optional
        Grey value of maps that is read as unknown, as for
        :func:`~pgm_places.io.maps.map_server.load_map`.
    max_cells : int, optional
        No map is refined to more cells than this; 100 million by default.
    outputs : Outputs
        Which files are written besides labels and places.
    """

    model: str = "default"
    method: str | None = None
    doorways: str | None = None
    halls: str | None = None
    doorway_depth_m: float | None = None
    disc_radius_m: float | None = None
    unentered: bool | None = None
    unknown_value: UnknownGrey | None = None
    max_cells: int | None = None
    outputs: Outputs = field(default_factory=Outputs)

    @property
    def folder(self) -> Path:
        """The model's folder."""
        return model_folder(self.model)
