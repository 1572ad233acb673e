"""How much of the thickening of a layer each choice of its model makes: from the runs of the campaigns `cause-of-thickening` and, with full
Stokesian Dynamics, `cause-of-thickening-full`.

The rise of a model is ln(η above / η below): the mean over runs of ln η at Γ = 10, where the critical load no longer counts, less that at
Γ = 0.01, where hardly any contact bears it, so that neither friction nor its law does anything there. Rises are sums of means over runs,
and so is what a choice makes of them: the rise with it less the rise without it, all else the same. A main effect is the mean of that over
the other choices, a pair is how much more one choice makes where another is made as well.

Intervals are of 95 %, of Student's distribution with the degrees of freedom of Welch and Satterthwaite (B. L. Welch, Biometrika 34, 28
(1947)).
"""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.stats import t as student

from .design import ALL, FULL, RATIO, STRESSLETS, questions
from .place import RESULTS

BELOW, ABOVE = 0.01, 10.0
# Area fractions from here on are near jamming, where moments of a run make its mean: there medians in time stand for means.
NEAR_JAMMING = 0.775
RUNS = ["cause-of-thickening-runs.csv", "cause-of-thickening-full-runs.csv"]
EFFECTS = "cause-of-thickening-effects.csv"


def read(folder=RESULTS):
    """The runs of both campaigns, with the logarithms of their viscosities."""
    return with_logarithms(pd.concat([pd.read_csv(folder / name) for name in RUNS]))


def with_logarithms(runs):
    """ln of each viscosity, of runs that went to their end and whose numbers are not doubtful."""
    near = runs["area_fraction"] > NEAR_JAMMING
    counts = (runs["state"] == "done") & runs["doubts"].isna()
    viscosity, stresslet = (
        runs[f"{name}_median"].where(near, runs[name]).where(counts) for name in ["viscosity", "viscosity_stresslet"]
    )
    logarithms = {ALL: viscosity, STRESSLETS: stresslet, RATIO: viscosity / stresslet}
    return runs.assign(**{name: np.log(values) for name, values in logarithms.items()})


def runs_of(runs, model, rate, c, friction):
    """The runs of a model at c, ν and Γ. Below the transition friction does not count, and was not varied. Of cells of several sizes it is
    the one of the design."""
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
    """A weighted sum of means with half its interval; None where one of them has fewer than two values."""
    if any(len(values) < 2 for _, values in terms):
        return None
    parts = [weight**2 * np.var(values, ddof=1) / len(values) for weight, values in terms]
    freedom = sum(parts) ** 2 / sum(part**2 / (len(values) - 1) for part, (_, values) in zip(parts, terms))
    total = sum(weight * np.mean(values) for weight, values in terms)
    return total, student.ppf(0.975, freedom) * np.sqrt(sum(parts))


def rise(runs, question, c, friction):
    """What is known of a question at a place of the design: a row of the table, or None."""
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
        # How many times as high the viscosity is, to first order in the interval.
        "factor": np.exp(known[0]),
        "factor_ci95": np.exp(known[0]) * known[1],
        # Runs that it was taken from, and those that jammed or failed instead.
        "seeds": sum(len(values) for _, values in terms),
        "lost": lost,
    }


def effects(runs):
    """All that is asked, at every place at which there are runs for it."""
    places = runs[["friction", "area_fraction"]].drop_duplicates().sort_values(["friction", "area_fraction"])
    rows = [rise(runs, question, c, friction) for question in questions() for friction, c in places.itertuples(index=False)]
    return pd.DataFrame([row for row in rows if row])
