"""Installs the node, its launch file and its parameters where ROS 2 looks for them."""

from pathlib import Path

from setuptools import setup

NAME = "pgm_places_ros"
HERE = Path(__file__).parent


def installed(folder: str) -> tuple[str, list[str]]:
    """The files of a folder, and where they go."""
    files = [path for path in (HERE / folder).iterdir() if path.is_file()]
    return f"share/{NAME}/{folder}", sorted(path.relative_to(HERE).as_posix() for path in files)


TESTS = ["pytest", "pyyaml"]
"""That pytest is among them tells colcon how the tests are run: newer versions look among the
extras, older ones at what setuptools has given up."""


setup(
    name=NAME,
    version="0.5.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        installed("launch"),
        installed("config"),
    ],
    install_requires=["setuptools", "pgm-places[bags]"],
    extras_require={"test": TESTS},
    tests_require=TESTS,
    zip_safe=True,
    description="Labels the places of a robot's map, and where the robot is, while it drives.",
    license="MIT",
    entry_points={"console_scripts": [f"places = {NAME}.node:main"]},
)
