"""Against the numbers of the command line, to the bit."""

import json

import numpy as np
import pytest
from conftest import command

import sheared_layers as sl

CENTRES = np.array([[0.0, 0.0], [2.05, 0.3], [4.2, -0.1], [1.1, 2.1]])
BODIES = {
    "unbounded": {"hydrodynamics": "stokesian-dynamics"},
    "sizes": {"hydrodynamics": "stokesian-dynamics", "radii": [1.0, 0.8, 1.0, 0.8]},
    "driven": {
        "hydrodynamics": "stokesian-dynamics",
        "background": {"rate_of_strain": {"xx": 0.25, "yy": -0.25, "xy": 0.0}, "angular_velocity": 0.5},
        "forces": [[1.0, 0.0], [0.0, -1.0], [0.5, 0.5], [0.0, 0.0]],
        "torques": [0.0, 1.0, 0.0, -1.0],
    },
    "periodic": {"hydrodynamics": "stokesian-dynamics", "cell": [12.0, 11.0], "offset": 1.5},
    "rigid": {
        "hydrodynamics": "ball-melrose",
        "cell": [12.0, 11.0],
        "contact": {"scheme": "rigid", "roughness": 0.1, "friction": 0.5, "critical_load": 0.0},
    },
    "procedure": {
        "hydrodynamics": "ball-melrose",
        "contact": {"scheme": "procedure", "roughness": 0.1, "friction": 0.5, "critical_load": 0.1},
    },
}


@pytest.mark.parametrize("body", BODIES)
def test_solve_is_the_command(body):
    given = BODIES[body]
    there = command("solve", "-", text=json.dumps({"centres": CENTRES.tolist(), **given}))
    here = sl.solve(CENTRES, **given)
    for name in [
        "velocity_disturbance",
        "angular_velocity_disturbance",
        "stresslet_xx",
        "stresslet_yy",
        "stresslet_xy",
    ]:
        np.testing.assert_array_equal(getattr(here, name), np.array(there[name]), name)
    stresses = ["n1", "n2", "particle_pressure", "pressure_hydrodynamic", "stress"]
    for name in ["viscosity", "viscosity_stresslet", "dissipation", *stresses]:
        assert getattr(here, name) == there[name], name
    contacts = here.contacts
    assert len(contacts) == len(there["contacts"])
    for mine, theirs in zip(contacts, there["contacts"]):
        for name, value in theirs.items():
            np.testing.assert_array_equal(mine[name], value, name)
    assert set(contacts.dtype.names) == set(there["contacts"][0] if there["contacts"] else contacts.dtype.names)


def test_cross_offset_is_that_of_the_command():
    # In contact across the upper face where the cell above is shifted along the vorticity.
    centres = np.array([[4.0, 0.5, 3.0], [4.0, 6.4, 2.0]])
    given = {"hydrodynamics": "ball-melrose", "cell": [8.0, 8.0, 8.0], "forces": [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]}
    viscosities = []
    for cross_offset in [0.0, -1.0]:
        there = command("solve", "-", text=json.dumps({"centres": centres.tolist(), "cross_offset": cross_offset, **given}))
        here = sl.solve(centres, cross_offset=cross_offset, **given)
        assert here.viscosity == there["viscosity"]
        viscosities.append(here.viscosity)
    assert viscosities[0] != viscosities[1]


def test_scalars_are_the_command():
    there = command("scalars", "--size-ratio", 0.5, "--separation", 2.1)
    here = sl.scalars(0.5, 2.1)
    assert list(here) == [name for name in here if name in there]
    for name, values in here.items():
        np.testing.assert_array_equal(values, there[name], name)


def test_scalars_of_an_array_have_its_shape():
    separations = np.array([[2.1, 3.0], [4.0, 5.0]])
    many = sl.scalars(1.0, separations)
    assert many["XA"].shape == (2, 2, 2)
    np.testing.assert_array_equal(many["YB"][1, 0], sl.scalars(1.0, 4.0)["YB"])
    # Far apart each sphere is alone: Stokes' drag, and none from the other.
    np.testing.assert_allclose(sl.scalars(1.0, 1e6)["XA"], [1, 0], atol=2e-6)


def test_pair_is_the_command():
    there = command("pair", "--roughness", 0.05, "--friction", 0.5)
    here = sl.pair(roughness=0.05, friction=0.5)
    for name in ["final_offset", "minimum_gap", "time"]:
        assert getattr(here, name) == there[name], name
    np.testing.assert_array_equal(here.rotation_degrees, there["rotation_degrees"])
    np.testing.assert_array_equal(here.path, there["path"])


def test_smooth_spheres_pass_symmetrically():
    passed = sl.pair(contact=False, time_step=0.1)
    assert abs(passed.final_offset - 0.25) < 1e-6
    assert sl.pair(roughness=0.05, time_step=0.1).final_offset > 0.3
