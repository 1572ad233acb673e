"""The figures that `sweep` does not draw. The description of each has the digest of its data."""

import hashlib
import math

import matplotlib
import numpy as np
import pandas as pd

from . import held, jamming, lattices, limits
from .place import RESULTS
from .steady import trend
from .thickening import LAYERS, SUSPENSIONS
from .units import PublishedUnits

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402  the back end comes first
from matplotlib.ticker import LogFormatter  # noqa: E402

STYLE = {
    "svg.hashsalt": "published",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}
COLOURS = ["#000000", "#e69f00", "#d55e00", "#cc79a7", "#0072b2", "#56b4e9", "#009e73"]
MARKERS = ["o", "s", "^", "X", "v", "D", "P"]
# From the paper's model to soft layers with sticking friction.
MODELS = {
    "rigid, roll-slip, stresslets alone": "the paper: rigid, roll-slip, stresslets alone",
    "rigid, roll-slip": "contact stress included",
    "rigid, coulomb": "sticking friction: rigid",
    "k = 1e6, stick-slide": "sticking friction: springs, k = 1e6",
    "k = 1e5, stick-slide": "sticking friction: springs, k = 1e5",
    "k = 1e4, stick-slide": "k = 1e4",
    "k = 1e3, stick-slide": "k = 1e3",
}


def digest(files, folder=RESULTS):
    """The description of a figure of these files."""
    content = b"".join((folder / file).read_bytes() for file in files)
    return f"{', '.join(files)}: sha256 {hashlib.sha256(content).hexdigest()}"


def _write(name, files, panels, draw, x, y, scale="linear", xscale=None, share=True, wide=3, share_x=True):
    """Panels, at most `wide` side by side, each drawn by a function of its axes, with one legend.
    All have the same range in y, or with `share="col"` those of a column."""
    wide = min(wide, len(panels))
    high = math.ceil(len(panels) / wide)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            high, wide, figsize=(7.2, 0.9 + 2.2 * high), sharex=share_x, sharey=share, squeeze=False, layout="constrained"
        )
        axes = list(axes.flat)
        for ax, (title, panel) in zip(axes, panels.items()):
            ax.set(title=title, xscale=xscale or scale, yscale=scale)
            draw(ax, panel)
            ax.tick_params(labelbottom=True)
        for ax in axes[len(panels) :]:
            ax.remove()
        figure.supxlabel(x, fontsize=9)
        figure.supylabel(y, fontsize=9)
        handles = {label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels())}
        figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=2 if len(handles) > 3 else 3)
        figure.savefig(RESULTS / name, metadata={"Date": None, "Description": digest(files)})
        plt.close(figure)


def _mark(ax, points, x, y):
    """Marks points whose runs are not in steady state, as the figures of `sweep` do."""
    trends = [trend(row, "viscosity") for row in points.to_dict("records")]
    for name, marker in {"not steady": "o", "ordering": "s"}.items():
        is_so = np.array([found == name for found in trends], dtype=bool)
        style = {"marker": marker, "markersize": 8, "markerfacecolor": "none", "markeredgecolor": "#1a1a1a", "markeredgewidth": 0.6}
        if is_so.any():
            ax.plot(np.asarray(x)[is_so], np.asarray(y)[is_so], linestyle="", label=name, **style)


def _thickening(design, x):
    """Rises of the viscosity against a fraction, a panel for each friction."""
    effects = pd.read_csv(RESULTS / design.effects)
    effects = effects[effects["kind"] == "rise"]

    def draw(ax, panel):
        for (choice, label), colour, marker in zip(MODELS.items(), COLOURS, MARKERS):
            points = panel[panel["choice"] == choice]
            if len(points):
                style = {"color": colour, "marker": marker, "markersize": 4, "linewidth": 1, "capsize": 2, "label": label}
                ax.errorbar(points[design.fraction], points["factor"], points["factor_ci95"], **style)
                _mark(ax, points, points[design.fraction], points["factor"])
        ticks = 2 ** np.arange(math.ceil(math.log2(effects["factor"].max())) + 1)
        ax.set_yticks(ticks, ticks)
        ax.yaxis.minorticks_off()

    panels = {f"ν = {friction:g}": panel for friction, panel in effects.groupby("friction")}
    _write(f"{design.name}.svg", [design.effects], panels, draw, x, "η above / η below the transition", "log", "linear")


def thickening_of_layers():
    """Against the area fraction."""
    _thickening(LAYERS, "area fraction c")


def thickening_of_suspensions():
    """Against the volume fraction."""
    _thickening(SUSPENSIONS, "volume fraction φ")


def beside():
    """The published table and ours in its units, a panel for each area fraction."""
    files = ["published-2d.csv", "published-2d.reference.csv"]
    ours, theirs = (pd.read_csv(RESULTS / file) for file in files)
    units = ours.apply(lambda row: PublishedUnits(row["area_fraction"], row["size_ratio"], row["large_fraction"]), axis=1)
    # Layers that do not flow have no rate.
    stresses = zip(units, ours["viscosity"], ours["shear_rate"])
    in_their_units = {
        "published_viscosity": [unit.viscosity(eta) for unit, eta in zip(units, ours["viscosity"])],
        "published_stress": [6 * math.pi * unit.shear_stress(eta, rate) for unit, eta, rate in stresses],
    }
    ours = pd.concat([ours, pd.DataFrame(in_their_units)], axis=1)
    usual = ours.query("spheres == 200 and stiffness == 5348 and repulsion_length == 0.0441 and lubrication_regularisation == 0.001")
    # Parameters published for similar layers, and those that were fitted to the table.
    lines = {
        "published": theirs,
        "ours, ν = 1": usual.query("friction == 1 and repulsion == 1"),
        "ours, ν = 10 and 0.568 of the repulsion": usual.query("friction == 10 and repulsion == 0.568"),
    }

    def draw(ax, c):
        for (label, points), colour, marker in zip(lines.items(), COLOURS, MARKERS):
            points = points[points["area_fraction"] == c].dropna(subset=["published_viscosity"]).sort_values("published_stress")
            if len(points):
                style = {"color": colour, "marker": marker, "markersize": 3, "linewidth": 1, "label": label}
                ax.plot(points["published_stress"], points["published_viscosity"], **style)
                _mark(ax, points, points["published_stress"], points["published_viscosity"])

    panels = {f"c = {c:g}": c for c in sorted(ours["area_fraction"].unique())}
    _write("published-2d-beside.svg", files, panels, draw, "their stress 6π σ'", "their viscosity η'", scale="log")


def of_lattices():
    """Drag and viscosities of cubic lattices, and the far field alone."""
    points = pd.read_csv(RESULTS / lattices.FILE)
    # Nearer to contact a simple cubic lattice hides all others.
    points = points[(points["lattice"] != "SC") | (points["volume_fraction"] < 0.5)]

    def draw(ax, quantity):
        for (name, lattice), colour, marker in zip(points.groupby("lattice", sort=False), COLOURS[1:], MARKERS):
            style = {"color": colour, "linewidth": 1, "markersize": 4}
            ax.plot(lattice["volume_fraction"], lattice[quantity], marker=marker, label=name, **style)
            ax.plot(lattice["volume_fraction"], lattice[f"{quantity}_far_field"], linestyle=":", label="far field alone", **style | {"color": "grey"})
        if quantity == "drag":
            exact = points.dropna(subset=["drag_exact"])
            style = {"color": COLOURS[0], "marker": "+", "linestyle": "", "label": "SC, Zick & Homsy"}
            ax.plot(exact["volume_fraction"], exact["drag_exact"], **style)

    panels = {
        "drag over 6π μ a U": "drag",
        "η, strain along the axes": "viscosity_along_axes",
        "η, strain across them": "viscosity_across_axes",
    }
    _write("lattices.svg", [lattices.FILE], panels, draw, "volume fraction φ", "", "log", "linear")


def plateaus():
    """Viscosity against volume fraction, a panel for each friction: fits as lines, their jamming
    fractions dashed, published ones dotted."""
    points, fits = (pd.read_csv(RESULTS / file) for file in [jamming.PLATEAUS, jamming.FITS])
    lines = {
        "lubrication, k = 1e4": "hydrodynamics == 'lubrication' and stiffness == 1e4",
        "lubrication, k = 1e5": "hydrodynamics == 'lubrication' and stiffness == 1e5",
        "Ball-Melrose, rigid": "hydrodynamics == 'ball-melrose'",
        "full, rigid": "hydrodynamics == 'stokesian-dynamics'",
    }

    def draw(ax, friction):
        for (label, wanted), colour, marker in zip(lines.items(), COLOURS[1:], MARKERS):
            shown, fit = (table.query(f"friction == {friction} and {wanted}") for table in [points, fits])
            style = {"color": colour, "marker": marker, "markersize": 4, "linestyle": "", "capsize": 2, "label": label}
            ax.errorbar(shown["volume_fraction"], shown["viscosity"], shown["viscosity_ci95"], **style)
            _mark(ax, shown, shown["volume_fraction"], shown["viscosity"])
            for _, row in fit.iterrows():
                phi = np.linspace(shown["volume_fraction"].min(), shown["volume_fraction"].max(), 60)
                ax.plot(phi, jamming.viscosity(phi, row["alpha"], row["phi_j"]), color=colour, linewidth=0.8)
                ax.axvline(row["phi_j"], color=colour, linewidth=0.8, linestyle="--")
        if friction in jamming.PUBLISHED:
            ax.axvline(jamming.PUBLISHED[friction], color=COLOURS[0], linewidth=1, linestyle=":", label="φ_J of Mari et al.")

    panels = {f"ν = {friction:g}": friction for friction in sorted(points["friction"].unique())}
    files = [jamming.PLATEAUS, jamming.FITS]
    _write("suspension-plateaus.svg", files, panels, draw, "volume fraction φ", "relative viscosity η", "log", "linear")


def _network(name, along, x, groups):
    """The viscosity over its lowest value and the largest frictional cluster, a row a group."""
    file = f"{name}.csv"
    points = pd.read_csv(RESULTS / file).dropna(subset=["viscosity", "largest_cluster"]).copy()
    fractions = sorted(points["area_fraction"].unique())
    colours = dict(zip(fractions, plt.colormaps["viridis"](np.linspace(0, 0.9, len(fractions)))))
    # Rates 0 and infinity are drawn left and right of the others.
    finite = points[along][(points[along] > 0) & np.isfinite(points[along])]
    ends = {0.0: finite.min() / 10, math.inf: finite.max() * 10}
    words_of_ends = dict(zip(ends.values(), ["0", "∞"]))
    points["place"] = points[along].replace(ends)

    def draw(ax, panel):
        wanted, is_rise = panel
        for c, curve in points.query(wanted).groupby("area_fraction"):
            curve = curve.sort_values("place")
            height = curve["viscosity"] / curve["viscosity"].iloc[0] if is_rise else curve["largest_cluster"]
            ax.plot(curve["place"], height, color=colours[c], marker="o", markersize=3, linewidth=1, label=f"c = {c:g}")
            _mark(ax, curve, curve["place"], height)
        if is_rise:
            ax.set_yscale("log")
            ax.yaxis.set_major_formatter(LogFormatter())
            ax.yaxis.set_minor_formatter(LogFormatter())
        if not set(points[along]).isdisjoint(ends):
            places = sorted(points["place"].unique())
            ax.set_xticks(places, [words_of_ends.get(at, f"{at:g}") for at in places])
            ax.xaxis.minorticks_off()

    words = {"η over its lowest": True, "share in the largest cluster": False}
    panels = {f"{title}{word}": (wanted, is_rise) for title, wanted in groups.items() for word, is_rise in words.items()}
    _write(f"{name}-network.svg", [file], panels, draw, x, "", "linear", "log", "col", 2)


def network_of_flow_curve():
    """Against the imposed stress."""
    _network("flow-curve", "shear_stress", "shear stress σ* (F_crit/a²)", {"": "contact == 'linear-spring'"})


def network_of_figure_14():
    """Against the rate, for every area fraction that has a transition."""
    _network("figure-14", "shear_rate", "shear rate Γ", {"": "area_fraction > 0.5"})


def held_against_experiment():
    """Viscosity against the fraction, and friction law, with the law of Boyer et al."""
    points = pd.read_csv(RESULTS / held.STATES)
    points = points[points["hydrodynamics"] == "Ball-Melrose"]

    def draw(ax, panel):
        x, y, spaced = panel
        groups = points.groupby(["friction", "contacts"])
        for (((friction, contacts), group), colour, marker) in zip(groups, COLOURS[1:], MARKERS):
            half = group.get(f"{x}_ci95")
            style = {"color": colour, "marker": marker, "markersize": 4, "linestyle": "", "elinewidth": 0.8, "capsize": 2}
            ax.errorbar(group[x], group[y], group[f"{y}_ci95"], half, label=f"ν = {friction:g}, {contacts}", **style)
            _mark(ax, group, group[x], group[y])
        law = held.law("boyer2011", y, x)
        at = spaced(points[x].min(), points[x].max(), 100)
        ax.plot(at, [law(value) for value in at], color=COLOURS[0], linewidth=1, label="Boyer et al. 2011, experiment")
        ax.set_xlabel({"volume_fraction": "volume fraction φ", "viscous_number": "viscous number J"}[x])
        if x == "viscous_number":
            ax.set_xscale("log")
        if y == "viscosity":
            ax.set_yscale("log")

    panels = {
        "relative viscosity η": ("volume_fraction", "viscosity", np.linspace),
        "macroscopic friction coefficient μ = σ/P₂₂": ("viscous_number", "macroscopic_friction", np.geomspace),
    }
    _write(HELD, [held.STATES], panels, draw, "", "", share=False, wide=2, share_x=False)


def held_normal_stresses():
    """Normal stress differences against the fraction, of the same points."""
    points = pd.read_csv(RESULTS / held.STATES)
    points = points[(points["hydrodynamics"] == "Ball-Melrose") & (points["seeds"] > 1)]

    def draw(ax, y):
        groups = points.groupby(["friction", "contacts"])
        for place, (((friction, contacts), group), colour, marker) in enumerate(zip(groups, COLOURS[1:], MARKERS)):
            style = {"color": colour, "marker": marker, "markersize": 4, "linewidth": 0.6, "elinewidth": 0.8, "capsize": 2}
            group = group.sort_values("volume_fraction")
            at = group["volume_fraction"] + 0.001 * (place - 1.5)
            ax.errorbar(at, group[y], group[f"{y}_ci95"], label=f"ν = {friction:g}, {contacts}", **style)
            _mark(ax, group, at, group[y])
        ax.axhline(0, color=COLOURS[0], linewidth=0.6)

    panels = {"N₁/σ": "n1_over_stress", "N₂/σ": "n2_over_stress"}
    _write("held-normal-stresses.svg", [held.STATES], panels, draw, "volume fraction φ", "", share=False, wide=2)


def order():
    """Viscosity and layering of rigid layers while they are sheared, of one size and of two."""
    points = pd.read_csv(RESULTS / ORDER)
    points = points[(points["hydrodynamics"] == "ball-melrose") & (points["contact"] == "rigid") & (points["spheres"] == 98)]
    points["middle"] = [sum(map(float, strains.split(" to "))) / 2 for strains in points["strains"]]

    def draw(ax, panel):
        size_ratio, y = panel
        groups = points[points["size_ratio"] == size_ratio].groupby(["area_fraction", "shear_rate"])
        for (((c, rate), group), colour, marker) in zip(groups, COLOURS, MARKERS):
            style = {"color": colour, "marker": marker, "markersize": 4, "linewidth": 1, "elinewidth": 0.8, "capsize": 2}
            rate = "∞" if math.isinf(rate) else f"{rate:g}"
            ax.errorbar(group["middle"], group[y], group[f"{y}_ci95"], label=f"c = {c:g}, Γ = {rate}", **style)
        if y == "viscosity":
            ax.set_yscale("log")
            ax.yaxis.set_major_formatter(LogFormatter())
            ax.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(2, 0.5)))

    quantities = {"η": "viscosity", "layering": "layering"}
    sizes = {"equal spheres": 1.0, "1 : 1.4": 1.4}
    panels = {f"{quantity}, {size}": (ratio, y) for quantity, y in quantities.items() for size, ratio in sizes.items()}
    _write("ordering.svg", [ORDER], panels, draw, "strain", "", share="row", wide=2)


def imposed_pressure():
    """Fraction and friction coefficient against the viscous number, with the law of Boyer et al.:
    rigid contacts as full symbols, springs as open ones."""
    points = pd.read_csv(RESULTS / limits.STATES)
    points = points[points["spheres"] == 200]

    def draw(ax, y):
        for ((friction, group), colour, marker) in zip(points.groupby("friction"), COLOURS[1:], MARKERS):
            for contact, filled in [("rigid", colour), ("linear-spring", "white")]:
                shown = group[group["contact"] == contact].sort_values("viscous_number")
                style = {"color": colour, "marker": marker, "markersize": 4, "markerfacecolor": filled, "elinewidth": 0.8, "capsize": 2}
                label = f"ν = {friction:g}" if contact == "rigid" else None
                ax.errorbar(shown["viscous_number"], shown[y], shown[f"{y}_ci95"], linestyle="", label=label, **style)
                _mark(ax, shown, shown["viscous_number"], shown[y])
            line = group.sort_values("viscous_number")
            ax.plot(line["viscous_number"], line[y], color=colour, linewidth=0.6)
        law = held.law("boyer2011", y.replace("fraction", "volume_fraction"), "viscous_number")
        at = np.geomspace(points["viscous_number"].min(), 0.2, 100)
        ax.plot(at, [law(value) for value in at], color=COLOURS[0], linewidth=1, label="Boyer et al. 2011, experiment")
        ax.set_xscale("log")
        if y == "macroscopic_friction":
            ax.set_yscale("log")
            ax.set_yticks(ticks := [0.1, 0.2, 0.5, 1, 2, 5], [f"{tick:g}" for tick in ticks])
            ax.yaxis.minorticks_off()

    panels = {"volume fraction φ": "fraction", "macroscopic friction coefficient μ": "macroscopic_friction"}
    _write("mu-of-j.svg", [limits.STATES], panels, draw, "viscous number J", "", share=False, wide=2)


HELD = "held-against-experiment.svg"
ORDER = "ordering-windows.csv"
FIGURES = {
    HELD: (held_against_experiment, [held.STATES]),
    "held-normal-stresses.svg": (held_normal_stresses, [held.STATES]),
    "cause-of-thickening.svg": (thickening_of_layers, [LAYERS.effects]),
    "cause-of-thickening-bulk.svg": (thickening_of_suspensions, [SUSPENSIONS.effects]),
    "published-2d-beside.svg": (beside, ["published-2d.csv", "published-2d.reference.csv"]),
    "lattices.svg": (of_lattices, [lattices.FILE]),
    "suspension-plateaus.svg": (plateaus, [jamming.PLATEAUS, jamming.FITS]),
    "flow-curve-network.svg": (network_of_flow_curve, ["flow-curve.csv"]),
    "figure-14-network.svg": (network_of_figure_14, ["figure-14.csv"]),
    "ordering.svg": (order, [ORDER]),
    "mu-of-j.svg": (imposed_pressure, [limits.STATES]),
}


def _made():
    """The figures whose files exist, with these files."""
    return {name: found for name, found in FIGURES.items() if all((RESULTS / file).exists() for file in found[1])}


def make():
    for draw, _ in _made().values():
        draw()


def outdated():
    """Figures whose files have changed since they were drawn."""

    def shows(name, files):
        return (RESULTS / name).exists() and digest(files) in (RESULTS / name).read_text(encoding="utf-8")

    return [name for name, (_, files) in _made().items() if not shows(name, files)]
