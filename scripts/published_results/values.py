"""Numbers that pages quote from the published results, and conditions on which their claims rest.

results/published/values.txt names every number that is quoted, one a line:

    NAME | FILE | COLUMN | KEY=VALUE | ... | FORM

This is the cell of FILE.csv in COLUMN and in the only row with these values. FILE, COLUMN or a VALUE
may be two, `A/B`, for two cells that are compared; of two files each is searched by the keys that it
has. FORM says what is quoted: `number`, the cell to three digits, or `rounded` to two; `factor`, A over
B to two digits; `excess`, A less 1 over B less 1; `more` or `less`, how much more or less A is than B, in per cent.

In a page a number stands before a comment with its name, `rises 1.4<!-- value: NAME --> times`. Words
without a number stand before a comment with a condition on values, in the form in which they would be
quoted: `does not rise<!-- claim: 0.97 < NAME, NAME < 1.03 -->`; `PART*` there stands for all names that
begin so. No such comment may begin a line, where Markdown takes the rest of the line for HTML.

A sentence that quotes averages of runs that are not in steady state must say so, as `not steady`, `not in
steady state` or `ordering`; otherwise it is named too.
"""

import math
import re

import pandas as pd

from .numbers import short, significant
from .pivot import Shown, chosen
from .place import RESULTS, Wrong
from .steady import is_said, trend

_SENTENCE = re.compile(r"(\n\n+|\n(?=[-|#])|(?<=\.)\s+(?=[^\W\d_a-z]|\*\*))")
_MARKER = re.compile(r"(-?\d[\d.]*(?:e-?\d+)?(?: %)?)?<!--\s+(value|claim):\s+([^>]*?)\s+-->")
_FORMS = {
    "number": lambda a, b: a,
    "rounded": lambda a, b: a,
    "factor": lambda a, b: a / b,
    "excess": lambda a, b: (a - 1) / (b - 1),
    "more": lambda a, b: 100 * (a / b - 1),
    "less": lambda a, b: 100 * (1 - a / b),
}


class Values:
    """The values that have names."""

    def __init__(self, folder=RESULTS):
        self.folder = folder
        lines = (folder / "values.txt").read_text(encoding="utf-8").splitlines()
        self.lines = {line.split(" | ")[0]: line.split(" | ")[1:] for line in lines if " | " in line}

    def _row(self, fields, of_two):
        """The row of a cell, and what is shown of it."""
        file, column, *row = fields
        shown = Shown.parse(column)
        wanted = [(key, [value]) for key, value in (part.split("=", 1) for part in row)]
        if of_two:
            there = pd.read_csv(self.folder / f"{file}.csv", nrows=0)
            wanted = [(key, values) for key, values in wanted if key in there]
        rows = chosen(self.folder / f"{file}.csv", wanted, shown.columns())
        if len(rows) != 1 or math.isnan(shown.value(rows[0])[0]):
            raise Wrong(f"{file}.csv has {len(rows)} rows with a number there, where one is needed")
        return rows[0], shown

    def _sides(self, name):
        """The rows of the one or two cells of a value, and its form."""
        if name not in self.lines:
            raise Wrong("values.txt does not name it")
        *fields, form = self.lines[name]
        if form not in _FORMS:
            raise Wrong(f"there is no form {form}")
        # The text before a slash for one cell, that after it for the other.
        two = re.compile("^([^=]*=)?([^/]*)/(.*)")
        sides = [[two.sub(side, field) for field in fields] for side in [r"\1\2", r"\1\3"]]
        return [self._row(side, "/" in fields[0]) for side in sides], form

    def number(self, name):
        """A value, and the form in which it is quoted."""
        sides, form = self._sides(name)
        return _FORMS[form](*(shown.value(row)[0] for row, shown in sides)), form

    def trend(self, name):
        """What the runs of a value do, if they are not in steady state."""
        trends = [trend(row, shown.quantity) for row, shown in self._sides(name)[0]]
        return next(filter(None, trends), None)

    def text(self, name):
        """A value as it is written."""
        number, form = self.number(name)
        if form in ["more", "less"]:
            if number < 0:
                raise Wrong(f"{number:.2g} % {form}: the sentence has the wrong direction")
            return f"{number:.{1 if number < 9.95 else 0}f} %"
        percent = " %" if self.lines[name][1].endswith(" %") else ""
        return (short(number, 3) if form == "number" else significant(number, 2)) + percent

    def _named(self, text):
        """The names and numbers of a list between two signs `<`."""
        for part in map(str.strip, text.split(",")):
            found = [name for name in self.lines if part.endswith("*") and name.startswith(part[:-1])]
            yield from found or [part]

    def holds(self, claim):
        """Whether the numbers and values between the signs `<` of a claim rise."""

        def number(text):
            return self.number(text)[0] if text[0].isalpha() else float(text)

        places = [[number(text) for text in self._named(part)] for part in claim.split("<")]
        return all(max(low) < min(high) for low, high in zip(places, places[1:]))

    def written(self, page):
        """A page with the numbers that its comments name, and the sentences to read again: those
        whose number is another now, and those whose claims do not hold."""
        parts, again = [], []

        def write(match):
            number, kind, what = match.groups()
            try:
                names = [name for part in what.split("<") for name in self._named(part)]
                for name in names if not is_said(sentence) else []:
                    if name[:1].isalpha() and (found := self.trend(name)):
                        raise Wrong(f"the runs of {name} are {found}, which the sentence must say")
                if kind == "claim" and not self.holds(what):
                    raise Wrong("does not hold")
                if kind == "claim" or number == self.text(what):
                    return match[0]
                if not number:
                    raise Wrong("there is no number before it")
                again.append(f"{number} is now {self.text(what)}: {sentence}")
                return match[0].replace(number, self.text(what), 1)
            except Wrong as error:
                again.append(f"{' '.join(what.split())}: {error}: {sentence}")
                return match[0]

        for part in _SENTENCE.split(page):
            sentence = " ".join(_MARKER.sub(r"\1", part).split())
            parts.append(_MARKER.sub(write, part))
        again += [f"a comment begins this line: {line}" for line in page.splitlines() if re.match(r"\s*<!-- [vc]", line)]
        return "".join(parts), again
