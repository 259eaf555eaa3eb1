"""The public names, each once: what type checkers read and what is imported on first use."""

from .errors import PgmPlacesError as PgmPlacesError
from .evaluation.evaluation import evaluate as evaluate
from .graph.label_graph import LabelGraph as LabelGraph
from .graph.raster_edges import EdgeKind as EdgeKind
from .inference.backends import build as build
from .inference.labeling import Labeling as Labeling
from .inference.labeling import Status as Status
from .inference.potentials import Potentials as Potentials
from .inference.potentials import score as score
from .inference.problem import LabelingProblem as LabelingProblem
from .io.maps.label_image import load_labels as load_labels
from .io.maps.label_image import save_labels as save_labels
from .io.maps.map_server import load_map as load_map
from .io.maps.map_server import save_map as save_map
from .io.places.topology_files import load_topology as load_topology
from .io.places.topology_files import save_topology as save_topology
from .labelers.joint_labeler import JointLabeler as JointLabeler
from .labelers.method import PlaceMethod as PlaceMethod
from .labelers.place_labeler import PlaceLabeler as PlaceLabeler
from .labelers.structured_labeler import StructuredLabeler as StructuredLabeler
from .labelers.trajectory_labeler import TrajectoryLabeler as TrajectoryLabeler
from .labelling.label import label_map as label_map
from .maps.labelled_map import LabelledMap as LabelledMap
from .maps.occupancy_grid import OccupancyGrid as OccupancyGrid
from .models.decoding import decode as decode
from .persistence.stored import load as load
from .persistence.stored import save as save
from .sensing.sensor import Sensor as Sensor
from .sensing.sensor import SensorNoise as SensorNoise
from .topology.checks import places_to_check as places_to_check
from .topology.from_labels import topological_map as topological_map
from .trained import trained_labeler as trained_labeler
from .trained import trained_tracker as trained_tracker
from .trajectories.scan import Scan as Scan
from .trajectories.scan import ScanGeometry as ScanGeometry
from .trajectories.similarity import Similarity as Similarity
from .trajectories.trajectory import MappedDrive as MappedDrive
from .trajectories.trajectory import Trajectory as Trajectory

__all__: list[str]
__version__: str
