"""Installs the node, its launch file and its parameters where ROS 2 looks for them."""

from pathlib import Path

from setuptools import setup

NAME = "pgm_places_ros"
HERE = Path(__file__).parent


def installed(folder: str) -> tuple[str, list[str]]:
    """The files of a folder, and where they go."""
    files = sorted(path.relative_to(HERE).as_posix() for path in (HERE / folder).iterdir())
    return f"share/{NAME}/{folder}", files


setup(
    name=NAME,
    version="0.4.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        installed("launch"),
        installed("config"),
    ],
    install_requires=["setuptools", "pgm-places[bags]"],
    zip_safe=True,
    description="Labels the places of a robot's map, and where the robot is, while it drives.",
    license="MIT",
    entry_points={"console_scripts": [f"places = {NAME}.node:main"]},
)
