"""Suspensions under an imposed pressure: beside the law of Boyer et al., and for J → 0.

To the runs with J up to 0.01, of each friction coefficient,

    1/φ = (1 + K √J)/φ_J,  μ = μ_c + b √J

are fitted by least squares, the first of which has the form of Boyer et al. with other constants.
Intervals are of 95 %, of Student's distribution.
"""

import numpy as np
import pandas as pd
from scipy.stats import t as student

from .held import law
from .place import RESULTS

POINTS, STATES = ["mu-of-j.csv", "mu-of-j-loose.csv"], "mu-of-j-states.csv"
RUNS, LIMITS = "mu-of-j-runs.csv", "mu-of-j-limits.csv"
# Largest imposed J of the fits.
SMALL = 0.01


def line(x, y):
    """Intercept and slope of a straight line, each with half its interval of 95 %."""
    matrix = np.column_stack([np.ones_like(x), x])
    found, (squares,), *_ = np.linalg.lstsq(matrix, y, rcond=None)
    freedom = len(x) - 2
    covariance = np.linalg.inv(matrix.T @ matrix) * squares / freedom
    half = student.ppf(0.975, freedom) * np.sqrt(np.diag(covariance))
    return list(zip(found, half))


def limits(runs):
    """A row for each friction coefficient."""
    counts = (runs["state"] == "done") & runs["doubts"].isna() & (runs["spheres"] == 200)
    runs = runs[counts & (runs["imposed_viscous_number"] <= SMALL)]
    for friction, group in runs.groupby("friction"):
        if group["imposed_viscous_number"].nunique() < 2 or len(group) < 4:
            continue
        root = np.sqrt(group["viscous_number"].to_numpy())
        (inverse, of_inverse), (slope, _) = line(root, 1 / group["fraction"].to_numpy())
        (mu, of_mu), (rise, of_rise) = line(root, group["macroscopic_friction"].to_numpy())
        yield {
            "friction": friction,
            "seeds": len(group),
            "phi_j": 1 / inverse,
            "phi_j_ci95": of_inverse / inverse**2,
            "slope_of_fraction": slope / inverse,
            "mu_c": mu,
            "mu_c_ci95": of_mu,
            "slope_of_friction": rise,
            "slope_of_friction_ci95": of_rise,
        }


def states(points):
    """A row for each point, with the laws of Boyer et al. at its viscous number."""
    measured = ["fraction", "macroscopic_friction", "viscous_number"]
    for _, row in points.dropna(subset=["viscosity"]).iterrows():
        state = {name: row[name] for name in ["friction", "imposed_viscous_number", "contact", "spheres", "seeds", "not_steady", "ordering"]}
        for name in measured:
            state |= {name: row[name], f"{name}_ci95": row[f"{name}_ci95"]}
        j = row["viscous_number"]
        state["fraction_boyer"] = law("boyer2011", "volume_fraction", "viscous_number")(j)
        state["macroscopic_friction_boyer"] = law("boyer2011", "macroscopic_friction", "viscous_number")(j)
        yield state


def there(folder=RESULTS):
    return all((folder / file).exists() for file in [*POINTS, RUNS])


def read(folder=RESULTS):
    """Both tables, by their files."""
    return {
        STATES: pd.DataFrame(states(pd.concat([pd.read_csv(folder / file) for file in POINTS]))),
        LIMITS: pd.DataFrame(limits(pd.read_csv(folder / RUNS, low_memory=False))),
    }
