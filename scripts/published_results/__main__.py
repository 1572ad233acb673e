"""Makes and checks results/published.

    scripts/published [NAME...]    runs what is missing of these campaigns (default: all) and writes
                                   their reports and figures, then does what --tables does; hours on
                                   two cores for all; may be interrupted and repeated
    scripts/published --tables     writes what is made of several files, and every table and quoted
                                   number of the pages; names the sentences to read again: those whose
                                   numbers changed, and those whose claims no longer hold
    scripts/published --check      writes nothing; lists stale campaigns and those not made yet; fails
                                   where --tables would write or name anything

SWEEP=/path/to/sweep scripts/published NAME takes a program built before, so that building does not
change it half-way.
"""

import argparse
import re
import sys

import pandas as pd

from . import campaigns, figures, held, jamming, limits, reports, slopes, tables, thickening, values
from .place import RESULTS, ROOT, Wrong


def derived():
    """The files that are made of other files, if those are there, with their tables."""
    for design in [thickening.LAYERS, thickening.SUSPENSIONS]:
        if design.there():
            yield RESULTS / design.effects, thickening.effects(design, design.read())
    if (RESULTS / jamming.PLATEAUS).exists():
        yield RESULTS / jamming.FITS, jamming.read()
    if limits.there():
        for name, table in limits.read().items():
            yield RESULTS / name, table
    if held.there():
        for name, table in held.read().items():
            yield RESULTS / name, table
    for name, table in slopes.read().items():
        yield RESULTS / name, table


def pages():
    """Every page that may have tables, quoted numbers or claims: its path and text, the text as it
    should be, and the sentences to read again."""
    quoted = values.Values()
    for path in [*sorted(RESULTS.glob("*.md")), ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        text = path.read_text(encoding="utf-8")
        wanted, again = quoted.written(tables.with_tables(text))
        yield path, text, wanted, [f"{path.relative_to(ROOT)}: {sentence}" for sentence in again]


def write_tables():
    for path, table in derived():
        # The last digits depend on the order of sums.
        table.to_csv(path, index=False, lineterminator="\n", float_format="%.10g")
    figures.make()
    for path, text, wanted, again in pages():
        if wanted != text:
            path.write_text(wanted, encoding="utf-8")
        print("".join(f"read again: {sentence}\n" for sentence in again), end="")


def lines_of_the_first_screen():
    """Lines of the table in README.md that quickstart.txt does not have."""
    blocks = re.findall(r"```text\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    shown = [line for block in blocks if "viscosity" in block for line in block.splitlines()]
    printed = (RESULTS / "quickstart.txt").read_text(encoding="utf-8").splitlines()
    there = {line.rstrip() for line in printed}
    return [line for line in shown if line.rstrip() not in there and not line.startswith(("─", "═"))]


def faults():
    """What is not as it should be."""
    for path, table in derived():
        try:
            pd.testing.assert_frame_equal(pd.read_csv(path), table, check_dtype=False, rtol=1e-6)
        except (AssertionError, FileNotFoundError) as error:
            yield f"{path.name} is not what its sources give: {error}"
    for name in figures.outdated():
        yield f"{name} shows other numbers than its files have"
    for path, text, wanted, again in pages():
        lines = zip(text.splitlines(), wanted.splitlines())
        tables_that_differ = (pair for pair in lines if pair[0] != pair[1] and "|" in pair[0][:1] + pair[1][:1])
        for line, new in [*tables_that_differ][:1]:
            yield f"{path.relative_to(ROOT)} has first\n  {line}\nwhere its files give\n  {new}"
        yield from again
    for file in reports.files_of_no_result():
        yield f"{file}: no page and no campaign names it"
    for line in lines_of_the_first_screen():
        yield f"README.md: {line!r} is not in results/published/quickstart.txt"


def check():
    for name, how, _, state in reports.states():
        if state != "current":
            print(f"{name}: {state}; {how.strip('`')} makes it")
    found = list(faults())
    for fault in found:
        print(fault, file=sys.stderr)
    if found:
        print("scripts/published --tables writes tables, figures and quoted numbers", file=sys.stderr)
    return 1 if found else 0


def main():
    parser = argparse.ArgumentParser(
        prog="scripts/published", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--tables", action="store_true")
    what.add_argument("--check", action="store_true")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(campaigns.NAMES))
    given = parser.parse_args()
    for name in given.names:
        if name not in campaigns.NAMES:
            parser.error(f"there is no campaign {name}; there are {', '.join(campaigns.NAMES)}")
    if given.check:
        return check()
    if not given.tables:
        for name in given.names or campaigns.NAMES:
            campaigns.make(name)
    write_tables()
    return 0


try:
    sys.exit(main())
except Wrong as error:
    print(f"scripts/published: {error}", file=sys.stderr)
    sys.exit(1)
