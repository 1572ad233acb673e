"""Means over windows of the strain, over runs: how viscosity and order change while a layer is sheared."""

import pandas as pd

from .held import mean
from .place import RESULTS, sweep

# Campaigns with windows: from above the first strain to the second.
WINDOWS = {"ordering": [(1, 5), (5, 10), (10, 15), (15, 20)]}
# How far before the end of a window its last sample may be.
LAST = 0.1
AXES = ["hydrodynamics", "contact", "tangential", "spheres", "area_fraction", "size_ratio", "stiffness", "shear_rate"]
QUANTITIES = ["viscosity", "layering", "psi_6"]


def means(samples, windows):
    """A row for each point and window; runs that end within a window do not count there."""
    for axes, point in samples.groupby(AXES, sort=False):
        for start, end in windows:
            inside = point[(point["strain"] > start) & (point["strain"] <= end + 1e-9)].groupby("key")
            runs = inside[QUANTITIES].mean()[inside["strain"].max() >= end - LAST]
            if runs.empty:
                continue
            row = {**dict(zip(AXES, axes)), "strains": f"{start} to {end}", "seeds": len(runs)}
            for name in QUANTITIES:
                row[name], row[f"{name}_ci95"] = mean(runs[name])
            yield row


def make(name):
    """Writes NAME-windows.csv, from the samples of all runs."""
    samples = RESULTS / f"{name}-samples.csv"
    sweep("report", f"sweeps/{name}.toml", "--quiet", "--samples", samples)
    table = pd.DataFrame(means(pd.read_csv(samples, usecols=["key", "strain", *AXES, *QUANTITIES]), WINDOWS[name]))
    for file in [samples, samples.with_suffix(".units.csv")]:
        file.unlink()
    table.to_csv(RESULTS / f"{name}-windows.csv", index=False, lineterminator="\n", float_format="%.6g")
