"""A table from a CSV file: its rows, its columns and the contents of its cells."""

import math
from dataclasses import dataclass, field

import pandas as pd
from scipy.stats import t as student

from .numbers import interval, plain, short, significant
from .place import Wrong
from .steady import MARKS, trend
from .units import PublishedUnits

# Relative difference between a value and its label.
NEAR = 0.15
COUNTS = ["seeds", "jammed", "failed", "doubtful", "jammed_stages", "spheres", "starts", "points"]
# Published numbers in our files, which keep their digits.
OF_OTHERS = ["drag_exact", "phi_j_published"]
# Laws of others at our states.
LAWS = ["viscosity_boyer", "macroscopic_friction_boyer", "fraction_boyer", "published"]
# Ending of what is shown with one standard error.
OF_ERROR = "_se"
# What columns are called; axes by their symbols.
SYMBOLS = {
    "area_fraction": "c",
    "volume_fraction": "φ",
    "friction": "ν",
    "shear_rate": "Γ",
    "shear_stress": "σ*",
    "roughness": "h",
    "stiffness": "k",
    "hydrodynamic_friction": "α",
    "slope_in_stress": "d ln η/d ln σ",
    "spheres": "N",
    "time_step": "Δt",
    "repulsion": "F0",
    "repulsion_length": "l",
    "lubrication_regularisation": "δ",
    "viscosity": "η",
    "published_viscosity": "η'",
    "viscosity_median": "median η",
    "viscosity_stresslet": "η_S",
    "seeds": "runs",
    "contacts_per_sphere": "contacts / N",
    "activated_fraction": "activated",
    "rolling_fraction": "rolling",
    "minimum_gap": "smallest gap",
    "mean_approach_velocity": "approach velocity",
    "unconverged_fraction": "unconverged",
    "overlap": "largest overlap",
    "n1": "N1",
    "peclet": "Pe",
    "shear_brownian": "Brownian part of η",
    "shear_hydrodynamic": "fluid part",
    "shear_repulsion": "repulsion part",
    "shear_normal_contact": "contact part",
    "shear_tangential_contact": "friction part",
    "diffusivity_yy": "D_yy/(a²γ̇)",
    "diffusivity_zz": "D_zz/(a²γ̇)",
    "n2": "N2",
    "phi_j": "φ_J",
    "phi_j_published": "φ_J, published",
    "mu_c": "μ_c",
    "slope_of_fraction": "K",
    "slope_of_friction": "b",
    "fraction": "mean φ",
    "imposed_viscous_number": "imposed J",
    "alpha": "α",
    "drag_far_field": "far field alone",
    "drag_exact": "Zick & Homsy",
    "viscosity_along_axes": "η, strain along the axes",
    "viscosity_along_axes_far_field": "far field alone",
    "viscosity_across_axes": "η, strain across them",
    "viscosity_across_axes_far_field": "far field alone",
    "slope_exact": "exact",
    "published_stress": "6π σ'",
    "viscosity_boyer": "η, Boyer et al. at φ",
    "viscous_number": "J",
    "macroscopic_friction": "μ",
    "macroscopic_friction_boyer": "μ, Boyer et al. at J",
    "fraction_boyer": "φ, Boyer et al. at J",
    "n1_over_stress": "N1/σ",
    "n2_over_stress": "N2/σ",
    "factor": "η above / η below",
}


def symbol(column):
    """What a column is called."""
    if column.endswith(OF_ERROR):
        return f"{symbol(column.removesuffix(OF_ERROR))} ± one standard error"
    return SYMBOLS.get(column, column.replace("_", " "))


def number(row, column):
    """A number of a row; not a number where there is none."""
    try:
        return float(row[column])
    except (KeyError, ValueError):
        return math.nan


def is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def word(value):
    """A value of the file as it is shown."""
    if not is_number(value):
        return value or "–"
    return "∞" if math.isinf(float(value)) else short(float(value), 4)


def same(one, other):
    """Whether two values of a file, or of a marker, are the same."""
    return float(one) == float(other) if is_number(one) and is_number(other) else one == other


def ordered(values):
    """Numbers by size, words in the order of the file."""
    values = list(dict.fromkeys(values))
    return sorted(values, key=float) if all(map(is_number, values)) else values


@dataclass
class Shown:
    """What a cell shows."""

    quantity: str
    percent: bool
    beside: str | None

    @classmethod
    def parse(cls, text):
        text, _, beside = text.partition(" (")
        return cls(text.removesuffix(" %"), text.endswith(" %"), beside.rstrip(")") or None)

    def columns(self):
        """The columns that the file must have."""
        column = "area_fraction" if self.quantity == "published_viscosity" else self.quantity.removesuffix(OF_ERROR)
        return [column] + ([self.beside] if self.beside else [])

    def value(self, row):
        """The number, and half its interval."""
        if self.quantity.endswith(OF_ERROR):
            column = self.quantity.removesuffix(OF_ERROR)
            return number(row, column), number(row, f"{column}_ci95") / student.ppf(0.975, number(row, "seeds") - 1)
        if self.quantity == "published_viscosity" and self.quantity not in row:
            units = PublishedUnits(*(number(row, name) for name in ["area_fraction", "size_ratio", "large_fraction"]))
            return units.viscosity(number(row, "viscosity")), units.difference(number(row, "viscosity_ci95"))
        scale = 100 if self.percent else 1
        return scale * number(row, self.quantity), scale * number(row, f"{self.quantity}_ci95")

    def as_written(self, row):
        """A published number with its digits."""
        column = self.quantity.removesuffix(OF_ERROR)
        error = row.get(self.quantity) if self.quantity.endswith(OF_ERROR) else ""
        return f"{row[column]} ± {error}" if error else row[column]

    def cell(self, row):
        value, half = self.value(row)
        if math.isnan(value):
            text = "–"
        elif not math.isnan(half):
            text = interval(value, half)
        elif self.quantity in COUNTS + OF_OTHERS:
            text = plain(value)
        else:
            text = significant(value, 3 if self.percent or self.quantity in LAWS else 4)
        if self.percent and text != "–":
            text += " %"
        if text != "–" and self.quantity not in LAWS and (found := trend(row, self.quantity.removesuffix(OF_ERROR))):
            text += f" {MARKS[found]}"
        return f"{text} ({short(number(row, self.beside), 3)})" if self.beside else text

    def heading(self):
        return symbol(self.quantity) + (f" ({symbol(self.beside)})" if self.beside else "")


def _pairs(text, separator):
    pairs = [part.strip().split(separator, 1) for part in text.split(", ")]
    if bad := [pair for pair in pairs if len(pair) != 2]:
        raise Wrong(f"{bad[0][0]!r} has no {separator!r}")
    return pairs


def chosen(file, wanted, columns):
    """The rows of a file that have a wanted value in each column; `columns` must exist too."""
    if not file.exists():
        raise Wrong(f"there is no {file.name}")
    data = pd.read_csv(file, dtype=str, keep_default_na=False)
    for column in [*columns, *(column for column, _ in wanted)]:
        if column not in data:
            raise Wrong(f"{file.name} has no column {column}")
    for column, values in wanted:
        for value in values:
            if not data[column].map(lambda there: same(there, value)).any():
                raise Wrong(f"no row of {file.name} has {column} = {value}")
        data = data[data[column].map(lambda there: any(same(there, value) for value in values))]
    return [row.to_dict() for _, row in data.iterrows()]


@dataclass
class Pivot:
    """How a table is made."""

    rows: list = field(default_factory=list)
    columns: str | None = None
    # Another name for `columns`.
    called: str | None = None
    labels: list = field(default_factory=list)
    cells: list = field(default_factory=list)
    wanted: list = field(default_factory=list)

    @classmethod
    def parse(cls, parts):
        """From the parts of a comment."""
        pivot = cls()
        for part in parts:
            key, colon, text = part.strip().partition(": ")
            if not colon:
                raise Wrong(f"{part!r} is no KEY: VALUES")
            match key:
                case "rows":
                    pivot.rows = [name.strip() for name in text.split(", ")]
                case "columns":
                    pivot.columns, _, called = text.partition(" as ")
                    pivot.called = called or None
                case "cells":
                    pivot.cells = [Shown.parse(cell.strip()) for cell in text.split(", ")]
                case "where":
                    pivot.wanted = [(name, values.split("|")) for name, values in _pairs(text, "=")]
                case "labels":
                    pivot.labels = [(float(value), label) for value, label in _pairs(text, "=")]
                case _:
                    raise Wrong(f"no part of a table is called {key}")
        return pivot

    def _place(self, row):
        """Where a row stands: its value of `columns`, or the label near that."""
        if not self.columns:
            return ""
        if not self.labels:
            return row[self.columns]
        value = number(row, self.columns)
        distance, label = min((abs(math.log(value / labelled)), label) for labelled, label in self.labels)
        if not distance < NEAR:
            raise Wrong(f"{self.columns} = {value} has no label")
        return label

    def table(self, file):
        """The lines of the table of a file."""
        cells, keys, places = {}, [], []
        named = [*self.rows, *([self.columns] if self.columns else [])]
        shown = [column for shown in self.cells for column in shown.columns()]
        for row in chosen(file, self.wanted, named + shown):
            key, place = tuple(row[column] for column in self.rows), self._place(row)
            if (key, place) in cells:
                raise Wrong(f"several rows of {file.name} share a cell")
            cells[key, place] = row
            keys.append(key)
            places.append(place)
        # By the first column of a row, then by the next.
        keys = list(dict.fromkeys(keys))
        for at in reversed(range(len(self.rows))):
            rank = {value: rank for rank, value in enumerate(ordered(key[at] for key in keys))}
            keys.sort(key=lambda key, at=at, rank=rank: rank[key[at]])
        places = ordered(places)
        are_of_others = ".reference" in file.name
        lines = [self._headings(places)]
        for key in keys:
            line = [word(value) for value in key]
            for shown in self.cells:
                write = shown.as_written if are_of_others else shown.cell
                line += [write(cells[key, place]) if (key, place) in cells else "" for place in places]
            lines.append(line)
        return lines

    def _headings(self, places):
        line = [symbol(column) for column in self.rows]
        axis = symbol(self.called or self.columns or "")
        are_numbers = all(map(is_number, places))
        for shown in self.cells:
            for at, place in enumerate(places):
                place = f"{axis} = {word(place)}" if at == 0 and are_numbers else word(place)
                if not self.columns:
                    line.append(shown.heading())
                else:
                    line.append(place if len(self.cells) == 1 else f"{shown.heading()}, {place}")
        return line
