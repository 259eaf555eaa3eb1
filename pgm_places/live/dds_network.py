"""DdsNetwork: over which network DDS is spoken, and with whom, as Cyclone's configuration."""

import os
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from xml.sax.saxutils import quoteattr

from pgm_places.errors import ConfigError

VARIABLE = "CYCLONEDDS_URI"

DOMAIN = '<CycloneDDS xmlns="https://cdds.io/config"><Domain id="any">{}</Domain></CycloneDDS>'

OWN = """\
<Internal><SocketReceiveBufferSize max="10MB"/></Internal>
<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>"""
"""The buffer takes a map of four million cells in one burst. Fast DDS from 3.1 on marks sequences
in its types otherwise than Cyclone does, so types are compared by name."""

LOCAL = """\
<General>
  <Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
  <AllowMulticast>false</AllowMulticast>
</General>"""
"""Only processes of this machine are seen, and see us."""

DISCOVERY = """\
<Discovery>
  <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>20</MaxAutoParticipantIndex>
  <Peers>{}</Peers>
</Discovery>"""
"""Numbered participants listen where those that name us as a peer look for them."""


@dataclass(frozen=True)
class DdsNetwork:
    """Over which network DDS is spoken, and with whom.

    Without any of these, Cyclone chooses the interface and finds others by multicast, or does what
    the environment variable CYCLONEDDS_URI says.

    Parameters
    ----------
    local_only : bool
        Whether only this machine is spoken to.
    interface : str
        Name or address of the network interface; Cyclone's choice if empty.
    peers : tuple of str
        Addresses or names of machines that are looked for one by one, where multicast does not
        pass.

    Examples
    --------
    >>> '<Peer address="robot.local"/>' in DdsNetwork(peers=("robot.local",)).config({})
    True
    """

    local_only: bool = False
    interface: str = ""
    peers: tuple[str, ...] = ()

    def config(self, environment: Mapping[str, str] | None = None) -> str:
        """The configuration for Cyclone: XML, after which what the user's variable says follows.

        It is handed over and not put into the environment, as programs that are started would
        inherit it.

        Raises
        ------
        ConfigError
            An interface or peers are named although the user's variable is set, or with
            ``local_only``; or a name is empty.
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
        found = ""
        if self.interface:
            key = "address" if _is_address(self.interface) else "name"
            chosen = f"<NetworkInterface {key}={quoteattr(self.interface)}/>"
            found += f"<General><Interfaces>{chosen}</Interfaces></General>"
        if self.peers:
            listed = "".join(f"<Peer address={quoteattr(peer)}/>" for peer in self.peers)
            found += DISCOVERY.format(listed)
        return found

    def refusal(self, error: object) -> ConfigError:
        """What to say where Cyclone does not start with this."""
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
