"""DdsBus: topics of ROS 2 over plain DDS, with no ROS on the machine.

Cyclone DDS carries the bytes. Types are declared from the definitions of the messages, so that
Cyclone can tell others what a topic holds; it never looks into the bytes itself.
"""

import dataclasses
import os
import socket
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any
from xml.sax.saxutils import quoteattr

from pgm_places.errors import ConfigError
from pgm_places.live.ros_codec import TYPES, RosCodec
from pgm_places.plugins import needed

VARIABLE = "CYCLONEDDS_URI"

DOMAIN = '<CycloneDDS xmlns="https://cdds.io/config"><Domain id="any">{}</Domain></CycloneDDS>'

OWN = """\
<Internal><SocketReceiveBufferSize max="10MB"/></Internal>
<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>"""
"""The buffer holds a map of four million cells in one burst. From version 3.1 on, Fast DDS encodes
sequences in its types differently from Cyclone, so types are compared by name."""

LOCAL = """\
<General>
  <Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
  <AllowMulticast>false</AllowMulticast>
</General>"""
"""Discovery is limited to processes of this machine."""

DISCOVERY = """\
<Discovery>
  <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>20</MaxAutoParticipantIndex>
  <Peers>{}</Peers>
</Discovery>"""
"""Participants with an index listen on ports that peers can compute."""


@dataclass(frozen=True)
class DdsNetwork:
    """The network interface and the peers of DDS.

    By default, Cyclone chooses the interface and discovers participants by multicast, or follows
    the environment variable CYCLONEDDS_URI.

    Parameters
    ----------
    local_only : bool
        Whether communication is limited to this machine.
    interface : str
        Name or address of the network interface; Cyclone's choice if empty.
    peers : tuple of str
        Addresses or names of machines to contact individually, for networks without multicast.

    Examples
    --------
    >>> '<Peer address="robot.local"/>' in DdsNetwork(peers=("robot.local",)).config({})
    True
    """

    local_only: bool = False
    interface: str = ""
    peers: tuple[str, ...] = ()

    def config(self, environment: Mapping[str, str] | None = None) -> str:
        """The configuration for Cyclone: XML, followed by the value of the user's variable.

        It is passed as an argument and not set in the environment, where child processes would
        inherit it.
        """
        users = (os.environ if environment is None else environment).get(VARIABLE, "").strip()
        flags = {"--interface": bool(self.interface), "--peer": bool(self.peers)}
        named = [flag for flag, is_given in flags.items() if is_given]
        if named and self.local_only:
            raise ConfigError(f"--local and {named[0]} exclude each other; give one of them")
        if named and users:
            raise ConfigError(
                f"{VARIABLE} is set, which says what {named[0]} would say: add it there, or unset "
                "the variable"
            )
        if not all(peer.strip() for peer in self.peers):
            raise ConfigError("--peer needs the address or the name of a machine, got an empty one")
        own = DOMAIN.format(OWN + self._network())
        return f"{own},{users}" if users and not self.local_only else own

    def _network(self) -> str:
        if self.local_only:
            return LOCAL + DISCOVERY.format('<Peer address="127.0.0.1"/>')
        elements = ""
        if self.interface:
            key = "address" if _is_address(self.interface) else "name"
            chosen = f"<NetworkInterface {key}={quoteattr(self.interface)}/>"
            elements += f"<General><Interfaces>{chosen}</Interfaces></General>"
        if self.peers:
            listed = "".join(f"<Peer address={quoteattr(peer)}/>" for peer in self.peers)
            elements += DISCOVERY.format(listed)
        return elements

    def refusal(self, error: object) -> ConfigError:
        """The error message if Cyclone does not start with this configuration."""
        there = ", ".join(name for _, name in socket.if_nameindex())
        if self.interface:
            return ConfigError(
                f"DDS cannot be spoken over the interface {self.interface!r}; interfaces of this "
                f"machine: {there}"
            )
        return ConfigError(
            f"Cyclone DDS does not start ({error}); check {VARIABLE} and the network; interfaces "
            f"of this machine: {there}"
        )


def _is_address(text: str) -> bool:
    try:
        ip_address(text)
    except ValueError:
        return False
    return True


PURPOSE = "speaking DDS"

_BLOCKED_MS = 100

_OTHERWISE = {"bool": bool, "string": str}
"""Primitive types whose name differs in Cyclone."""


class DdsBus:
    """A participant of a DDS domain (ROS_DOMAIN_ID) that reads and writes bytes of ROS messages."""

    def __init__(self, domain: int, network: DdsNetwork | None = None) -> None:
        network = network or DdsNetwork()
        self._cores = needed("cyclonedds.core", extra="dds", purpose=PURPOSE)
        domains = needed("cyclonedds.domain", extra="dds", purpose=PURPOSE)
        self.codec = RosCodec()
        try:
            self._domain = domains.Domain(domain, network.config())
            self._participant = domains.DomainParticipant(domain)
        except self._cores.DDSException as error:
            raise network.refusal(error) from None
        self._readers: dict[str, _Reader] = {}
        self._waits = self._cores.WaitSet(self._participant)
        self._classes: dict[str, Any] = {}

    def read(
        self,
        what: str,
        topic: str,
        *,
        reliable: bool,
        transient_local: bool = False,
        depth: int = 10,
    ) -> None:
        """Subscribe to a topic by its ROS name from the root; :meth:`take` passes ``what`` on.

        ``depth`` messages wait to be taken; with ``transient_local``, earlier ones are requested.
        """
        subs = needed("cyclonedds.sub", extra="dds", purpose=PURPOSE)
        entity, qos = self._topic(
            what, topic, reliable=reliable, transient_local=transient_local, depth=depth
        )
        reader = subs.DataReader(self._participant, entity, qos=qos)
        states = self._cores
        condition = states.ReadCondition(
            reader, states.ViewState.Any | states.InstanceState.Any | states.SampleState.NotRead
        )
        self._waits.attach(condition)
        self._readers[what] = _Reader(topic, reader, condition)

    def writer(
        self, what: str, topic: str, *, transient_local: bool = False, depth: int = 10
    ) -> "DdsWriter":
        """A reliable publisher; with ``transient_local``, late subscribers get the last message."""
        pubs = needed("cyclonedds.pub", extra="dds", purpose=PURPOSE)
        entity, qos = self._topic(
            what, topic, reliable=True, transient_local=transient_local, depth=depth
        )
        return DdsWriter(pubs.DataWriter(self._participant, entity, qos=qos), self._class_of(what))

    def take(self, on_message: Callable[[str, bytes], None]) -> int:
        """Hand over all received messages, in the order of subscriptions; returns their number."""
        count = 0
        for what, item in self._readers.items():
            for sample in item.reader.take(N=item.depth):
                if isinstance(sample, _Raw):  # other samples report a writer that has gone
                    on_message(what, sample.data)
                    count += 1
        return count

    def wait(self, seconds: float) -> None:
        """Sleep until a message comes, or until a timeout in seconds."""
        util = needed("cyclonedds.util", extra="dds", purpose=PURPOSE)
        self._waits.wait(util.duration(microseconds=max(int(1e6 * seconds), 1)))

    def lonely(self) -> list[str]:
        """The topics without a matching publisher."""
        return [item.topic for item in self._readers.values() if not item.reader.matched_pub]

    def mismatched(self) -> list[str]:
        """The topics that are published only with an incompatible quality of service."""
        return [
            item.topic
            for item in self._readers.values()
            if item.reader.get_requested_incompatible_qos_status().total_count
        ]

    def _topic(self, what: str, topic: str, **quality: Any) -> tuple[Any, Any]:
        topics = needed("cyclonedds.topic", extra="dds", purpose=PURPOSE)
        qos = self._qos(what, **quality)
        return topics.Topic(self._participant, f"rt{topic}", self._class_of(what), qos=qos), qos

    def _qos(self, what: str, *, reliable: bool, transient_local: bool, depth: int) -> Any:
        util = needed("cyclonedds.util", extra="dds", purpose=PURPOSE)
        policy = self._cores.Policy
        wait = policy.Reliability.Reliable(util.duration(milliseconds=_BLOCKED_MS))
        # From Iron on, ROS looks for the hash of the type in the user data of an endpoint.
        type_hash = f"typehash={self.codec.store.hash_rihs01(TYPES[what])};"
        return self._cores.Qos(
            wait if reliable else policy.Reliability.BestEffort,
            policy.Durability.TransientLocal if transient_local else policy.Durability.Volatile,
            policy.History.KeepLast(depth),
            policy.DataRepresentation(
                use_cdrv0_representation=True, use_xcdrv2_representation=False
            ),
            policy.Userdata(type_hash.encode()),
        )

    def _class_of(self, what: str) -> Any:
        """The Cyclone type of a message, which passes its bytes through unchanged."""
        kind = TYPES[what]
        if kind not in self._classes:
            cls = _IdlTypes(self.codec.store.fielddefs).declared(kind)
            cls.__idl__.populate()
            cls.serialize = lambda item, *_, **__: item.raw
            cls.deserialize = classmethod(lambda _, data, *__, **___: _Raw(data))
            self._classes[kind] = cls
        return self._classes[kind]


class DdsWriter:
    """Publishes bytes of messages on one topic."""

    def __init__(self, writer: Any, cls: Any) -> None:
        self._writer, self._cls = writer, cls

    def write(self, raw: bytes) -> None:
        """Send a message."""
        item = self._cls.__new__(self._cls)
        item.raw = raw
        self._writer.write(item)

    @property
    def n_readers(self) -> int:
        """The number of subscribers."""
        return int(self._writer.get_publication_matched_status().current_count)


@dataclasses.dataclass
class _Reader:
    topic: str
    reader: Any
    condition: Any  # keeps it alive: the wait set holds only its handle
    depth: int = 100


class _Raw:
    """The bytes of a received message; Cyclone adds its source."""

    __slots__ = ("data", "sample_info")

    def __init__(self, data: bytes) -> None:
        self.data = data


class _IdlTypes:
    """Declares the types of messages as Cyclone's dataclasses, from their definitions."""

    def __init__(self, definitions: Any) -> None:
        self._definitions, self._declared = definitions, dict[str, Any]()
        self._idl = needed("cyclonedds.idl", extra="dds", purpose=PURPOSE)
        self._kinds = needed("cyclonedds.idl.types", extra="dds", purpose=PURPOSE)
        self._nodes = needed("rosbags.interfaces", extra="dds", purpose=PURPOSE).Nodetype

    def declared(self, kind: str) -> Any:
        """``sensor_msgs/msg/LaserScan`` as ``sensor_msgs::msg::dds_::LaserScan_``."""
        if kind not in self._declared:
            package, _, name = kind.split("/")
            _, fields = self._definitions[kind]
            hints = {field: self._annotation(described) for field, described in fields}
            # Not type(): only new_class lets the metaclass prepare, which reads typename.
            cls = types.new_class(
                f"{name}_",
                (self._idl.IdlStruct,),
                {"typename": f"{package}.msg.dds_.{name}_"},
                lambda space: space.update(__annotations__=hints, __module__=__name__),
            )
            self._declared[kind] = dataclasses.dataclass(cls)
        return self._declared[kind]

    def _annotation(self, described: Any) -> Any:
        kind, rest = described
        if kind == self._nodes.BASE:
            name, bound = rest
            if bound:
                return self._kinds.bounded_str[bound]
            name = "uint8" if name == "char" else name  # as ROS 2 has it
            return _OTHERWISE.get(name) or getattr(self._kinds, name)
        if kind == self._nodes.NAME:
            return self.declared(rest)
        inner, size = rest
        if kind == self._nodes.ARRAY:
            return self._kinds.array[self._annotation(inner), size]
        item = self._annotation(inner)
        return self._kinds.sequence[item, size] if size else self._kinds.sequence[item]
