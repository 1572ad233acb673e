"""A typed script as a user writes it: it passes `mypy --strict` with the stubs of the package."""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import sheared_layers as sl


def viscosities(params: dict[str, object], strain: float) -> NDArray[np.float64]:
    """Viscosities of the samples of a run."""
    layer = sl.Layer(params, seed=1)
    return np.array([sample["viscosity"] for sample in layer.shear(strain)])


def curve(folder: Path) -> list[tuple[float, float]]:
    """Shear rates with mean viscosities of a small campaign, and a picture of its first run."""
    campaign = sl.Campaign(
        "typed",
        protocol={"strain": 0.2, "discard": 0.1},
        area_fraction=0.5,
        roughness=0.01,
        friction=0.3,
        shear_rate=[0.1, 10.0],
        spheres=20,
        seeds=2,
        hydrodynamics="ball-melrose",
    )
    store: sl.Store = campaign.run(folder / "typed.sqlite", workers=1, progress=False, trajectory=True)
    store.draw(1, folder / "spheres.svg", colour="contacts")
    points: sl.Table = store.points()
    return [(float(rate), float(viscosity)) for rate, viscosity in zip(points["shear_rate"], points["viscosity"])]


def main(folder: Path) -> None:
    params: dict[str, object] = {"area_fraction": 0.5, "roughness": 0.01, "friction": 0.3, "shear_rate": 1.0, "spheres": 20}
    solution = sl.solve([[0.0, 0.0], [2.1, 0.0]], hydrodynamics="ball-melrose")
    velocities: NDArray[np.float64] = solution.velocity_disturbance
    assert velocities.shape == (2, 2)
    assert np.isfinite(viscosities(params, 0.05)).all()
    assert len(curve(folder)) == 2


if __name__ == "__main__":
    main(Path(sys.argv[1]))
