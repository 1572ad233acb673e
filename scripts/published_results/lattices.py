"""Cubic lattices of equal spheres, solved by `sweep solve`: the drag on fixed spheres in a stream
and the two independent viscosities.

They are compared with closed forms of the far field (H. Hasimoto, J. Fluid Mech. 5, 317 (1959);
M. Zuzovsky, P. M. Adler & H. Brenner, Phys. Fluids 26, 1714 (1983)), the exact drag of simple cubic
lattices (A. A. Zick & G. M. Homsy, J. Fluid Mech. 115, 13 (1982), table 2), and exact slopes of the
viscosities against one over the gap (K. C. Nunan & J. B. Keller, J. Fluid Mech. 142, 269 (1984)).
"""

import json
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from .place import RESULTS, sweep

# Largest distance of pairs in full Stokesian Dynamics: half the least width of a cell.
REACH = 4.0
FILE, NEAR_FILE = "lattices.csv", "lattices-near-contact.csv"


@dataclass(frozen=True)
class Lattice:
    # Centres in a cubic cell of side 1.
    centres: list
    # Distance of next neighbours in this cell.
    neighbours: float
    # Coefficients of the closed forms, of the drag and of the viscosities.
    hasimoto: float
    a: float
    b: float
    # Slopes of the viscosities, strain along and across the axes; None if logarithmic.
    slopes: tuple


_CENTRE, _FACES = [0.5, 0.5, 0.5], [[0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.5, 0.5, 0.0]]
LATTICES = {
    "SC": Lattice([[0.0] * 3], 1.0, 1.7601, 0.28556, -0.04645, (3 * math.pi / 8, None)),
    "BCC": Lattice([[0.0] * 3, _CENTRE], math.sqrt(3) / 2, 1.7919, -0.08990, 0.01432, (None, math.sqrt(3) * math.pi / 4)),
    "FCC": Lattice(
        [[0.0] * 3, *_FACES],
        math.sqrt(0.5),
        1.7917,
        -0.06860,
        0.01273,
        (3 * math.pi / (8 * math.sqrt(2)), 3 * math.pi / (4 * math.sqrt(2))),
    ),
}
# Of Zick and Homsy, simple cubic, over that of an isolated sphere; the last is at contact, pi/6.
EXACT_DRAG = {0.027: 2.008, 0.064: 2.810, 0.125: 4.292, 0.216: 7.442, 0.343: 15.4, 0.45: 28.1, 0.5235: 42.1}
FRACTIONS = {"SC": list(EXACT_DRAG), "BCC": [0.027, 0.125, 0.216, 0.343, 0.45, 0.6], "FCC": [0.027, 0.125, 0.216, 0.343, 0.45, 0.6]}
# Gaps between which a slope is taken, in radii.
GAPS = [1e-3, 1e-4]


def side(lattice, volume_fraction):
    """Of the cubic cell with one or a few spheres of radius 1."""
    return (len(lattice.centres) * 4 * math.pi / 3 / volume_fraction) ** (1 / 3)


def far_field(lattice, phi):
    """Drag and viscosities, along the axes and across them, of the far field alone."""
    drag = 1 / (1 - lattice.hasimoto * phi ** (1 / 3) + phi)
    along = 1 + 2.5 * phi / (1 - (1 - 60 * lattice.b) * phi + 12 * lattice.a * phi ** (5 / 3))
    across = 1 + 2.5 * phi / (1 - (1 + 40 * lattice.b) * phi - 8 * lattice.a * phi ** (5 / 3))
    return drag, along, across


def solved(lattice, width, hydrodynamics):
    """Drag and viscosities of a lattice with this side of its cubic cell."""
    number = math.ceil(2 * REACH / width)
    corners = [[i, j, k] for i in range(number) for j in range(number) for k in range(number)]
    centres = [[(c + x) * width for c, x in zip(corner, centre)] for corner in corners for centre in lattice.centres]
    # By symmetry both strains and the force are independent: one solution has all three.
    along, across = 0.3, 0.5
    configuration = {
        "centres": centres,
        "cell": [number * width] * 3,
        "hydrodynamics": hydrodynamics,
        "background": {"rate_of_strain": {"xx": along, "yy": -along, "xy": across}, "angular_velocity": [0, 0, 0]},
        "forces": [[1, 0, 0]] * len(centres),
    }
    with tempfile.TemporaryDirectory() as folder:
        asked, answer = Path(folder) / "lattice.json", Path(folder) / "answer.json"
        asked.write_text(json.dumps(configuration), encoding="utf-8")
        sweep("solve", asked, "--json", "--quiet", output=answer)
        given = json.loads(answer.read_text(encoding="utf-8"))
    density = len(lattice.centres) / width**3
    xx, yy, xy = (given[f"stresslet_{name}"][0] for name in ["xx", "yy", "xy"])
    return (
        1 / (6 * math.pi * given["velocity_disturbance"][0][0]),
        1 + density * (xx - yy) / (4 * along),
        1 + density * xy / (2 * across),
    )


def drags_and_viscosities():
    """A row for each lattice and volume fraction, under full Stokesian Dynamics."""
    for name, fractions in FRACTIONS.items():
        for phi in fractions:
            lattice = LATTICES[name]
            here, far = solved(lattice, side(lattice, phi), "stokesian-dynamics"), far_field(lattice, phi)
            row = {"lattice": name, "volume_fraction": phi}
            for quantity, number, alone in zip(["drag", "viscosity_along_axes", "viscosity_across_axes"], here, far):
                row |= {quantity: number, f"{quantity}_far_field": alone}
            yield row | {"drag_exact": EXACT_DRAG.get(phi) if name == "SC" else None}


def slopes():
    """A row for each slope near contact, from Ball-Melrose hydrodynamics."""
    for name, lattice in LATTICES.items():
        near, nearer = (solved(lattice, (2 + gap) / lattice.neighbours, "ball-melrose")[1:] for gap in GAPS)
        for strain, one, other, exact in zip(["along the axes", "across the axes"], near, nearer, lattice.slopes):
            if exact is not None:
                yield {
                    "lattice": name,
                    "strain": strain,
                    "slope": (other - one) / (1 / GAPS[1] - 1 / GAPS[0]),
                    "slope_exact": exact,
                }


def make():
    """Both tables."""
    for file, rows in [(FILE, drags_and_viscosities()), (NEAR_FILE, slopes())]:
        # The last digits depend on the order of sums.
        pd.DataFrame(rows).to_csv(RESULTS / file, index=False, lineterminator="\n", float_format="%.10g")
