"""The jamming fraction of each model: η = α (1 − φ/φ_J)⁻² fitted to the plateaus of suspensions.

The logarithms are fitted. The weight of a point is from its standard error and an additional 1 %, since
the form is empirical. Intervals are of 95 %, of Student's distribution.
"""

import numpy as np
import pandas as pd
from scipy.optimize import curve_fit
from scipy.stats import t as student

from .place import RESULTS

PLATEAUS, FITS = "suspension-plateaus.csv", "suspension-plateaus-jamming.csv"
MODEL = ["hydrodynamics", "contact", "stiffness", "friction"]
# Relative error of a viscosity in addition to that of its mean.
FLOOR = 0.01
# Fewest volume fractions; with fewer, no residual shows how well the form fits.
LEAST = 3
# Of lubrication and springs: Mari, Seto, Morris & Denn, J. Rheol. 58, 1693 (2014).
PUBLISHED = {0.0: 0.66, 1.0: 0.58}


def viscosity(phi, alpha, phi_j):
    return alpha * (1 - phi / phi_j) ** -2


def fits(plateaus):
    """A row for each model."""
    for model, points in plateaus.dropna(subset=["viscosity"]).groupby(MODEL, sort=False):
        if len(points) < LEAST:
            continue
        freedom = (points["seeds"] - 1).clip(lower=1)
        error = points["viscosity_ci95"].fillna(0) / student.ppf(0.975, freedom) / points["viscosity"]
        phi, dense = points["volume_fraction"], points["volume_fraction"].max()

        def logarithm(phi, log_alpha, beyond, dense=dense):
            # Jamming is above the densest point that flows.
            return np.log(viscosity(phi, np.exp(log_alpha), dense + np.exp(beyond)))

        found, covariance = curve_fit(
            logarithm, phi, np.log(points["viscosity"]), p0=[0.0, np.log(0.1)], sigma=np.hypot(error, FLOOR), maxfev=10000
        )
        beyond = np.exp(found[1])
        half = student.ppf(0.975, len(points) - 2) * np.sqrt(np.diag(covariance)) * [np.exp(found[0]), beyond]
        hydrodynamics, _, _, friction = model
        yield dict(zip(MODEL, model)) | {
            "points": len(points),
            "alpha": np.exp(found[0]),
            "alpha_ci95": half[0],
            "phi_j": dense + beyond,
            "phi_j_ci95": half[1],
            "phi_j_published": PUBLISHED.get(friction) if hydrodynamics == "lubrication" else None,
        }


def read(folder=RESULTS):
    return pd.DataFrame(fits(pd.read_csv(folder / PLATEAUS)))
