"""Makes and checks results/published.

    scripts/published [NAME...]    runs what is missing of these campaigns (default: all) and writes their reports and figures, then
                                   the tables; hours on two cores for all; safe to interrupt and to give again
    scripts/published --tables     only what is made of several files, and the tables of results/published/README.md
    scripts/published --check      writes nothing; fails where a table, an effect or a figure is not what its CSV files give, or a
                                   sentence quotes a number that no table has; names the results that another physics made

SWEEP=/path/to/sweep scripts/published NAME takes a program built before, so that building does not change it half-way.
"""

import argparse
import sys

import pandas as pd

from . import campaigns, figures, jamming, quotes, reports, tables, thickening
from .place import RESULTS, Wrong, physics_of_the_program

PAGE = RESULTS / "README.md"
# The only table that no file gives.
BY_HAND = ["| File | Made by | With | Physics |"]


def write_tables():
    # Effects and fits come first, since tables and figures show them.
    (RESULTS / thickening.EFFECTS).write_text(thickening.as_csv(thickening.effects(thickening.read())), encoding="utf-8")
    jamming.make()
    figures.make()
    PAGE.write_text(tables.with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


def faults():
    """What is not as it should be."""
    there, made = pd.read_csv(RESULTS / thickening.EFFECTS), thickening.effects(thickening.read())
    try:
        pd.testing.assert_frame_equal(there, made, check_dtype=False, rtol=1e-9)
    except AssertionError as error:
        yield f"{thickening.EFFECTS} is not what the runs give: {error}"
    if jamming.is_outdated():
        yield f"{jamming.FITS} is not what {jamming.PLATEAUS} gives"
    for name in figures.outdated():
        yield f"{name} shows other numbers than its files have"
    page = PAGE.read_text(encoding="utf-8")
    for line, wanted in zip(page.splitlines(), tables.with_tables(page).splitlines()):
        if line != wanted:
            yield f"README.md has\n  {line}\nwhere its files give\n  {wanted}"
    for heading in tables.by_hand(page):
        if heading not in BY_HAND:
            yield f"README.md: a table without a marker before it: {heading}"
    for file in reports.files_of_no_result():
        yield f"{file}: of no result in a list of README.md"
    yield from quotes.wrong()


def check():
    present = physics_of_the_program()
    for name in campaigns.CAMPAIGNS:
        if not reports.is_made(name):
            print(f"{name}: not made yet")
            continue
        report = reports.Report(name)
        if report.physics != [present]:
            print(f"{name}: stale, made by physics {' and '.join(map(str, report.physics))}, while the program has {present}")
    found = list(faults())
    for fault in found:
        print(fault, file=sys.stderr)
    if found:
        print("scripts/published --tables makes tables and figures anew", file=sys.stderr)
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
