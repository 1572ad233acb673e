"""Stokesian Dynamics of sheared layers of rough, frictional spheres.

Physics: `scalars`, `solve`, `pair`, `Layer`, `Suspension`. Campaigns: `Campaign`, `Store`, `Table`.
Frames of these and of other programs: `frames`.
Units everywhere: mean sphere radius a, viscosity mu and shear rate are 1.
"""

from ._core import (
    Campaign,
    Layer,
    Run,
    SimulationError,
    Store,
    StoreError,
    Suspension,
    Table,
    pair,
    scalars,
    solve,
)
from ._core import __VERSION__ as __version__
from ._solution import Passed, Solution

__all__ = [
    "Campaign",
    "Layer",
    "Passed",
    "Run",
    "SimulationError",
    "Solution",
    "Store",
    "StoreError",
    "Suspension",
    "Table",
    "frames",
    "pair",
    "scalars",
    "solve",
]


def __getattr__(name):
    # NumPy is imported when it is needed.
    if name == "frames":
        from importlib import import_module

        return import_module(".frames", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
