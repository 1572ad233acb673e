import numpy as np
import pandas as pd
import pytest

from published_results import limits


def test_laws_of_the_form_that_is_fitted_are_found_from_the_runs_that_count():
    numbers = [0.01, 0.01, 1e-3, 1e-3, 1e-4, 1.0]
    rows = [
        {
            **{"state": "done", "doubts": None, "spheres": 200, "friction": 0.5},
            **{"imposed_viscous_number": j, "viscous_number": j, "fraction": 0.58 / (1 + 1.2 * np.sqrt(j))},
            "macroscopic_friction": 0.3 + 4 * np.sqrt(j) + (j > 0.5),
        }
        for j in numbers
    ]
    others = [{"state": "failed"}, {"doubts": "residual"}, {"spheres": 1000}]
    (row,) = limits.limits(pd.DataFrame([*rows, *({**rows[0], **other, "fraction": 0.9} for other in others)]))
    assert row["seeds"] == 5
    assert row["phi_j"] == pytest.approx(0.58) and row["slope_of_fraction"] == pytest.approx(1.2)
    assert row["mu_c"] == pytest.approx(0.3) and row["slope_of_friction"] == pytest.approx(4)


def test_the_interval_of_a_line_is_that_of_student():
    # Residuals -0.1, 0.2, -0.1 about 1 + 2 x: their variance is 0.06, t(0.975, 1) is 12.706.
    (intercept, half), (slope, of_slope) = limits.line(np.array([-1.0, 0.0, 1.0]), np.array([-1.1, 1.2, 2.9]))
    assert intercept == pytest.approx(1) and slope == pytest.approx(2)
    assert half == pytest.approx(12.706 * np.sqrt(0.06 / 3), rel=1e-4)
    assert of_slope == pytest.approx(12.706 * np.sqrt(0.06 / 2), rel=1e-4)
