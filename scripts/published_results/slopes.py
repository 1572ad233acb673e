"""Slopes of flow curves between neighbouring imposed stresses.

    s = d ln η/d ln σ,  β = d ln η/d ln rate = s/(1 − s)

s is that of the means of two points. Its interval of 95 % is that of their relative intervals, as if
independent. β is infinite at s = 1, where thickening becomes discontinuous, and has no meaning above.
"""

import math

import numpy as np
import pandas as pd

from .place import RESULTS
from .steady import marks_of

CAMPAIGNS = ["discontinuous", "hydrodynamic-friction"]
# The axes that name a curve.
AXES = ["contact", "tangential", "hydrodynamic_friction", "area_fraction", "volume_fraction", "friction"]


def file(name):
    """The table of the slopes of a campaign."""
    return f"{name}-slopes.csv"


def slopes(points):
    """A row for each two neighbouring stresses of a curve at which runs flow."""
    for key, curve in points.groupby(AXES, dropna=False, sort=False):
        curve = curve.dropna(subset=["viscosity"]).sort_values("shear_stress")
        for (_, one), (_, other) in zip(curve.iterrows(), curve.iloc[1:].iterrows()):
            width = math.log(other["shear_stress"] / one["shear_stress"])
            slope = math.log(other["viscosity"] / one["viscosity"]) / width
            half = np.hypot(*(row["viscosity_ci95"] / row["viscosity"] for row in [one, other])) / width
            low, high = slope - half, slope + half
            yield {
                **dict(zip(AXES, key)),
                "stresses": f"{one['shear_stress']:g} to {other['shear_stress']:g}",
                "slope_in_stress": slope,
                "slope_in_stress_ci95": half,
                **{name: of_rate(s) for name, s in [("beta", slope), ("beta_low", low), ("beta_high", high)]},
                "seeds": min(one["seeds"], other["seeds"]),
                **marks_of(pd.DataFrame([one, other])),
            }


def of_rate(slope):
    """d ln η/d ln rate; infinite from d ln η/d ln σ = 1 on."""
    return math.inf if slope >= 1 else slope / (1 - slope)


def read(folder=RESULTS):
    """The tables of the campaigns that are there, by their files."""
    return {
        file(name): pd.DataFrame(slopes(pd.read_csv(folder / f"{name}.csv")))
        for name in CAMPAIGNS
        if (folder / f"{name}.csv").exists()
    }
