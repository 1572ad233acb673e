"""Tables of the published results, made from their CSV files.

A table of results/published/README.md stands between two comments, of which the first says how it is made:

    <!-- table: figure-13 | rows: shear_rate | columns: hydrodynamics | cells: viscosity, viscosity_stresslet | where: friction=0.3 -->
    <!-- end -->

- `rows`: columns of the file that name a row; `columns`: the one whose values stand side by side, if there is one.
- `cells`: what is shown, with half its 95 % interval if the file has one. `NAME (OTHER)` puts the other number into brackets, `NAME %` is
  a share in per cent. Besides the columns of the file there are `NAME_se` (± one standard error in place of the interval) and
  `published_viscosity` (in the units of published soft-sphere simulations, as `sweep convert` has it).
- `where`: only rows with these values, `friction=0.3|1`.
- `change`: `inf over 0` adds how much more, in per cent, each of `cells` is at one value of `columns` than at another.
- `labels`: `0.00348=0.1` shows values of `columns` near the first number under the second; `columns: shear_stress as published_stress`
  then calls them by another name.

Numbers of others stand in NAME.reference.csv, and keep the digits that they gave. Instead of a CSV file a table can be pairs of spheres
as `sweep pair` tells of them (`<!-- table: figure-08-a.txt, figure-08-b.txt -->`), fits side by side as `sweep fit` gives them
(`<!-- table: flow-curve-rigid-fit.json -->`), or the list of the campaigns, with what each took and what made it, as NAME.txt has them
(`<!-- table: campaigns -->`). A table of files that were not made yet is left out.
"""

from . import fits, passing, reports
from .pivot import Pivot
from .place import RESULTS, Wrong

BEGIN = "<!-- table: "
END = "<!-- end -->"


def markdown(lines):
    """Lines of cells, the first of them the headings."""
    rows = ["| " + " | ".join(line) + " |" for line in lines]
    rows.insert(1, "|" + " --- |" * len(lines[0]))
    return "\n".join(rows)


def _lines(parts, folder):
    """The lines of a table; None where a file of it was not made yet."""
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
    """A page with every table between markers made anew."""
    made, lines = [], iter(page.splitlines())
    for line in lines:
        made.append(line)
        if not (line.startswith(BEGIN) and line.endswith("-->")):
            continue
        try:
            table = _lines(line.removeprefix(BEGIN).removesuffix("-->").strip().split(" | "), folder)
        except Wrong as error:
            raise Wrong(f"{line}\n{error}") from error
        made += [markdown(table), END] if table else [END]
        if END not in lines:
            raise Wrong(f"{line}\nhas no {END}")
    return "\n".join(made) + "\n"
