"""How much of the thickening of a layer each choice of its model causes: from the runs of
`cause-of-thickening` and, with full Stokesian Dynamics, `cause-of-thickening-full`.

The rise of a model is ln(η above / η below): the mean over runs of ln η at Γ = 10, far above the
friction transition, less that at Γ = 0.01, where hardly any contact is frictional, so that friction has
no effect. Rises are sums of means over runs, and so is the effect of a choice: the rise with it less the
rise without it, all else equal. A main effect is the mean of that over the other choices.

Intervals are of 95 %, of Student's distribution with the degrees of freedom of Welch and Satterthwaite
(B. L. Welch, Biometrika 34, 28 (1947)).
"""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.stats import t as student

from .design import ALL, FULL, RATIO, STRESSLETS, questions
from .place import RESULTS

BELOW, ABOVE = 0.01, 10.0
# From this area fraction on short peaks dominate means in time, and medians replace them.
NEAR_JAMMING = 0.775
RUNS = ["cause-of-thickening-runs.csv", "cause-of-thickening-full-runs.csv"]
EFFECTS = "cause-of-thickening-effects.csv"


def read(folder=RESULTS):
    """The runs of both campaigns, with the logarithms of their viscosities."""
    return with_logarithms(pd.concat([pd.read_csv(folder / name) for name in RUNS]))


def with_logarithms(runs):
    """ln of each viscosity, of runs that reached their end without doubtful numbers."""
    near = runs["area_fraction"] > NEAR_JAMMING
    counts = (runs["state"] == "done") & runs["doubts"].isna()
    viscosity, stresslet = (
        runs[f"{name}_median"].where(near, runs[name]).where(counts) for name in ["viscosity", "viscosity_stresslet"]
    )
    logarithms = {ALL: viscosity, STRESSLETS: stresslet, RATIO: viscosity / stresslet}
    return runs.assign(**{name: np.log(values) for name, values in logarithms.items()})


def runs_of(runs, model, rate, c, friction):
    """The runs of a model at c, ν and Γ, with the number of spheres of the design. Below the
    transition, where friction has no effect, it was not varied."""
    chosen = (
        (runs["hydrodynamics"] == model.hydrodynamics)
        & (runs["tangential"] == model.tangential)
        & (runs["spheres"] == (200 if model.hydrodynamics == FULL else 400))
        & (runs["stiffness"] == model.stiffness)
        & (runs["area_fraction"] == c)
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


def rise(runs, question, c, friction):
    """The answer to a question at c and ν: a row of the table, or None."""
    # Models may occur more than once in a sum, and may share their runs below.
    weights = {}
    for weight, model in question.sum:
        for rate, sign, of in [(ABOVE, 1, model), (BELOW, -1, replace(model, sticks=False))]:
            weights[of, rate] = weights.get((of, rate), 0.0) + sign * weight
    terms, lost = [], 0
    for (model, rate), weight in weights.items():
        if abs(weight) > 1e-12:
            found = runs_of(runs, model, rate, c, friction)
            terms.append((weight, found[question.counted].dropna().to_numpy()))
            lost += found["state"].isin(["jammed", "failed"]).sum()
    known = sum_of_means(terms)
    if known is None:
        return None
    return {
        "kind": question.kind,
        "choice": question.choice,
        "friction": friction,
        "area_fraction": c,
        "rise": known[0],
        "rise_ci95": known[1],
        # The rise as a factor, with its interval to first order.
        "factor": np.exp(known[0]),
        "factor_ci95": np.exp(known[0]) * known[1],
        # Runs that are averaged, and those that jammed or failed.
        "seeds": sum(len(values) for _, values in terms),
        "lost": lost,
    }


def effects(runs):
    """The answers to all questions, where there are runs."""
    places = runs[["friction", "area_fraction"]].drop_duplicates().sort_values(["friction", "area_fraction"])
    rows = [rise(runs, question, c, friction) for question in questions() for friction, c in places.itertuples(index=False)]
    return pd.DataFrame([row for row in rows if row])
