import math

import numpy as np
import pandas as pd
import pytest

from published_results.jamming import fits, viscosity
from published_results.lattices import LATTICES, far_field, side


@pytest.fixture
def plateaus():
    """Viscosities that follow the form but for their errors, and a model with too few points."""
    phi = np.array([0.3, 0.4, 0.45, 0.5, 0.54])
    eta = viscosity(phi, 0.7, 0.62) * np.exp([0.01, -0.01, 0.01, -0.01, 0.005])
    model = {"hydrodynamics": "lubrication", "contact": "linear-spring", "stiffness": 1e4, "friction": 0.0, "seeds": 3}
    known = pd.DataFrame({"volume_fraction": phi, "viscosity": eta, "viscosity_ci95": 0.05 * eta, **model})
    few = known.iloc[:2].assign(hydrodynamics="stokesian-dynamics", viscosity_ci95=math.nan)
    return pd.concat([known, few])


def test_where_viscosities_diverge_is_found(plateaus):
    (fit,) = fits(plateaus)
    assert fit["phi_j"] == pytest.approx(0.62, abs=fit["phi_j_ci95"])
    assert fit["alpha"] == pytest.approx(0.7, abs=fit["alpha_ci95"])
    assert fit["phi_j_ci95"] < 0.02 and fit["points"] == 5
    assert fit["phi_j_published"] == 0.66


def test_cells_hold_their_spheres_and_dilute_lattices_are_those_of_single_spheres():
    for lattice in LATTICES.values():
        width = side(lattice, 0.3)
        assert len(lattice.centres) * 4 * math.pi / 3 / width**3 == pytest.approx(0.3)
        drag, *viscosities = far_field(lattice, 1e-6)
        assert drag == pytest.approx(1.0, abs=0.02)
        assert viscosities == pytest.approx([1 + 2.5e-6] * 2, abs=1e-10)
