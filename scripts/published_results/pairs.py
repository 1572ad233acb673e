"""Every time step beside the finest, seed by seed, of each law and of all together.

Means of runs and their medians, of runs that neither jammed nor failed, with standard errors in per cent.
"""

import numpy as np
import pandas as pd

PLACE = ["law", "area_fraction", "shear_rate", "time_step"]


def _relative(values, base):
    """A mean difference with its standard error, in per cent of a number; nothing of fewer than two."""
    if len(values) < 2:
        return ""
    percent = 100 / base
    return f"{percent * values.mean():+.1f} ± {percent * values.std(ddof=0) / np.sqrt(len(values) - 1):.1f} %"


def _line(place, runs):
    means, logarithms = runs["mean"].dropna(), runs["middle"].dropna()
    both = runs[runs["mean"].notna() & runs["finest_mean"].notna()]
    error = means.std(ddof=0) / np.sqrt(max(1, len(means) - 1))
    differences = both["mean"] - both["finest_mean"]
    return [
        *map(str, place),
        str(len(means)),
        *(str((runs["state"] == state).sum()) for state in ["jammed", "failed"]),
        f"{runs['stages_per_strain'].mean():.0f}",
        f"{means.mean():.2f} ± {error:.2f}" if len(means) > 1 else "",
        _relative(differences, both["finest_mean"].mean()),
        f"{np.exp(logarithms.mean()):.2f}" if len(means) else "",
        _relative(both["middle"] - both["finest_middle"], 1.0),
        f"{runs['minimum_gap'].min():.4f}",
    ]


def page(file):
    """The table of a file of `sweep report --runs`, as Markdown."""
    # Here, since the list of campaigns needs this module.
    from .tables import markdown

    runs = pd.read_csv(file)
    runs["law"] = runs["contact"] + ", " + runs["tangential"]
    is_done = runs["state"] == "done"
    runs["mean"] = runs["viscosity"].where(is_done)
    runs["middle"] = np.log(runs["viscosity_median"].where(is_done))
    runs["stages_per_strain"] = runs["stages"] / runs["final_strain"]
    same_run = ["law", "area_fraction", "shear_rate", "seed"]
    finest = runs[runs["time_step"] == runs["time_step"].min()].set_index(same_run)[["mean", "middle"]]
    runs = runs.join(finest.add_prefix("finest_"), on=same_run)
    runs = pd.concat([runs, runs.assign(law="all")])
    headings = ["law", "c", "Γ", "Δt", "runs", "jammed", "failed", "right-hand sides per strain", "mean η"]
    headings += ["over the finest", "median η", "over the finest", "smallest gap"]
    groups = sorted(runs.groupby(PLACE), key=lambda group: (*group[0][:3], -group[0][3]))
    return markdown([headings, *(_line(place, group) for place, group in groups)]) + "\n"
