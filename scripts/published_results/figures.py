"""The two figures that are made of several files. Each names in its description the digest of what it shows."""

import hashlib
import math

import matplotlib
import pandas as pd

from .place import RESULTS
from .thickening import EFFECTS
from .units import PublishedUnits

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402  the back end comes first

STYLE = {
    "svg.hashsalt": "published",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}
COLOURS = ["#000000", "#e69f00", "#d55e00", "#0072b2", "#56b4e9", "#009e73"]
MARKERS = ["o", "s", "^", "v", "D", "P"]
# From the paper's reading of its model to soft layers that stick.
MODELS = {
    "rigid, roll-slip, stresslets alone": "the paper: rigid, roll-slip, stresslets alone",
    "rigid, roll-slip": "contact stress counted",
    "rigid, coulomb": "friction that sticks: rigid",
    "k = 1e5, stick-slide": "the same on springs, k = 1e5",
    "k = 1e4, stick-slide": "k = 1e4",
    "k = 1e3, stick-slide": "k = 1e3",
}


def digest(files, folder=RESULTS):
    """What the description of a figure says of its files."""
    content = b"".join((folder / file).read_bytes() for file in files)
    return f"{', '.join(files)}: sha256 {hashlib.sha256(content).hexdigest()}"


def _write(name, files, panels, draw, x, y, scale="linear"):
    """Panels of the same axes, at most three side by side, each drawn by a function of its axes; one legend above them."""
    wide = min(3, len(panels))
    high = math.ceil(len(panels) / wide)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            high, wide, figsize=(7.2, 0.9 + 2.2 * high), sharex=True, sharey=True, squeeze=False, layout="constrained"
        )
        axes = list(axes.flat)
        for ax, (title, panel) in zip(axes, panels.items()):
            draw(ax, panel)
            ax.set(title=title, xscale=scale, yscale=scale)
            ax.tick_params(labelbottom=True)
        for ax in axes[len(panels) :]:
            ax.remove()
        figure.supxlabel(x, fontsize=9)
        figure.supylabel(y, fontsize=9)
        handles = {label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels())}
        figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=2 if len(handles) > 3 else 3)
        figure.savefig(RESULTS / name, metadata={"Date": None, "Description": digest(files)})
        plt.close(figure)


def thickening():
    """Rises against c, a panel for each friction."""
    effects = pd.read_csv(RESULTS / EFFECTS)
    effects = effects[effects["kind"] == "rise"]

    def draw(ax, panel):
        for (choice, label), colour, marker in zip(MODELS.items(), COLOURS, MARKERS):
            points = panel[panel["choice"] == choice]
            if len(points):
                style = {"color": colour, "marker": marker, "markersize": 4, "linewidth": 1, "capsize": 2, "label": label}
                ax.errorbar(points["area_fraction"], points["rise"], points["rise_ci95"], **style)

    panels = {f"ν = {friction:g}": panel for friction, panel in effects.groupby("friction")}
    _write("cause-of-thickening.svg", [EFFECTS], panels, draw, "area fraction c", "ln(η above / η below the transition)")


def beside():
    """What was published, and what the same model gives here, in published units; a panel for each area fraction that both have."""
    files = ["published-2d.csv", "published-2d.reference.csv"]
    ours, theirs = (pd.read_csv(RESULTS / file) for file in files)
    units = ours.apply(lambda row: PublishedUnits(row["area_fraction"], row["size_ratio"], row["large_fraction"]), axis=1)
    # No rate where the stress did not make the layer flow.
    ours["published_viscosity"] = [unit.viscosity(eta) for unit, eta in zip(units, ours["viscosity"])]
    ours["published_stress"] = [
        6 * math.pi * unit.shear_stress(eta, rate) for unit, eta, rate in zip(units, ours["viscosity"], ours["shear_rate"])
    ]
    usual = ours.query("spheres == 200 and stiffness == 5348 and repulsion_length == 0.0441 and lubrication_regularisation == 0.001")
    # The parameters that the published text states for like layers, and those that were fitted to the table.
    lines = {
        "published": theirs,
        "ours, ν = 1": usual.query("friction == 1 and repulsion == 1"),
        "ours, ν = 10 and 0.583 of the repulsion": usual.query("friction == 10 and repulsion == 0.583"),
    }

    def draw(ax, c):
        for (label, points), colour, marker in zip(lines.items(), COLOURS, MARKERS):
            points = points[points["area_fraction"] == c].dropna(subset=["published_viscosity"]).sort_values("published_stress")
            if len(points):
                style = {"color": colour, "marker": marker, "markersize": 3, "linewidth": 1, "label": label}
                ax.plot(points["published_stress"], points["published_viscosity"], **style)

    panels = {f"c = {c:g}": c for c in sorted(ours["area_fraction"].unique())}
    _write("published-2d-beside.svg", files, panels, draw, "their stress 6π σ'", "their viscosity η'", scale="log")


FIGURES = {
    "cause-of-thickening.svg": (thickening, [EFFECTS]),
    "published-2d-beside.svg": (beside, ["published-2d.csv", "published-2d.reference.csv"]),
}


def make():
    for draw, _ in FIGURES.values():
        draw()


def outdated():
    """Figures that show other numbers than the files have now."""
    return [name for name, (_, files) in FIGURES.items() if digest(files) not in (RESULTS / name).read_text(encoding="utf-8")]
