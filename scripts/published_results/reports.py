"""What reports say about themselves: the CPU time of their runs, and which programs made them.

A result is stale when its report names another physics than the program has.
"""

import re

from .campaigns import CAMPAIGNS, NAMES
from .place import RESULTS, Wrong, physics_of_the_program

_TIME = re.compile(r"^computed in (.*?) of (?:processor|CPU) time", re.MULTILINE)
_PHYSICS = re.compile(r"\bphysics (\d+)")
# Pages that scripts measure.
PAGES = {"hard.md": "scripts/hard", "performance.md": "scripts/bench"}


def _state(text, present):
    physics = {int(number) for number in _PHYSICS.findall(text)}
    if not physics:
        raise Wrong(f"{text[:40]!r}... names no physics")
    return "current" if physics == {present} else "stale"


def states():
    """A row for each campaign and measured page: its name, how it is made, its CPU time if known,
    and whether it is current, stale or not made yet."""
    present = physics_of_the_program()
    for name in CAMPAIGNS:
        how = f"`scripts/published {name}`"
        report = RESULTS / f"{name}.txt"
        if not report.exists():
            yield name, how, "", "not made yet"
            continue
        text = report.read_text(encoding="utf-8")
        time = _TIME.search(text)
        if not time:
            raise Wrong(f"{name}.txt does not say what CPU time its runs took")
        yield name, how, time[1], _state(text, present)
    for name, script in PAGES.items():
        yield name, f"`{script}`", "", _state((RESULTS / name).read_text(encoding="utf-8"), present)


def files_of_no_result():
    """Files of results/published that belong neither to a campaign nor to a page."""
    pages = "".join(page.read_text(encoding="utf-8") for page in RESULTS.glob("*.md"))
    campaigns = tuple(f"{name}{end}" for name in NAMES for end in "-.")
    files = (file.name for file in sorted(RESULTS.iterdir()) if file.suffix != ".md")
    return [name for name in files if not name.startswith(campaigns) and name not in pages]
