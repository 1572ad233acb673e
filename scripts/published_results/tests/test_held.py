import math

import pandas as pd
import pytest

from published_results import held


@pytest.fixture
def runs():
    """Three runs of a state with P₂₂ = 20 and 25, and some that do not count."""
    state = {
        **{"state": "done", "doubts": None, "shear_rate": 10.0, "tangential": "coulomb", "hydrodynamics": "ball-melrose"},
        **{"stiffness": math.inf, "friction": 0.5, "volume_fraction": 0.45, "spheres": 200},
        **{"not_steady": 0.0, "ordering": 0.0},
    }
    rows = [
        {**state, "viscosity": 12.0, "particle_pressure": 19.0, "n1": -1.0, "n2": -4.0},
        {**state, "viscosity": 12.0, "particle_pressure": 19.0, "n1": -1.0, "n2": -4.0},
        {**state, "viscosity": 15.0, "particle_pressure": 24.0, "n1": -1.5, "n2": -4.5},
    ]
    others = [{"state": "jammed"}, {"doubts": "residual"}, {"shear_rate": 0.01}, {"tangential": "roll-slip"}, {"spheres": 500}]
    return pd.DataFrame([*rows, *({**rows[0], **other, "viscosity": 1e6} for other in others)])


def test_ratios_are_means_over_the_runs_that_count(runs):
    table = held.states(runs, pd.DataFrame({"viscosity": [], "friction": [], "hydrodynamics": [], "stiffness": []}))
    (row,) = table.to_dict("records")
    assert row["seeds"] == 3 and row["contacts"] == "rigid"
    assert row["viscous_number"] == pytest.approx((2 / 20 + 1 / 25) / 3)
    assert row["macroscopic_friction"] == pytest.approx((0.6 + 0.6 + 0.6) / 3)
    assert row["n2_over_stress"] == pytest.approx((-2 / 3 - 0.3) / 3)
    # t(0.975, 2) = 4.3027.
    assert row["viscosity_ci95"] == pytest.approx(4.3027 * math.sqrt(3) / math.sqrt(3), rel=1e-4)


def test_a_pressure_that_the_file_has_is_taken(runs):
    assert held.pressure(runs.iloc[0]) == pytest.approx(20)
    assert held.pressure({"pressure_22": 7.0, "particle_pressure": 1.0}) == 7.0


def test_laws_are_those_of_the_program_in_their_range():
    friction = held.law("boyer2011", "macroscopic_friction", "viscous_number")
    fraction = held.law("boyer2011", "volume_fraction", "viscous_number")
    viscosity = held.law("boyer2011", "viscosity", "volume_fraction")
    assert fraction(0.09) == pytest.approx(0.45)
    assert viscosity(0.45) == pytest.approx(friction(0.09) / 0.09)
    assert math.isnan(viscosity(0.3))
    assert held.law("gallier2014", "viscosity", "volume_fraction", 0.5)(0.45) == 9.5
    with pytest.raises(KeyError, match="boyer2011 has no"):
        held.law("boyer2011", "n1_over_stress", "volume_fraction")
