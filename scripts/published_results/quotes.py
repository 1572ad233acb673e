"""Numbers that sentences quote from tables.

One rule: a number with an interval (`0.516 ± 0.039`, `0.6 ± 0.6 %`) or a signed percentage (`+14 %`) stands in a table of a page of
results/published in just these characters. A sentence may leave out the sign and say it in words. Any other number is the author's own business.
The rule holds for results/published/README.md, and for README.md and the pages of docs that link to it; text in fences is no sentence.
"""

import re

from .place import RESULTS, ROOT

_NUMBER = r"\d+(?:\.\d+)?(?:e-?\d+)?"
QUOTED = re.compile(rf"[-+]?{_NUMBER} ± {_NUMBER}(?: %)?|(?<!\d)[-+]{_NUMBER} %")


def in_tables(*pages):
    """All such numbers of the tables, with their signs and without."""
    lines = (line for page in pages for line in page.splitlines() if line.startswith("|"))
    found = {number for line in lines for number in QUOTED.findall(line)}
    return found | {number.lstrip("+-") for number in found}


def not_in_tables(text, known):
    """Numbers that sentences quote and no table has."""
    prose = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    lines = (line for line in prose.splitlines() if not line.startswith("|"))
    return [number for line in lines for number in QUOTED.findall(line) if number not in known]


def lines_of_the_first_screen():
    """Lines of the table in README.md that quickstart.txt does not have."""
    blocks = re.findall(r"```text\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    block = next(block for block in blocks if "viscosity" in block)
    printed = (RESULTS / "quickstart.txt").read_text(encoding="utf-8").splitlines()
    there = {line.rstrip() for line in printed}
    return [line for line in block.splitlines() if line.rstrip() not in there and not line.startswith(("─", "═"))]


def wrong():
    """What is quoted and does not stand in a table, by page."""
    known = in_tables(*(page.read_text(encoding="utf-8") for page in RESULTS.glob("*.md")))
    for path in [RESULTS / "README.md", ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        text = path.read_text(encoding="utf-8")
        if path.parent == RESULTS or "results/published/README.md" in text:
            for number in not_in_tables(text, known):
                yield f"{path.relative_to(ROOT)}: {number} stands in no table of results/published"
    for line in lines_of_the_first_screen():
        yield f"README.md: {line!r} is not in results/published/quickstart.txt"
