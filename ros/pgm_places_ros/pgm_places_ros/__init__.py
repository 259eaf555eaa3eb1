"""The live node of pgm-places as a node of ROS 2."""
