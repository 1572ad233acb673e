import math

import numpy as np
import pandas as pd
import pytest

from published_results import slopes

CURVE = {"contact": "rigid", "tangential": "stick-slide", "hydrodynamic_friction": 0.0, "area_fraction": 0.76, "volume_fraction": np.nan, "friction": 1.0}


def points(*viscosities, half=0.0):
    stresses = [10.0 ** (k - 2) for k in range(len(viscosities))]
    rows = zip(stresses, viscosities)
    return pd.DataFrame([{**CURVE, "shear_stress": s, "viscosity": eta, "viscosity_ci95": half * eta, "seeds": 3} for s, eta in rows])


def test_a_power_law_has_its_exponent_between_all_stresses():
    # η ~ rate^β is η ~ σ^(β/(1 + β)).
    beta = 2.0
    rows = list(slopes.slopes(points(*(10 * 10 ** (k * beta / (1 + beta)) for k in range(3)))))
    assert [row["stresses"] for row in rows] == ["0.01 to 0.1", "0.1 to 1"]
    for row in rows:
        assert row["slope_in_stress"] == pytest.approx(2 / 3) and row["beta"] == pytest.approx(beta)


def test_the_interval_is_that_of_both_points():
    (row,) = slopes.slopes(points(10, 100, half=0.3))
    assert row["slope_in_stress"] == pytest.approx(1) and row["slope_in_stress_ci95"] == pytest.approx(0.3 * math.sqrt(2) / math.log(10))
    assert row["beta"] == math.inf and row["beta_high"] == math.inf
    low = row["slope_in_stress"] - row["slope_in_stress_ci95"]
    assert row["beta_low"] == pytest.approx(low / (1 - low))


def test_single_runs_have_no_interval():
    (row,) = slopes.slopes(points(10, 20, half=np.nan))
    assert row["slope_in_stress"] > 0 and np.isnan([row["slope_in_stress_ci95"], row["beta_low"], row["beta_high"]]).all()


def test_points_at_which_nothing_flows_have_no_slope():
    rows = list(slopes.slopes(points(10, np.nan, 30)))
    assert [row["stresses"] for row in rows] == ["0.01 to 1"]
