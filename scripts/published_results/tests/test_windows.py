import math

import pandas as pd
import pytest

from published_results import windows


def samples(key, viscosities):
    point = dict.fromkeys(windows.AXES, 1)
    return [{**point, "key": key, "strain": strain, "viscosity": eta, "layering": 0.1 * eta, "psi_6": 0.2} for strain, eta in viscosities]


def test_windows_average_runs_that_reach_their_end():
    first = samples("a", [(0, 99), (1, 99), (1.5, 2), (2, 4), (2.5, 6), (3, 8)])
    second = samples("b", [(0, 99), (1.5, 6), (2, 8), (2.5, 100)])
    rows = list(windows.means(pd.DataFrame(first + second), [(1, 2), (2, 3), (3, 4)]))
    assert [(row["strains"], row["seeds"]) for row in rows] == [("1 to 2", 2), ("2 to 3", 1)]
    assert rows[0]["viscosity"] == pytest.approx((3 + 7) / 2) and rows[0]["layering"] == pytest.approx(0.5)
    # t(0.975, 1) = 12.706, of the standard error 2.
    assert rows[0]["viscosity_ci95"] == pytest.approx(12.706 * 2, rel=1e-4)
    assert rows[1]["viscosity"] == pytest.approx(7) and math.isnan(rows[1]["viscosity_ci95"])
