"""The messages of ``pgm_places_msgs``: what ROS calls a place, and the places of a map."""

PLACE = """\
std_msgs/Header header
string label
float64 probability
string[] labels
float64[] beliefs
uint32 id
string name
uint32 map_seq
bool changed
float64 x
float64 y
float64 heading
"""

REGION = """\
uint32 id
string name
string label
float64 area
geometry_msgs/Point anchor
float64 clearance
float64 confidence
"""

CONNECTION = """\
uint32 first
uint32 second
geometry_msgs/Point point
float64 width
float64 length
"""

PLACES = """\
std_msgs/Header header
uint32 map_seq
Region[] regions
Connection[] connections
uint32[] appeared
uint32[] vanished
"""

MESSAGES = {
    "pgm_places_msgs/msg/Region": REGION,
    "pgm_places_msgs/msg/Connection": CONNECTION,
    "pgm_places_msgs/msg/Place": PLACE,
    "pgm_places_msgs/msg/Places": PLACES,
}
"""As in ``ros/pgm_places_msgs/msg``, which explains the fields; what others need comes first."""

UPDATE = """\
std_msgs/Header header
int32 x
int32 y
uint32 width
uint32 height
int8[] data
"""
"""``map_msgs/msg/OccupancyGridUpdate``."""
