"""PlacesNode: topics, parameters, states and the clock of ROS 2 around the node of pgm-places."""

import time
import traceback
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid, Odometry
from pgm_places_msgs.msg import Place, Places
from pgm_places_msgs.srv import Where
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from pgm_places import trained_labeler
from pgm_places.errors import PgmPlacesError
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.live.live_node import LiveNode
from pgm_places.live.live_options import LiveOptions, NodeOptions, parameter_name
from pgm_places.live.map_process import MapProcess
from pgm_places.live.place_finder import PlaceFinder
from pgm_places.live.ros_codec import OUTPUTS
from pgm_places.options import from_mapping, option_values

T = TypeVar("T")

TURN_S = 0.02
"""How often maps are looked after."""

OF_ROS = ("domain", "namespace", "output_namespace", "use_sim_time")
"""Options that ROS itself has: the environment, remapping, and a parameter of every node."""

OF_PACKAGE = {"model": "default", "method": "", "threads": 0, "session": "", "autostart": True}
"""Parameters that are no options of the node of pgm-places."""

KINDS = {
    "place": String,
    "topology": String,
    "current_place": Place,
    "places": Places,
    "label_map": OccupancyGrid,
    "markers": MarkerArray,
    "diagnostics": DiagnosticArray,
}


def quality(depth: int, *, reliable: bool, transient_local: bool = False) -> QoSProfile:
    """The quality of service of a topic; late subscribers receive ``transient_local`` messages."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if transient_local else DurabilityPolicy.VOLATILE
        ),
    )


class PlacesNode(LifecycleNode):
    """Subscribes to scans, maps and transforms, and publishes the places.

    Configuring loads the model and starts the process that labels maps; only while it is active,
    the node listens and speaks. Messages are taken and sent as the bytes that they are on the wire:
    all else is done by :class:`pgm_places.live.live_node.LiveNode`, which needs no ROS and is
    tested without it.
    """

    def __init__(self) -> None:
        super().__init__("pgm_places")
        for cls in (NodeOptions, LiveOptions):
            for name, default in option_values(cls()).items():
                if name not in OF_ROS:
                    self.declare_parameter(parameter_name(name), default)
        for name, default in OF_PACKAGE.items():
            self.declare_parameter(name, default)
        self._labelling: MapProcess | None = None
        self._live: LiveNode | None = None
        self._outputs: dict[str, Any] = {}
        self._inputs: list[Any] = []
        self._timer: Any = None

    def parameter(self, name: str) -> Any:
        """The value of a parameter."""
        return self.get_parameter(name).value

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model, and prepare all that is published."""
        try:
            self._prepare()
        except PgmPlacesError as error:
            self.get_logger().error(str(error))
            self._let_go()
            return TransitionCallbackReturn.FAILURE
        except Exception:  # noqa: BLE001  rclpy ignores exceptions raised here
            self.get_logger().error(traceback.format_exc())
            self._let_go()
            return TransitionCallbackReturn.ERROR
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen and speak."""
        options = self._options(NodeOptions)
        late = options.map_subscribe_transient_local
        maps, tf = options.map_topic, options.tf_topic
        reliable = quality(100, reliable=True)
        self._listen(
            "tf_static",
            TFMessage,
            f"{tf}_static",
            quality(100, reliable=True, transient_local=True),
        )
        self._listen("tf", TFMessage, tf, reliable)
        self._listen("map", OccupancyGrid, maps, quality(1, reliable=True, transient_local=late))
        self._listen("map_updates", OccupancyGridUpdate, f"{maps}_updates", reliable)
        self._listen("odom", Odometry, options.odom_topic, quality(10, reliable=False))
        self._listen("scan", LaserScan, options.scan_topic, quality(5, reliable=False))
        self._timer = self.create_timer(TURN_S, self._turn)
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen no more; the places are kept."""
        self._be_silent()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the process that labels maps; other parameters count from now on."""
        self._let_go()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The same for good."""
        self._let_go()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The same, so that the node can be configured again."""
        self._let_go()
        return super().on_error(state)

    def destroy_node(self) -> None:
        """End the process that labels maps, too."""
        self._let_go()
        super().destroy_node()

    def _prepare(self) -> None:
        options, live = self._options(NodeOptions), self._options(LiveOptions)
        model, session = self.parameter("model"), self.parameter("session")
        finder = PlaceFinder(TrajectoryLabeler.from_places(trained_labeler(model)), live)
        finder.warm_up()
        self._labelling = MapProcess(
            model,
            method=self.parameter("method") or None,
            n_threads=self.parameter("threads") or None,
            session=Path(session) if session else None,
        )
        for what, item in OUTPUTS.items():
            topic = item.topic if item.topic.startswith("/") else f"~/{item.topic}"
            qos = quality(item.depth, reliable=True, transient_local=item.transient_local)
            self._outputs[what] = self.create_lifecycle_publisher(KINDS[what], topic, qos)
        self._service = self.create_service(Where, "~/where", self._where)
        self._live = LiveNode(finder, self._labelling, self._send, self._complain, options, live)
        self.get_logger().info(f"the model is {model!r}")

    def _be_silent(self) -> None:
        for item in self._inputs:
            self.destroy_subscription(item)
        self._inputs.clear()
        if self._timer is not None:
            self.destroy_timer(self._timer)
            self._timer = None

    def _let_go(self) -> None:
        self._be_silent()
        if self._labelling is not None:
            self._labelling.close()
        for publisher in self._outputs.values():
            self.destroy_lifecycle_publisher(publisher)
        self._outputs.clear()
        if self._live is not None:
            self.destroy_service(self._service)
        self._labelling, self._live = None, None

    def _options(self, cls: type[T]) -> T:
        """The options of a class from parameters."""
        names = [name for name in option_values(cls()) if name not in OF_ROS]
        return from_mapping(cls, {name: self.parameter(parameter_name(name)) for name in names})

    def _listen(self, what: str, kind: type, topic: str, qos: QoSProfile) -> None:
        take = partial(self._take, what)
        self._inputs.append(self.create_subscription(kind, topic, take, qos, raw=True))

    def _take(self, what: str, raw: bytes) -> None:
        if self._live is not None:
            clock_s = 1e-9 * self.get_clock().now().nanoseconds
            self._live.take(what, raw, clock_s=clock_s, now_s=time.monotonic())

    def _turn(self) -> None:
        if self._live is not None:
            self._live.turn(time.monotonic())

    def _where(self, request: Where.Request, response: Where.Response) -> Where.Response:
        """Answer the service."""
        if self._live is not None:
            place = self._live.where(request.x, request.y)
            response.map_seq, response.found = self._live.map_seq, place is not None
            if place is not None:
                response.id, response.name, response.label = place
        return response

    def _send(self, what: str, raw: bytes) -> None:
        self._outputs[what].publish(raw)

    def _complain(self, text: str) -> None:
        self.get_logger().warning(text)


def main() -> None:
    """Run the node until it is stopped; it activates itself unless 'autostart' is false."""
    rclpy.init()
    node = PlacesNode()
    try:
        if node.parameter("autostart"):
            done = node.trigger_configure()
            if done != TransitionCallbackReturn.SUCCESS:
                raise SystemExit(1)
            node.trigger_activate()
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
