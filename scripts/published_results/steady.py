"""Whether the runs behind a row of a published file are in steady state: the program marks points in the
columns `not_steady` and `ordering`.
"""

import re

import pandas as pd

MARKS = {"not steady": "†", "ordering": "‡"}
# Columns that are no averages over the strain, or are the drift itself.
_NO_AVERAGES = {
    *["seeds", "jammed", "failed", "doubtful", "jammed_stages", "spheres", "discard", "drift", "layering_drift"],
    *["bond_order_drift", "unconverged_fraction", "inexact_fraction", "worst_residual", "minimum_gap", "overlap"],
    *["wall_time_s", "cpu_time_s", "correlation_strain", "effective_samples", "precision"],
}
# Words of a sentence that says so.
_SAYS_SO = re.compile(r"\bnot\s+(?:in\s+)?steady\b|\bunsteady\b|\bordering\b")


def column(mark):
    """The column of the program that has a mark."""
    return mark.replace(" ", "_")


def _is_marked(row, mark):
    try:
        return float(row[column(mark)]) == 1
    except (KeyError, ValueError):
        return False


def _mark(row):
    return next((mark for mark in reversed(MARKS) if _is_marked(row, mark)), None)


def trend(row, name):
    """`not steady` or `ordering` if that is known of an average in a column, else None."""
    return None if name in _NO_AVERAGES else _mark(row)


def points_of(name):
    """The file of the points of a file of runs."""
    return name.replace("-runs.csv", ".csv")


def read_runs(folder, name):
    """The runs of a published file, with the marks of their points."""
    return with_marks(*(pd.read_csv(folder / file, low_memory=False) for file in [name, points_of(name)]))


def with_marks(runs, points):
    """A table of runs with the marks of their points, which have the same values of all axes."""
    axes = [*points.columns[: points.columns.get_loc("seeds")]]
    marks = [column(mark) for mark in MARKS]
    return runs.merge(points[[*axes, *marks]], how="left", on=axes, validate="many_to_one")


def marks_of(rows):
    """The mark of several points or their runs, as columns of a row: ordering if any is ordering, else not
    steady if any is not."""
    found = [_mark(row) for row in rows.to_dict("records")]
    here = next((mark for mark in reversed(MARKS) if mark in found), None)
    return {column(mark): float(mark == here) for mark in MARKS}


def is_said(sentence):
    """Whether a sentence says that what it quotes is not steady."""
    return bool(_SAYS_SO.search(sentence))
