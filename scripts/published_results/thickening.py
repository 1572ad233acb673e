"""How much of the thickening of a layer or suspension each choice of its model causes: from the runs
of `cause-of-thickening` and, with full Stokesian Dynamics, `cause-of-thickening-full`, and from those
of `cause-of-thickening-bulk` and `cause-of-thickening-bulk-full`.

The rise of a model is ln(η above / η below): the mean over runs of ln η at Γ = 10, far above the
friction transition, less that at Γ = 0.01, where hardly any contact is frictional, so that friction has
no effect. Rises are sums of means over runs, and so is the effect of a choice: the rise with it less the
rise without it, all else equal. A main effect is the mean of that over the other choices.

Intervals are of 95 %, of Student's distribution with the degrees of freedom of Welch and Satterthwaite
(B. L. Welch, Biometrika 34, 28 (1947)).
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.stats import t as student

from .design import ALL, FULL, RATIO, STRESSLETS, questions
from .place import RESULTS
from .steady import marks_of, read_runs

BELOW, ABOVE = 0.01, 10.0


@dataclass(frozen=True)
class Design:
    """The campaigns of one kind of system."""

    name: str
    # The files with their runs.
    runs: list
    # The column of the fraction, and the fraction from which on short peaks dominate means in time,
    # so that medians replace them.
    fraction: str
    near_jamming: float
    # Spheres, and those of full Stokesian Dynamics.
    spheres: int
    spheres_full: int

    @property
    def effects(self):
        """The file with its effects."""
        return f"{self.name}-effects.csv"

    def there(self, folder=RESULTS):
        """Whether its runs are published."""
        return all((folder / name).exists() for name in self.runs)

    def read(self, folder=RESULTS):
        """Its runs, with the marks of their points and the logarithms of their viscosities."""
        return with_logarithms(self, pd.concat([read_runs(folder, name) for name in self.runs]))


LAYERS = Design(
    "cause-of-thickening", ["cause-of-thickening-runs.csv", "cause-of-thickening-full-runs.csv"], "area_fraction", 0.775, 400, 200
)
SUSPENSIONS = Design(
    "cause-of-thickening-bulk",
    ["cause-of-thickening-bulk-runs.csv", "cause-of-thickening-bulk-full-runs.csv"],
    "volume_fraction",
    1.0,
    200,
    110,
)


def with_logarithms(design, runs):
    """ln of each viscosity, of runs that reached their end without doubtful numbers."""
    near = runs[design.fraction] > design.near_jamming
    counts = (runs["state"] == "done") & runs["doubts"].isna()
    viscosity, stresslet = (
        runs[f"{name}_median"].where(near, runs[name]).where(counts) for name in ["viscosity", "viscosity_stresslet"]
    )
    logarithms = {ALL: viscosity, STRESSLETS: stresslet, RATIO: viscosity / stresslet}
    return runs.copy().assign(**{name: np.log(values) for name, values in logarithms.items()})


def runs_of(design, runs, model, rate, fraction, friction):
    """The runs of a model at a fraction, ν and Γ, with the number of spheres of the design. Below the
    transition, where friction has no effect, it was not varied."""
    chosen = (
        (runs["hydrodynamics"] == model.hydrodynamics)
        & (runs["tangential"] == model.tangential)
        & (runs["spheres"] == (design.spheres_full if model.hydrodynamics == FULL else design.spheres))
        & (runs["stiffness"] == model.stiffness)
        & (runs[design.fraction] == fraction)
        & (runs["shear_rate"] == rate)
    )
    return runs[chosen if rate == BELOW else chosen & (runs["friction"] == friction)]


def sum_of_means(terms):
    """A weighted sum of means and half its interval; None if a mean has fewer than two values."""
    if any(len(values) < 2 for _, values in terms):
        return None
    parts = [weight**2 * np.var(values, ddof=1) / len(values) for weight, values in terms]
    freedom = sum(parts) ** 2 / sum(part**2 / (len(values) - 1) for part, (_, values) in zip(parts, terms))
    total = sum(weight * np.mean(values) for weight, values in terms)
    return total, student.ppf(0.975, freedom) * np.sqrt(sum(parts))


def rise(design, runs, question, fraction, friction):
    """The answer to a question at a fraction and ν: a row of the table, or None."""
    # Models may occur more than once in a sum, and may share their runs below.
    weights = {}
    for weight, model in question.sum:
        for rate, sign, of in [(ABOVE, 1, model), (BELOW, -1, replace(model, sticks=False))]:
            weights[of, rate] = weights.get((of, rate), 0.0) + sign * weight
    terms, lost, averaged = [], 0, []
    for (model, rate), weight in weights.items():
        if abs(weight) > 1e-12:
            found = runs_of(design, runs, model, rate, fraction, friction)
            terms.append((weight, found[question.counted].dropna().to_numpy()))
            averaged.append(found[found[question.counted].notna()])
            lost += found["state"].isin(["jammed", "failed"]).sum()
    known = sum_of_means(terms)
    if known is None:
        return None
    return {
        "kind": question.kind,
        "choice": question.choice,
        "friction": friction,
        design.fraction: fraction,
        "rise": known[0],
        "rise_ci95": known[1],
        # The rise as a factor, with its interval to first order.
        "factor": np.exp(known[0]),
        "factor_ci95": np.exp(known[0]) * known[1],
        # Runs that are averaged, and those that jammed or failed.
        "seeds": sum(len(values) for _, values in terms),
        "lost": lost,
        # Those of any model in it.
        **marks_of(pd.concat(averaged)),
    }


def effects(design, runs):
    """The answers to all questions, where there are runs."""
    places = runs[["friction", design.fraction]].drop_duplicates().sort_values(["friction", design.fraction])
    places = [*places.itertuples(index=False)]
    rows = [rise(design, runs, question, fraction, friction) for question in questions() for friction, fraction in places]
    return pd.DataFrame([row for row in rows if row])
