"""Tables of the published results, made from their CSV files.

A table stands between two comments, of which the first says how it is made:

    <!-- table: figure-13 | rows: shear_rate | columns: hydrodynamics | cells: viscosity | where: friction=0.3 -->
    <!-- end -->

- `rows`: the columns of the file that name a row; `columns`: the one whose values head the columns.
- `cells`: numbers, with half their 95 % intervals if the file has those. `NAME (OTHER)` adds another
  number in brackets, `NAME %` is in per cent, `NAME_se` has one standard error in place of the interval,
  and `published_viscosity` is in the units of published soft-sphere simulations.
- `where`: only rows with these values, `friction=0.3|1`.
- `labels`: `0.00348=0.1` shows values of `columns` near the first number as the second;
  `columns: shear_stress as published_stress` then gives them another name.

Averages of runs that are not in steady state have a mark, which is explained below the table.

Published numbers of others are in NAME.reference.csv and keep their digits. Other tables are those of
`sweep pair` (`<!-- table: figure-08-a.txt, figure-08-b.txt -->`), of `sweep fit`
(`<!-- table: flow-curve-fit.json -->`) and of the campaigns (`<!-- table: campaigns -->`). A table
of files that do not exist yet is left out.
"""

from . import fits, passing, reports
from .pivot import Pivot
from .place import RESULTS, Wrong
from .steady import MARKS

BEGIN = "<!-- table: "
END = "<!-- end -->"


def markdown(lines):
    """Lines of cells, the first of them the headings."""
    rows = ["| " + " | ".join(line) + " |" for line in lines]
    rows.insert(1, "|" + " --- |" * len(lines[0]))
    return "\n".join(rows)


def _legend(lines):
    """The meaning of the marks in a table, as lines below it."""
    cells = [cell for line in lines[1:] for cell in line]
    words = [f"{mark} {name}" for name, mark in MARKS.items() if any(mark in cell for cell in cells)]
    return ["", ", ".join(words)] if words else []


def _lines(parts, folder):
    """The lines of a table; None if one of its files does not exist."""
    if parts[0] == "campaigns":
        return [["campaign", "made by", "CPU time", "state"], *map(list, reports.states())]
    files = parts[0].split(", ")
    pivot = None
    if not files[0].endswith((".txt", ".json")):
        pivot, files = Pivot.parse(parts[1:]), [f"{parts[0]}.csv"]
    if not all((folder / file).exists() for file in files):
        return None
    if pivot:
        return pivot.table(folder / files[0])
    return (passing if files[0].endswith(".txt") else fits).table(folder, files)


def with_tables(page, folder=RESULTS):
    """A page with every table rewritten."""
    made, lines = [], iter(page.splitlines())
    for line in lines:
        made.append(line)
        if not (line.startswith(BEGIN) and line.endswith("-->")):
            continue
        try:
            table = _lines(line.removeprefix(BEGIN).removesuffix("-->").strip().split(" | "), folder)
        except Wrong as error:
            raise Wrong(f"{line}\n{error}") from error
        made += [markdown(table), *_legend(table), END] if table else [END]
        if END not in lines:
            raise Wrong(f"{line}\nhas no {END}")
    return "\n".join(made) + "\n"
