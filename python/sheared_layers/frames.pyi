"""Frames of runs: those of a store, GSD, the files of LF_DEM, and their structure."""

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import Store

_Numbers: TypeAlias = NDArray[np.float64]
_File: TypeAlias = str | PathLike[str]

STATES: tuple[str, str, str]

@dataclass
class Frame:
    """Spheres in a periodic cell, and their contacts."""

    strain: float
    lattice: _Numbers
    positions: _Numbers
    radii: _Numbers
    contacts: NDArray[np.void] = ...
    velocities: _Numbers | None = None
    unwrapped: _Numbers | None = None

def of_run(store: Store, case: str | int, *, every: int = 1) -> list[Frame]:
    """The kept frames of a run of a store."""

def structure(frames: Iterable[Frame] | Iterable[Iterable[Frame]]) -> dict[str, Any]:
    """The structure of frames of one run, or of a list of runs."""

def write_gsd(path: _File, frames: Iterable[Frame]) -> None:
    """Write frames as GSD."""

def read_gsd(path: _File) -> list[Frame]:
    """Read frames from GSD."""

def read_lf_dem(particles: _File, interactions: _File | None = None) -> list[Frame]:
    """Read frames that LF_DEM wrote."""
