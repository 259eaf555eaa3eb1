"""The public names: imported on first use."""

from .building import LABEL_NAMES as LABEL_NAMES
from .building import STYLES as STYLES
from .building import LabelledBuilding as LabelledBuilding
from .building import generate_building as generate_building
from .map_simulation import MapSimulation as MapSimulation
from .simulated_map import simulate_map as simulate_map
