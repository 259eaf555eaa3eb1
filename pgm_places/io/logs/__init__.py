"""Files of drives: CARMEN logs, CSV files and ROS bags."""
