"""The questions of the campaigns `cause-of-thickening`: sums and differences of rises.

A question is a sum over pairs of a weight and a model. It is about one of three viscosities: the whole
one (ALL), stresslets alone as in eq. (20) of the paper (STRESSLETS), or the ratio of the first to the
second (RATIO), which is the contribution of the contact stress.
"""

import math
from dataclasses import dataclass, replace

ALL, STRESSLETS, RATIO = "all", "stresslets", "ratio"
RIGID = math.inf
SPRINGS = [1e5, 1e4, 1e3]
NORMALS = [RIGID, *SPRINGS]
LUBRICATION = "lubrication"
FULL = "stokesian-dynamics"


@dataclass(frozen=True)
class Model:
    """A model of the design, with Ball-Melrose hydrodynamics by default."""

    stiffness: float
    # Whether friction sticks: coulomb on rigid contacts, stick-slide on springs.
    sticks: bool
    hydrodynamics: str = "ball-melrose"

    def under(self, hydrodynamics):
        return replace(self, hydrodynamics=hydrodynamics)

    @property
    def tangential(self):
        """The friction law, in the word of the campaign file."""
        if not self.sticks:
            return "roll-slip"
        return "coulomb" if self.stiffness == RIGID else "stick-slide"

    @property
    def words(self):
        hydrodynamics = {"ball-melrose": "", LUBRICATION: ", lubrication only", FULL: ", full Stokesian Dynamics"}[self.hydrodynamics]
        return f"{normal(self.stiffness)}, {self.tangential}{hydrodynamics}"


@dataclass(frozen=True)
class Question:
    kind: str
    choice: str
    sum: list
    counted: str = ALL


def normal(stiffness):
    """A normal law in words."""
    return "rigid" if stiffness == RIGID else f"k = 1e{round(math.log10(stiffness))}"


def alone(model):
    return [(1.0, model)]


def less(one, other):
    """One model less another."""
    return [(1.0, one), (-1.0, other)]


def mean(sums):
    return [(weight / len(sums), model) for terms in sums for weight, model in terms]


def sticking(stiffness):
    """The effect of sticking friction, with Ball-Melrose hydrodynamics."""
    return less(Model(stiffness, True), Model(stiffness, False))


def rises():
    """The rise of every model that was run."""
    yield Question("rise", "rigid, roll-slip, stresslets alone", alone(Model(RIGID, False)), STRESSLETS)
    models = [Model(stiffness, sticks) for sticks in [False, True] for stiffness in NORMALS]
    models.append(Model(1e6, True))
    for hydrodynamics in [LUBRICATION, FULL]:
        models += [Model(stiffness, sticks, hydrodynamics) for stiffness in [RIGID, 1e4] for sticks in [False, True]]
    for model in models:
        yield Question("rise", model.words, alone(model))


def steps():
    """From the paper's model to the soft-sphere model, one choice after the other: these add up."""
    paper, field = Model(RIGID, False), Model(1e4, True, LUBRICATION)
    yield Question("step", "the paper: rigid, roll-slip, stresslets alone", alone(paper), STRESSLETS)
    yield Question("step", "× contact stress included", alone(paper), RATIO)
    yield Question("step", "× springs of k = 1e5", less(Model(1e5, False), paper))
    yield Question("step", "× sticking friction", sticking(1e5))
    yield Question("step", "× softer springs, k = 1e4", less(Model(1e4, True), Model(1e5, True)))
    yield Question("step", "× lubrication only", less(field, Model(1e4, True)))
    yield Question("step", "= soft-sphere model", alone(field))


def main_effects():
    """The effect of each choice, averaged over the others."""
    seven = [Model(stiffness, False) for stiffness in NORMALS] + [Model(stiffness, True) for stiffness in SPRINGS]
    three = [Model(RIGID, False), Model(1e4, False), Model(1e4, True)]

    def softer(stiffness):
        return mean([less(Model(stiffness, sticks), Model(1e5, sticks)) for sticks in [False, True]])

    yield Question("main", "contact stress included", mean([alone(model) for model in seven]), RATIO)
    yield Question("main", "sticking friction", mean([sticking(stiffness) for stiffness in SPRINGS]))
    for sticks, word in [(False, "roll-slip"), (True, "sticking")]:
        choice = f"springs of k = 1e5 in place of rigid contacts ({word})"
        yield Question("main", choice, less(Model(1e5, sticks), Model(RIGID, sticks)))
    yield Question("main", "k = 1e4 in place of 1e5", softer(1e4))
    yield Question("main", "k = 1e3 in place of 1e5", softer(1e3))
    for hydrodynamics, word in [(LUBRICATION, "lubrication only"), (FULL, "full Stokesian Dynamics")]:
        under = mean([less(model.under(hydrodynamics), model) for model in three])
        yield Question("main", f"{word} in place of Ball-Melrose", under)


def questions():
    return [*rises(), *steps(), *main_effects()]
