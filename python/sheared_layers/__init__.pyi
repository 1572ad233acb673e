"""Stokesian Dynamics of sheared layers of rough, frictional spheres."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import frames as frames

_Numbers: TypeAlias = NDArray[np.float64]
_File: TypeAlias = str | PathLike[str]
_Hydrodynamics: TypeAlias = Literal["stokesian-dynamics", "ball-melrose", "lubrication"]

__version__: str
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

class SimulationError(RuntimeError):
    """A computation failed."""

class StoreError(OSError):
    """The store failed."""

def scalars(size_ratio: float, separation: ArrayLike) -> dict[str, _Numbers]:
    """Resistance functions of two spheres, each an array of shape (..., 2)."""

def solve(
    centres: ArrayLike,
    *,
    radii: ArrayLike | None = None,
    cell: Sequence[float] | None = None,
    offset: float | None = None,
    cross_offset: float | None = None,
    hydrodynamics: _Hydrodynamics | None = "stokesian-dynamics",
    background: Mapping[str, Any] | None = None,
    forces: ArrayLike | None = None,
    torques: ArrayLike | None = None,
    contact: Mapping[str, Any] | None = None,
    **more: Any,
) -> Solution:
    """Solve one instant of one configuration."""

def pair(
    size_ratio: float = 1.0,
    *,
    roughness: float = 0.05,
    friction: float = 0.0,
    contact: bool = True,
    offset: float = 0.25,
    start: float = 5.0,
    time_step: float = 0.05,
) -> Passed:
    """Move two spheres past each other."""

class Solution:
    """Motion, stresslets and contacts of a configuration."""

    velocity_disturbance: _Numbers
    angular_velocity_disturbance: _Numbers
    stresslet_xx: _Numbers
    stresslet_yy: _Numbers
    stresslet_xy: _Numbers
    viscosity: float | None
    viscosity_stresslet: float | None
    dissipation: float | None
    n1: float | None
    n2: float | None
    particle_pressure: float | None
    pressure_hydrodynamic: float | None
    stress: dict[str, dict[str, float]] | None
    computing_time_s: float
    def __init__(self, answer: dict[str, Any], dimensions: int, computing_time_s: float) -> None: ...
    @property
    def contacts(self) -> NDArray[np.void]: ...

class Passed:
    """The trajectories of two spheres that pass each other."""

    def __init__(self, answer: dict[str, Any]) -> None: ...
    final_offset: float
    rotation_degrees: _Numbers
    minimum_gap: float
    time: float
    path: _Numbers

class Run:
    """Base of `Layer` and `Suspension`: rough spheres under shear, step by step."""

    @property
    def params(self) -> dict[str, Any]: ...
    @property
    def seed(self) -> int | None: ...
    @property
    def steps(self) -> int: ...
    @property
    def strain(self) -> float: ...
    @property
    def computing_time_s(self) -> float: ...
    @property
    def side(self) -> float: ...
    @property
    def radii(self) -> _Numbers: ...
    @property
    def positions(self) -> _Numbers: ...
    @property
    def orientations(self) -> _Numbers: ...
    @property
    def velocities(self) -> _Numbers: ...
    @property
    def angular_velocities(self) -> _Numbers: ...
    @property
    def unwrapped_positions(self) -> _Numbers: ...
    @property
    def lattice(self) -> _Numbers: ...
    @property
    def stresslets(self) -> _Numbers: ...
    @property
    def contacts(self) -> NDArray[np.void]: ...
    @property
    def flow(self) -> Literal["flowing", "jammed"]: ...
    def step(self) -> dict[str, float]: ...
    def shear(self, strain: float, *, every: int = 1) -> list[dict[str, float]]: ...
    def sample(self) -> dict[str, float]: ...
    def snapshot(self) -> bytes: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Layer(Run):
    """A layer of rough spheres under shear."""

    def __new__(cls, params: Mapping[str, Any], seed: int) -> Layer: ...
    @staticmethod
    def from_snapshot(params: Mapping[str, Any], snapshot: bytes) -> Layer: ...

@final
class Suspension(Run):
    """A suspension of rough spheres under shear."""

    def __new__(cls, params: Mapping[str, Any], seed: int) -> Suspension: ...
    @staticmethod
    def from_snapshot(params: Mapping[str, Any], snapshot: bytes) -> Suspension: ...

@final
class Table:
    """A table that pandas, polars and pyarrow read without copies."""

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any: ...
    def __arrow_c_schema__(self) -> Any: ...
    def __len__(self) -> int: ...
    def __getitem__(self, column: str, /) -> NDArray[Any]: ...
    @property
    def columns(self) -> list[str]: ...
    @property
    def units(self) -> dict[str, str]: ...
    @property
    def meanings(self) -> dict[str, str]: ...
    def to_pandas(self) -> Any: ...
    def _repr_html_(self) -> str: ...

@final
class Campaign:
    """A campaign: a grid of layers, each sheared with several seeds."""

    def __new__(
        cls,
        name: str,
        *,
        protocol: Mapping[str, Any] | None = None,
        grid: Iterable[Mapping[str, Any]] | None = None,
        **axes: Any,
    ) -> Campaign: ...
    @staticmethod
    def from_toml(path: _File) -> Campaign: ...
    @property
    def name(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def default_store(self) -> Path: ...
    def __len__(self) -> int: ...
    def plan(self, *, workers: int | None = None) -> dict[str, Any]: ...
    def run(
        self,
        store: _File | None = None,
        *,
        workers: int | None = None,
        progress: bool | Callable[[float, str], object] | None = None,
        retry_failed: bool = False,
        trajectory: bool = False,
        time_limit: float | str | None = None,
        max_wall_time: float | str | None = None,
    ) -> Store: ...
    def store(self, path: _File | None = None) -> Store: ...

@final
class Store:
    """The store of a campaign."""

    def __new__(cls, path: _File) -> Store: ...
    @property
    def path(self) -> Path: ...
    def counts(self) -> dict[str, int]: ...
    def points(self, *, where: Mapping[str, Any] | None = None) -> Table: ...
    def runs(self) -> Table: ...
    def samples(self, case: str | int) -> Table: ...
    def frames(self, case: str | int, *, every: int = 1) -> Table: ...
    def contacts(self, case: str | int, *, every: int = 1) -> Table: ...
    def structure(
        self, case: str | int | None = None, *, where: Mapping[str, Any] | None = None
    ) -> Table: ...
    def structure_curves(
        self, case: str | int | None = None, *, where: Mapping[str, Any] | None = None
    ) -> Table: ...
    def segments(self, *, where: Mapping[str, Any] | None = None) -> Table: ...
    def fit(
        self, *, where: Mapping[str, Any] | None = None, replicates: int = 200
    ) -> dict[str, Any]: ...
    def draw(
        self,
        case: str | int,
        path: _File,
        *,
        strain: float | None = None,
        colour: Literal["pressure", "contacts", "spin", "cluster"] = "pressure",
        slab: tuple[float, float] | None = None,
    ) -> None: ...
    def plot(
        self,
        kind: str = "curve",
        *,
        quantity: str | None = None,
        along: str | None = None,
        where: Mapping[str, Any] | None = None,
        cases: Sequence[str] | None = None,
        segment: int | None = None,
        against: str | float | None = None,
        references: Sequence[str] | None = None,
        ax: Any = None,
    ) -> Any: ...
