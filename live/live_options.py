"""Options of live labelling, and of a robot's live node."""

from dataclasses import dataclass
from typing import Annotated

from pgm_places.options import AtLeastZero, Options, Positive, Probability
from pgm_places.options.marks import Ge, Le


@dataclass(frozen=True)
class LiveOptions(Options):
    """Options of the filter of places, and of relabelling the map.

    Parameters
    ----------
    min_probability : float
        Labels less probable than this do not replace the previous one.
    hysteresis_s : float
        A place counts as changed once the new one has lasted this long (s).
    relabel_min_period_s : float
        Shortest time between two labellings of the map (s); if maps arrive faster, only the
        newest is labelled.

    Examples
    --------
    >>> LiveOptions(hysteresis_s=0.2).relabel_min_period_s
    5.0
    """

    min_probability: Probability = 0.0
    hysteresis_s: AtLeastZero = 0.5
    relabel_min_period_s: Positive = 5.0


@dataclass(frozen=True)
class NodeOptions(Options):
    """Topics and frames of a robot, and time limits of messages.

    Parameters
    ----------
    scan_topic : str
        Topic of the laser scans.
    map_topic : str
        Topic of the maps.
    tf_topic : str
        Topic of the transforms; static ones arrive on the same topic with '_static' appended.
    odom_topic : str
        Topic of the odometry, used where no transform gives the robot's motion.
    map_frame : str
        The frame of the map.
    base_frame : str
        The frame of the robot, whose position is looked up on the map.
    output_namespace : str
        Namespace of the published topics.
    tf_tolerance_s : float
        How long a scan waits for its transform (s).
    stale_after_s : float
        Scans that arrive later than this after their stamp are dropped (s).
    map_subscribe_transient_local : bool
        Whether map publishers serve late subscribers, as those of Nav2 and slam_toolbox do.
    use_sim_time : bool
        Take the time from /clock, as in simulation and with replayed bags.
    domain : int
        DDS domain; -1 for ROS_DOMAIN_ID.
    namespace : str
        Namespace of the topics without a leading slash.
    """

    scan_topic: str = "scan"
    map_topic: str = "map"
    tf_topic: str = "/tf"
    odom_topic: str = "odom"
    map_frame: str = "map"
    base_frame: str = "base_link"
    output_namespace: str = "pgm_places"
    tf_tolerance_s: AtLeastZero = 0.2
    stale_after_s: Positive = 1.0
    map_subscribe_transient_local: bool = True
    use_sim_time: bool = False
    domain: Annotated[int, Ge(-1), Le(232)] = -1
    namespace: str = ""

    def full_name(self, topic: str) -> str:
        """A topic with its namespace.

        Examples
        --------
        >>> NodeOptions(namespace="robot1").full_name("scan")
        '/robot1/scan'
        >>> NodeOptions(namespace="robot1").full_name("/tf")
        '/tf'
        """
        if topic.startswith("/"):
            return topic
        namespace = self.namespace.strip("/")
        return f"/{namespace}/{topic}" if namespace else f"/{topic}"


def parameter_name(option: str) -> str:
    """The ROS parameter of an option: its name without the unit.

    Examples
    --------
    >>> parameter_name("tf_tolerance_s")
    'tf_tolerance'
    """
    return option.removesuffix("_s")
