"""PlacesNode: topics, parameters and the clock of ROS 2 around the live node of pgm-places."""

import time
from functools import partial
from typing import TypeVar

import rclpy
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from pgm_places import trained_labeler
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.live.live_node import LiveNode
from pgm_places.live.live_options import LiveOptions
from pgm_places.live.map_process import MapProcess
from pgm_places.live.node_options import NodeOptions, parameter_name
from pgm_places.live.place_finder import PlaceFinder
from pgm_places.options import from_mapping, option_values

T = TypeVar("T")

TURN_S = 0.02
"""How often maps are looked after."""

OF_ROS = ("domain", "namespace", "output_namespace", "use_sim_time")
"""Options that ROS itself has: the environment, remapping, and a parameter of every node."""


def quality(depth: int, *, reliable: bool, kept: bool = False) -> QoSProfile:
    """The quality of service of a topic; ``kept`` messages reach those who come later."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
    )


class PlacesNode(Node):
    """Subscribes to scans, maps and transforms, and publishes the places.

    Messages are taken and sent as the bytes that they are on the wire: all else is done by
    :class:`pgm_places.live.live_node.LiveNode`, which needs no ROS and is tested without it.
    """

    def __init__(self) -> None:
        super().__init__("pgm_places")
        options, live = self._options(NodeOptions), self._options(LiveOptions)
        model = self.declare_parameter("model", "default").value
        method = self.declare_parameter("method", "").value or None
        threads = self.declare_parameter("threads", 0).value or None
        finder = PlaceFinder(TrajectoryLabeler.from_places(trained_labeler(model)), live)
        finder.warm_up()
        self._desk = MapProcess(model, method=method, n_threads=threads)
        kept = quality(1, reliable=True, kept=True)
        self._outputs = {
            "place": self.create_publisher(String, "~/place", quality(10, reliable=True)),
            "label_map": self.create_publisher(OccupancyGrid, "~/label_map", kept),
            "markers": self.create_publisher(MarkerArray, "~/markers", kept),
            "topology": self.create_publisher(String, "~/topology", kept),
        }
        self._live = LiveNode(finder, self._desk, self._send, self._complain, options, live)
        maps = quality(1, reliable=True, kept=options.map_subscribe_transient_local)
        static = f"{options.tf_topic}_static"
        self._listen("tf_static", TFMessage, static, quality(100, reliable=True, kept=True))
        self._listen("tf", TFMessage, options.tf_topic, quality(100, reliable=True))
        self._listen("map", OccupancyGrid, options.map_topic, maps)
        self._listen("odom", Odometry, options.odom_topic, quality(10, reliable=False))
        self._listen("scan", LaserScan, options.scan_topic, quality(5, reliable=False))
        self.create_timer(TURN_S, self._turn)

    def destroy_node(self) -> None:
        """End the process that labels maps, too."""
        self._desk.close()
        super().destroy_node()

    def _options(self, cls: type[T]) -> T:
        """The options of a class from parameters, each with its default."""
        values = {
            name: self.declare_parameter(parameter_name(name), default).value
            for name, default in option_values(cls()).items()
            if name not in OF_ROS
        }
        return from_mapping(cls, values)

    def _listen(self, what: str, kind: type, topic: str, qos: QoSProfile) -> None:
        self.create_subscription(kind, topic, partial(self._take, what), qos, raw=True)

    def _take(self, what: str, raw: bytes) -> None:
        clock_s = 1e-9 * self.get_clock().now().nanoseconds
        self._live.take(what, raw, clock_s=clock_s, now_s=time.monotonic())

    def _turn(self) -> None:
        self._live.turn(time.monotonic())

    def _send(self, what: str, raw: bytes) -> None:
        self._outputs[what].publish(raw)

    def _complain(self, text: str) -> None:
        self.get_logger().warning(text)


def main() -> None:
    """Run the node until it is stopped."""
    rclpy.init()
    node = PlacesNode()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
