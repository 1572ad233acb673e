import math

import numpy as np
import pandas as pd
import pytest

from published_results.design import RIGID
from published_results.steady import marks_of, with_marks
from published_results.thickening import ABOVE, BELOW, LAYERS, effects, sum_of_means, with_logarithms


def run(stiffness, tangential, rate, viscosity, noise):
    # Of each viscosity a half is of stresslets below, a quarter above.
    share = 0.5 if rate == BELOW else 0.25
    return {
        "state": "done",
        "hydrodynamics": "ball-melrose",
        "tangential": tangential,
        "spheres": 400,
        "area_fraction": 0.7,
        "friction": 1.0,
        "stiffness": stiffness,
        "shear_rate": rate,
        "viscosity": viscosity * noise,
        "viscosity_median": np.nan,
        "viscosity_stresslet": share * viscosity * noise**2,
        "viscosity_stresslet_median": np.nan,
        "doubts": np.nan,
        # The softest contacts yield more and more, the next order.
        "not_steady": float((rate, stiffness) == (ABOVE, 1e3)),
        "ordering": float((rate, stiffness) == (ABOVE, 1e4)),
    }


@pytest.fixture
def known():
    """The effects of layers whose viscosities are products of what each choice makes, by choice."""
    runs = []
    for noise in [0.9, 1.0, 1 / 0.9]:
        for stiffness, softness in [(RIGID, 1.0), (1e5, 1.0), (1e4, 0.8), (1e3, 0.5)]:
            runs.append(run(stiffness, "roll-slip", BELOW, 10.0, noise))
            runs.append(run(stiffness, "roll-slip", ABOVE, 20.0 * softness, noise))
            if stiffness < RIGID:
                runs.append(run(stiffness, "stick-slide", ABOVE, 60.0 * softness, noise))
    # Runs that jammed, and those whose numbers are doubtful, are in no mean.
    runs.append(run(1e4, "roll-slip", ABOVE, 1e6, 1.0) | {"state": "jammed"})
    runs.append(run(1e4, "roll-slip", ABOVE, 1e6, 1.0) | {"doubts": "drift"})
    table = effects(LAYERS, with_logarithms(LAYERS, pd.DataFrame(runs)))
    return table.drop_duplicates("choice", keep=False).set_index("choice")


@pytest.mark.parametrize(
    ("choice", "factor"),
    [
        ("rigid, roll-slip", 2.0),
        ("rigid, roll-slip, stresslets alone", 1.0),
        ("contact stress included", 2.0),
        ("sticking friction", 3.0),
        ("k = 1e4 in place of 1e5", 0.8),
        ("k = 1e3 in place of 1e5", 0.5),
        ("× softer springs, k = 1e4", 0.8),
    ],
)
def test_what_a_choice_makes_is_found_where_it_is_known(known, choice, factor):
    assert known.loc[choice, "rise"] == pytest.approx(math.log(factor), abs=1e-12)


def test_a_rise_has_the_marks_of_its_points(known):
    rises = known.loc[[f"k = 1e{k}, roll-slip" for k in [5, 4, 3]]]
    assert [*rises["not_steady"]] == [0, 0, 1] and [*rises["ordering"]] == [0, 1, 0]
    assert [*known.loc["k = 1e3 in place of 1e5", ["not_steady", "ordering"]]] == [1, 0]
    assert [*known.loc["k = 1e4 in place of 1e5", ["not_steady", "ordering"]]] == [0, 1]


def test_runs_have_the_marks_of_their_points():
    points = pd.DataFrame({"friction": [0.1, 0.2], "seeds": [2, 1], "not_steady": [1, 0], "ordering": [0, 1]})
    runs = pd.DataFrame({"seed": [1, 1, 2], "friction": [0.1, 0.2, 0.1]})
    assert [*with_marks(runs, points)["not_steady"]] == [1, 0, 1]
    assert marks_of(with_marks(runs, points)) == {"not_steady": 0, "ordering": 1}


def test_runs_are_counted(known):
    # Runs below cancel from the friction law: the interval is that of the runs above.
    assert known.loc["× sticking friction", "seeds"] == 6
    assert known.loc["k = 1e4, roll-slip", "lost"] == 1
    assert known.loc["k = 1e4, stick-slide", "seeds"] == 6
    # What there are no runs for is left out.
    assert "rigid, coulomb" not in known.index


def test_intervals_are_those_of_welch():
    # Two samples of five each with the variances 2.5 and 10: t' of 5 degrees of freedom 5.88, half
    # width t s.
    one, two = [1.0, 2.0, 3.0, 4.0, 5.0], [2.0, 4.0, 6.0, 8.0, 10.0]
    mean, half = sum_of_means([(1.0, two), (-1.0, one)])
    assert mean == pytest.approx(3.0, abs=1e-12)
    # t(0.975) lies between those of 5 and 6 degrees of freedom.
    assert 2.447 < half / math.sqrt(2.5 / 5 + 10 / 5) < 2.571
    assert sum_of_means([(1.0, [1.0])]) is None
