"""Compiles the kernels of an unpacked wheel beside their sources: see ``compiled_wheel.py``.

The package has to be imported from the unpacked wheel, and numba to have been told for which
processors to compile. Maps, logs and results go into the current folder.
"""

from pathlib import Path

from pgm_places.cli.app import run
from pgm_places.cli.warm_up import STAGES
from pgm_places.datasets import generate_building
from pgm_places.io.maps.map_server import save_map
from pgm_places.kernels import kernel
from pgm_places.kernels.shipped_code import ship_code

COMMANDS = (
    "label floor.yaml --out floor",
    "label fine.yaml --out fine",
    "export floor --to nav2-route",
    "simulate fine.yaml --out drive.log",
    "track drive.log --out track",
    "track drive.log --map fine.yaml --out track-on-map",
    "live --replay drive.log --out live",
)
"""What needs kernels besides the stages of a comparison; the second map has another resolution."""

kernel.save_code = ship_code  # instead of into the user's folder
for stage in STAGES.values():
    stage()
save_map(generate_building().grid, Path("floor"))
save_map(generate_building(size="small", resolution_m=0.03).grid, Path("fine"))
for command in COMMANDS:
    run(command.split())
