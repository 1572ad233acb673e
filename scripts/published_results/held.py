"""Suspensions held against experiment and published simulations.

States are those with sticking friction of `cause-of-thickening-bulk` above the transition, from its
runs, and those of `suspension-plateaus`, from its points. Published laws are those of `sweep report
--reference`, from the program's own file.

    J = μ rate / P₂₂,  μ = σ / P₂₂,  P₂₂ = −Σ_yy, of the contacts; in files without it Π + (N₁ − N₂)/3
"""

import json
import math

import numpy as np
import pandas as pd
from scipy.stats import t as student

from . import jamming
from .place import RESULTS, ROOT
from .steady import marks_of, points_of, read_runs, trend
from .thickening import ABOVE, SUSPENSIONS

STATES, QUANTITIES = "held-states.csv", "held-quantities.csv"
RUNS, PLATEAUS, ONE_SIZE = "cause-of-thickening-bulk-runs.csv", jamming.PLATEAUS, "suspension.csv"
HIGH_FREQUENCY = "suspension-random.csv"
SOURCES = [RUNS, points_of(RUNS), PLATEAUS, ONE_SIZE, HIGH_FREQUENCY, jamming.FITS]
_REFERENCES = ROOT / "crates" / "sweep" / "src" / "report" / "references.json"
# Numbers of other publications, from memory too: name, source.
SIEROU = ("Sierou & Brady 2002, from memory", 7.0)
SINGH = ("Singh et al. 2018, from memory", {0.0: 0.646, 1.0: 0.565})
RIEST = "Riest et al. 2015"


def references():
    return {reference["name"]: reference for reference in json.loads(_REFERENCES.read_text(encoding="utf-8"))}


def law(name, y, x, friction=None):
    """A published law as a function, NaN outside its range."""
    for curve in references()[name]["curves"]:
        if (curve["y"], curve["x"], curve.get("friction")) == (y, x, friction):
            low, high = curve["range"]
            known = {at: value for at, value in curve.get("points", [])}
            allowed = {"sqrt": np.sqrt, "exp": np.exp, "__builtins__": {}}

            def value(at, curve=curve, known=known):
                if "formula" not in curve:
                    return known.get(at, math.nan)
                return eval(curve["formula"], {**allowed, "x": at}) if low <= at <= high else math.nan

            return value
    raise KeyError(f"{name} has no {y} against {x} at friction {friction}")


def _words(row):
    """The contacts and the hydrodynamics of a state."""
    stiffness = float(row["stiffness"])
    contacts = "rigid" if math.isinf(stiffness) else f"k = 1e{round(math.log10(stiffness))}"
    hydrodynamics = {"ball-melrose": "Ball-Melrose", "stokesian-dynamics": "full", "lubrication": "lubrication"}
    return {"contacts": contacts, "hydrodynamics": hydrodynamics[row["hydrodynamics"]]}


def pressure(row):
    """P₂₂ of a row, or of many."""
    if "pressure_22" in row:
        return row["pressure_22"]
    return row["particle_pressure"] + (row["n1"] - row["n2"]) / 3


def mean(values):
    """Mean over runs, and half its interval of 95 %."""
    values = np.asarray(values, dtype=float)
    if len(values) < 2:
        return values.mean(), math.nan
    return values.mean(), student.ppf(0.975, len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values))


def _of_runs(runs):
    """The states of a campaign with a table of its runs, with the marks of their points: ratios are means
    over runs."""
    counts = (runs["state"] == "done") & runs["doubts"].isna() & (runs["shear_rate"] == ABOVE)
    counts &= runs["spheres"] == SUSPENSIONS.spheres
    sticks = runs["tangential"].isin(["coulomb", "stick-slide"]) & (runs["hydrodynamics"] == "ball-melrose")
    runs = runs[counts & sticks & ~runs["stiffness"].isin([1e3, 1e4, 1e6])]
    keys = ["hydrodynamics", "stiffness", "friction", "volume_fraction"]
    for key, group in runs.groupby(keys, sort=True):
        p = pressure(group)
        numbers = {
            "viscosity": group["viscosity"],
            "viscous_number": 1 / p,
            "macroscopic_friction": group["viscosity"] / p,
            "n1_over_stress": group["n1"] / group["viscosity"],
            "n2_over_stress": group["n2"] / group["viscosity"],
        }
        row = dict(zip(keys, key))
        yield row | {"seeds": len(group)} | marks_of(group), {name: mean(values) for name, values in numbers.items()}


def _of_points(points):
    """The states of a table of points. Without intervals of the ratios these are those of their parts,
    as if independent."""
    points = points.dropna(subset=["viscosity"])
    wanted = (points["friction"] > 0) & ((points["hydrodynamics"] == "stokesian-dynamics") | (points["stiffness"] == 1e5))
    for _, row in points[wanted].iterrows():
        eta, p = row["viscosity"], pressure(row)
        halves = [row["particle_pressure_ci95"], row["n1_ci95"] / 3, row["n2_ci95"] / 3]
        of_p, of_eta = np.hypot(np.hypot(*halves[:2]), halves[2]) / p, row["viscosity_ci95"] / eta
        numbers = {
            "viscosity": (eta, row["viscosity_ci95"]),
            "viscous_number": (1 / p, of_p / p),
            "macroscopic_friction": (eta / p, np.hypot(of_p, of_eta) * eta / p),
            "n1_over_stress": (row["n1"] / eta, row["n1_ci95"] / eta),
            "n2_over_stress": (row["n2"] / eta, row["n2_ci95"] / eta),
        }
        for name in list(numbers):
            if name in row and not math.isnan(row[name]):
                numbers[name] = row[name], row[f"{name}_ci95"]
        keys = {key: row[key] for key in ["hydrodynamics", "stiffness", "friction", "volume_fraction", "seeds"]}
        yield keys | marks_of(pd.DataFrame([row])), numbers


def states(runs, plateaus):
    """A row for each state, with the law of Boyer et al. at its fraction and at its viscous number."""
    laws = {
        "viscosity_boyer": law("boyer2011", "viscosity", "volume_fraction"),
        "macroscopic_friction_boyer": law("boyer2011", "macroscopic_friction", "viscous_number"),
        "fraction_boyer": law("boyer2011", "volume_fraction", "viscous_number"),
    }
    rows = []
    for row, numbers in [*_of_runs(runs), *_of_points(plateaus)]:
        state = {"volume_fraction": row["volume_fraction"], "friction": row["friction"], **_words(row)}
        state |= {name: row[name] for name in ["seeds", "not_steady", "ordering"]}
        for name, (mean, half) in numbers.items():
            state |= {name: mean, f"{name}_ci95": half}
        state["viscosity_boyer"] = laws["viscosity_boyer"](row["volume_fraction"])
        for name in ["macroscopic_friction_boyer", "fraction_boyer"]:
            state[name] = laws[name](state["viscous_number"])
        rows.append(state)
    order = ["friction", "hydrodynamics", "contacts", "volume_fraction"]
    return pd.DataFrame(rows).sort_values(order, kind="stable", ignore_index=True)


def quantities(plateaus, one_size, high_frequency, fits, of_states, reference):
    """A row for each quantity that is held against a published number."""
    rows = []

    def add(quantity, state, row, column, published, source, less=0.0):
        found = trend(row, column)
        rows.append(
            {
                "quantity": quantity,
                "state": state,
                "source": source,
                "here": row[column] - less,
                "here_ci95": row[f"{column}_ci95"],
                "published": published,
                "not_steady": float(found == "not steady"),
                "ordering": float(found == "ordering"),
            }
        )

    def memory(name):
        authors, year = {"mari": "Mari et al.", "zarraga": "Zarraga et al.", "gallier": "Gallier et al.", "dai": "Dai et al."}, name[-4:]
        return f"{authors[name[:-4]]} {year}, from memory"

    soft = plateaus[(plateaus["hydrodynamics"] == "lubrication") & (plateaus["stiffness"] == 1e5)]
    for _, row in soft[soft["friction"].isin([0.0, 1.0])].iterrows():
        phi, friction = row["volume_fraction"], row["friction"]
        published = law("mari2014", "viscosity", "volume_fraction", friction)(phi)
        if not math.isnan(published):
            state = f"φ = {phi:g}, ν = {friction:g}, lubrication, k = 1e5"
            add("η − 5φ/2", state, row.to_dict(), "viscosity", published, memory("mari2014"), 2.5 * phi)
    stiff = of_states[of_states["contacts"].isin(["rigid", "k = 1e5"]) & (of_states["hydrodynamics"] == "Ball-Melrose")]
    for _, row in stiff[stiff["volume_fraction"] <= 0.55].iterrows():
        phi = row["volume_fraction"]
        state = f"φ = {phi:g}, ν = {row['friction']:g}, {row['contacts']}"
        add("η of experiments", state, row.to_dict(), "viscosity", law("zarraga2000", "viscosity", "volume_fraction")(phi), memory("zarraga2000"))
    for _, row in stiff[stiff["volume_fraction"] <= 0.5].iterrows():
        phi = row["volume_fraction"]
        state = f"φ = {phi:g}, ν = {row['friction']:g}, {row['contacts']}"
        published = law("dai2013", "n2_over_stress", "volume_fraction")(phi)
        add("N₂/σ of experiments", state, row.to_dict(), "n2_over_stress", published, memory("dai2013"))
    full = plateaus[(plateaus["hydrodynamics"] == "stokesian-dynamics") & (plateaus["friction"] == 0) & (plateaus["volume_fraction"] == 0.45)]
    for _, row in full.iterrows():
        add("η", "φ = 0.45, ν = 0, full Stokesian Dynamics, 1 : 1.4", row.to_dict(), "viscosity", SIEROU[1], SIEROU[0])
    equal = one_size[(one_size["volume_fraction"] == 0.45) & (one_size["hydrodynamics"] == "ball-melrose")]
    for _, row in equal[equal["friction"].isin([0.0, 0.5])].iterrows():
        published = law("gallier2014", "viscosity", "volume_fraction", row["friction"])(0.45)
        add("η", f"φ = 0.45, ν = {row['friction']:g}, one size", row.to_dict(), "viscosity", published, memory("gallier2014"))
    for _, row in fits[(fits["hydrodynamics"] == "lubrication") & (fits["stiffness"] == 1e5)].iterrows():
        if row["friction"] in SINGH[1]:
            state = f"ν = {row['friction']:g}, lubrication, k = 1e5, exponent 2"
            add("φ_J", state, row.to_dict(), "phi_j", SINGH[1][row["friction"]], SINGH[0])
    published = reference[(reference["volume_fraction"] == 0.5) & (reference["source"] == RIEST)]["viscosity"]
    for _, row in high_frequency[high_frequency["volume_fraction"] == 0.5].iterrows():
        add("η∞", "φ = 0.5, one size, full Stokesian Dynamics", row.to_dict(), "viscosity", float(published.iloc[0]), RIEST)
    return pd.DataFrame(rows)


def there(folder=RESULTS):
    """Whether the files that they are made of are published."""
    return all((folder / name).exists() for name in SOURCES)


def read(folder=RESULTS):
    """Both tables, by their files."""
    plateaus = pd.read_csv(folder / PLATEAUS)
    of_states = states(read_runs(folder, RUNS), plateaus)
    others = [pd.read_csv(folder / name) for name in [ONE_SIZE, HIGH_FREQUENCY]]
    reference = pd.read_csv(folder / HIGH_FREQUENCY.replace(".csv", ".reference.csv"))
    return {STATES: of_states, QUANTITIES: quantities(plateaus, *others, jamming.read(folder), of_states, reference)}
