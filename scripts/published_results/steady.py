"""Whether the runs behind a row of a published file are in steady state.

The program marks points in the columns `not_steady` and `ordering`. Files that it wrote before it had
these are judged by the first of its rules: the viscosity of the two halves of the averaged strain
differs significantly, by Student's test of 1 % over at least three runs.
"""

import math
import re

from scipy.stats import t as student

MARKS = {"not steady": "†", "ordering": "‡"}
# Columns that are no averages over the strain, or are the drift itself.
_NO_AVERAGES = {
    *["seeds", "jammed", "failed", "doubtful", "jammed_stages", "spheres", "discard", "drift", "layering_drift"],
    *["bond_order_drift", "unconverged_fraction", "inexact_fraction", "worst_residual", "minimum_gap", "overlap"],
    *["wall_time_s", "cpu_time_s", "correlation_strain", "effective_samples", "precision"],
}
# Words of a sentence that says so.
_SAYS_SO = re.compile(r"\bnot\s+(?:in\s+)?steady\b|\bunsteady\b|\bordering\b")
# Fewest runs of the test, and its level.
_RUNS, _LEVEL = 3, 0.995


def _number(row, column):
    try:
        return float(row[column])
    except (KeyError, ValueError):
        return math.nan


def trend(row, column):
    """`not steady` or `ordering` if that is known of an average in a column, else None."""
    if column in _NO_AVERAGES:
        return None
    for mark in reversed(MARKS):
        if _number(row, mark.replace(" ", "_")) == 1:
            return mark
    runs, drift, half = (_number(row, name) for name in ["seeds", "drift", "drift_ci95"])
    if "not_steady" in row or not runs >= _RUNS:
        return None
    return "not steady" if _is_significant(drift, half, runs) else None


def _is_significant(mean, half, runs):
    """Whether a mean over runs with this half interval of 95 % differs from 0 at the level of the test."""
    return runs >= _RUNS and abs(mean) > half * student.ppf(_LEVEL, runs - 1) / student.ppf(0.975, runs - 1)


def drifts(runs):
    """Whether the viscosity of the runs of a point drifts, from a table with a row for each."""
    parts = runs.reindex(columns=[f"viscosity_part_{k}" for k in range(1, 5)]).dropna().to_numpy()
    if len(parts) < _RUNS:
        return False
    rises = parts[:, 2:].mean(axis=1) - parts[:, :2].mean(axis=1)
    half = student.ppf(0.975, len(rises) - 1) * rises.std(ddof=1) / math.sqrt(len(rises))
    return bool(_is_significant(rises.mean(), half, len(rises)))


def is_said(sentence):
    """Whether a sentence says that what it quotes is not steady."""
    return bool(_SAYS_SO.search(sentence))
