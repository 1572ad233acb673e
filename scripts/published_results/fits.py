"""Fits of the model of Wyart and Cates, as `sweep fit --json` gave them, side by side."""

import json

from .numbers import significant

PARAMETERS = {"c_0": "c_0", "c_m": "c_m", "sigma_c": "σ_c", "beta": "β", "prefactor": "A"}


def _cell(parameter):
    """A parameter with its 95 % interval, if its points had more than one run."""
    value, low, high = (None if parameter[key] is None else float(parameter[key]) for key in ["value", "low", "high"])
    text = significant(value, 4)
    return text if low is None else f"{text} ({significant(low, 4)} to {significant(high, 4)})"


def table(folder, files):
    """A line for each parameter, and one for how far the points are from the fit."""
    fits = [json.loads((folder / file).read_text(encoding="utf-8")) for file in files]
    lines = [["", *(file.removesuffix(".json").removesuffix("-fit") for file in files)]]
    lines += [[symbol, *(_cell(fit["parameters"][name]) for fit in fits)] for name, symbol in PARAMETERS.items()]
    lines.append(["points", *(str(len(fit["points"])) for fit in fits)])
    lines.append(["root mean square of ln(η/fit)", *(significant(fit["rms"], 2) for fit in fits)])
    return lines
