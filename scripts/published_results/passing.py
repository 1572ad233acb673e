"""Two spheres that passed each other, from what `sweep pair` printed."""

import re

from .numbers import significant
from .place import Wrong

_NUMBER = r"\s*(-?[0-9.]+(?:e-?\d+)?)"


def table(folder, files):
    """A line for each file."""
    lines = [["file", "rotation in degrees", "of the second", "offset at the end", "smallest gap", "time"]]
    for file in files:
        text = (folder / file).read_text(encoding="utf-8")

        def after(label, count=1):
            found = re.search(re.escape(label) + (r",?" + _NUMBER) * count, text)
            if not found:
                raise Wrong(f"{file} has no {label!r}")
            return [significant(float(number), 4) for number in found.groups()]

        rotations = after("rotation in degrees", 2)
        rest = [after(label)[0] for label in ["offset at the end", "smallest gap", ", time"]]
        lines.append([f"`{file}`", *rotations, *rest])
    return lines
