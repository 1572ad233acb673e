"""What reports say of themselves: what their runs took, and which programs made them.

A result is stale when its report names another physics than the program has. Builds are digests of the program file, and differ after
every compilation: they are shown, and say nothing about the numbers.
"""

import re

from .campaigns import CAMPAIGNS
from .place import RESULTS, Wrong, physics_of_the_program

_TIME = re.compile(r"^computed in (.*?) of (?:processor|CPU) time", re.MULTILINE)
_MADE_BY = re.compile(r"\(physics (\d+), build ([0-9a-f]+)\)")


def is_made(name):
    """Whether a campaign has its report."""
    return (RESULTS / f"{name}.txt").exists()


class Report:
    """A file NAME.txt."""

    def __init__(self, name):
        text = (RESULTS / f"{name}.txt").read_text(encoding="utf-8")
        time, made_by = _TIME.search(text), _MADE_BY.findall(text)
        if not time or not made_by:
            raise Wrong(f"{name}.txt does not say what its runs took and which physics made them")
        self.time = time[1]
        self.physics = sorted({int(physics) for physics, _ in made_by})
        self.builds = list(dict.fromkeys(build for _, build in made_by))

    def cells(self, present):
        """Physics and builds for a table."""
        stale = ", stale" if self.physics != [present] else ""
        return " and ".join(map(str, self.physics)) + stale, ", ".join(f"`{build[:7]}`" for build in self.builds)


def table_of_campaigns():
    """The campaigns, what their runs took, and what made them."""
    present = physics_of_the_program()
    lines = [["campaign", "made by", "processor time", "physics", "build"]]
    for name in CAMPAIGNS:
        if is_made(name):
            report = Report(name)
            lines.append([name, f"`scripts/published {name}`", report.time, *report.cells(present)])
    return lines


def files_of_no_result():
    """Files of results/published that neither a campaign nor the page itself accounts for."""
    page = (RESULTS / "README.md").read_text(encoding="utf-8")
    listed = [line.split("|")[1].strip(" `") for line in page.splitlines() if line.startswith("|")]
    names = ["README.md", *CAMPAIGNS, *listed]
    return [file.name for file in sorted(RESULTS.iterdir()) if not any(file.name.startswith(name) for name in names if name)]
