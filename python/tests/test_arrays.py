"""Array arguments: valid and invalid dtypes, strides and shapes, and other bad input."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from conftest import PARAMS, refused

import sheared_layers as sl

CENTRES = np.array([[0.0, 0.0], [3.0, 0.5], [6.0, 0.0]])
WANTED = sl.solve(CENTRES).velocity_disturbance


@pytest.mark.parametrize(
    "same",
    [
        np.asfortranarray(CENTRES),
        np.repeat(CENTRES, 2, axis=0)[::2],
        np.hstack([CENTRES, CENTRES])[:, :2],
        CENTRES[::-1][::-1],
        CENTRES.astype("float32"),
        CENTRES.astype(">f8"),
        CENTRES.tolist(),
        tuple(map(tuple, CENTRES)),
        np.ma.masked_array(CENTRES),
    ],
    ids=["columns first", "every other", "a part", "backwards", "single", "other endian", "lists", "tuples", "masked"],
)
def test_what_is_like_an_array_is_taken(same):
    np.testing.assert_array_equal(sl.solve(same).velocity_disturbance, WANTED)


def test_backwards_is_another_order():
    np.testing.assert_array_equal(sl.solve(CENTRES[::-1]).velocity_disturbance.shape, (3, 2))
    np.testing.assert_allclose(sl.solve(CENTRES[::-1]).velocity_disturbance, WANTED[::-1], atol=1e-12)


def test_whole_numbers_are_numbers():
    whole = np.array([[0, 0], [3, 0]])
    np.testing.assert_array_equal(
        sl.solve(whole).velocity_disturbance, sl.solve(whole.astype(float)).velocity_disturbance
    )


def test_what_is_given_stays_as_it_is():
    given = CENTRES.copy()
    given.flags.writeable = False
    sl.solve(given)
    np.testing.assert_array_equal(given, CENTRES)


BAD = [
    (dict(centres=np.zeros(3)), ValueError, ["centres", "(3,)", "(N, 2)"]),
    (dict(centres=np.zeros((2, 4))), ValueError, ["centres", "(2, 4)", "(N, 2)"]),
    (dict(centres=np.zeros((2, 2, 2))), ValueError, ["centres", "(2, 2, 2)", "(N, 2)"]),
    (dict(centres=[[0, 0], [1]]), ValueError, ["centres", "(N, 2)"]),
    (dict(centres=CENTRES.astype(complex)), TypeError, ["centres", "complex128", "float64"]),
    (dict(centres=CENTRES.astype(str)), TypeError, ["centres", "float64"]),
    (dict(centres=CENTRES.astype(object)), TypeError, ["centres", "object", "float64"]),
    (dict(centres=CENTRES > 0), TypeError, ["centres", "bool", "float64"]),
    (dict(centres=CENTRES.astype("longdouble")), TypeError, ["centres", "float64"]),
    (dict(centres=None), TypeError, ["centres", "object", "float64"]),
    (dict(centres=np.zeros((0, 2))), ValueError, ["at least one sphere"]),
    (dict(centres=[[0, 0], [math.nan, 1]]), ValueError, ["centres", "NaN", "finite"]),
    (dict(centres=[[0, 0], [math.inf, 1]]), ValueError, ["centres", "inf", "finite"]),
    (dict(centres=[[0, 0], [1.9, 0]]), ValueError, ["spheres 0 and 1 overlap", "gap"]),
    (dict(radii=np.ones((3, 1))), ValueError, ["radii", "(3, 1)", "(N,)"]),
    (dict(radii=np.ones(2)), ValueError, ["radii", "2", "3"]),
    (dict(radii=[1, 1, -1]), ValueError, ["radii", "-1", "positive"]),
    (dict(radii=[1, 1, math.nan]), ValueError, ["radii", "NaN"]),
    (dict(forces=np.zeros((3, 3))), ValueError, ["forces", "(3, 3)", "(N, 2)"]),
    (dict(forces=np.full((3, 2), math.nan)), ValueError, ["forces", "NaN", "finite"]),
    (dict(torques=np.zeros((3, 2))), ValueError, ["torques", "(3, 2)", "(N,)"]),
    (dict(torques="none"), TypeError, ["torques", "float64"]),
    (dict(cell=[5.0]), ValueError, ["cell"]),
    (dict(cell=[0.5, 12.0]), ValueError, ["0.5"]),
    (dict(cell="wide"), ValueError, ["cell", "wide"]),
    (dict(offset=1.0), ValueError, ["offset", "cell"]),
    (dict(hydrodynamics="stokes"), ValueError, ["hydrodynamics", "stokes", "stokesian-dynamics", "ball-melrose"]),
    (dict(background={"xy": 1}), (ValueError, TypeError), ["background", "xy", "rate_of_strain"]),
    (dict(background=object()), TypeError, ["background", "object", "dict"]),
    (dict(contact={"scheme": "rigid"}), ValueError, ["contact.roughness", "rigid"]),
    (dict(contact={"scheme": "glue"}), ValueError, ["contact", "glue", "rigid"]),
    (
        dict(contact={"scheme": "rigid", "roughness": 0.01, "friction": -1, "critical_load": 0}),
        ValueError,
        ["contact.friction", "-1"],
    ),
    (dict(contact={"scheme": "listed", "pairs": [[0, 7]]}), ValueError, ["pair [0, 7]"]),
    (dict(radius=1.0), TypeError, ["radius", "radii", "centres"]),
]


@pytest.mark.parametrize(("given", "kind", "words"), BAD, ids=[str(k) for k in range(len(BAD))])
def test_bad_input_is_named_with_what_is_allowed(given, kind, words):
    with pytest.raises(kind) as raised:
        sl.solve(**{"centres": CENTRES, **given})
    # The name of an argument of another type is a note.
    text = "\n".join([str(raised.value), *getattr(raised.value, "__notes__", [])])
    for word in words:
        assert word in text, text


def test_errors_have_the_words_of_the_command():
    body = '{"centres": [[0, 0], [1.9, 0]], "hydrodynamics": "ball-melrose"}'
    with pytest.raises(ValueError) as raised:
        sl.solve([[0, 0], [1.9, 0]], hydrodynamics="ball-melrose")
    assert str(raised.value) in refused("solve", "-", text=body)
    with pytest.raises(ValueError) as raised:
        sl.scalars(1.0, 1.5)
    assert str(raised.value) in refused("scalars", "--size-ratio", 1, "--separation", 1.5)


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda: sl.scalars(0.0, 3.0), ValueError, ["size_ratio"]),
        (lambda: sl.scalars(1.0, math.nan), ValueError, ["NaN", "above 2"]),
        (lambda: sl.scalars(1.0, "far"), TypeError, ["separation", "float64"]),
        (lambda: sl.scalars("one", 3.0), TypeError, ["size_ratio"]),
        (lambda: sl.scalars(1.0), TypeError, ["separation"]),
        (lambda: sl.pair(friction=-1.0), ValueError, ["friction", "-1", "0 to 10"]),
        (lambda: sl.pair(roughness=math.nan), ValueError, ["roughness", "NaN"]),
        (lambda: sl.pair(offset=0.0), ValueError, ["offset", "0"]),
        (lambda: sl.pair(time_step=0.0), ValueError, ["time_step"]),
        (lambda: sl.pair(size_ratio=1e9), ValueError, ["size_ratio", "0.01 to 100"]),
        (lambda: sl.pair(rough=0.1), TypeError, ["rough"]),
        (lambda: sl.Layer({}, 1), ValueError, ["area_fraction"]),
        (lambda: sl.Layer({**PARAMS, "friction": -1}, 1), ValueError, ["friction", "-1", "0 to 10"]),
        (lambda: sl.Layer({**PARAMS, "friction": math.nan}, 1), ValueError, ["friction", "nan"]),
        (lambda: sl.Layer({**PARAMS, "friction": "much"}, 1), ValueError, ["friction", "number"]),
        (lambda: sl.Layer({**PARAMS, "friction": [0.1, 0.2]}, 1), ValueError, ["friction", "one"]),
        (lambda: sl.Layer({**PARAMS, "fricton": 0.1}, 1), ValueError, ["fricton", "friction"]),
        (lambda: sl.Layer({**PARAMS, "friction": object()}, 1), TypeError, ["friction", "object"]),
        (lambda: sl.Layer({**PARAMS, "seeds": 3}, 1), TypeError, ["seeds", "seed"]),
        (lambda: sl.Layer({**PARAMS, "area_fraction": 0.95}, 1), ValueError, ["area_fraction", "0.95"]),
        (lambda: sl.Layer({**PARAMS, "spheres": 4}, 1), ValueError, ["spheres"]),
        (lambda: sl.Layer({**PARAMS, "spheres": 2**80}, 1), ValueError, ["spheres"]),
        (lambda: sl.Layer({**PARAMS, "hydrodynamics": "none"}, 1), ValueError, ["hydrodynamics", "ball-melrose"]),
        (lambda: sl.Layer({**PARAMS, "time_step": -0.1}, 1), ValueError, ["time_step", "-0.1"]),
        (lambda: sl.Layer(PARAMS, -1), (ValueError, OverflowError), [""]),
        (lambda: sl.Layer(PARAMS, "one"), TypeError, ["seed"]),
        (lambda: sl.Layer("layer", 1), TypeError, ["params"]),
        (lambda: sl.Layer.from_snapshot(PARAMS, b"junk"), ValueError, ["snapshot", "not a checkpoint"]),
    ],
)
def test_other_bad_input_is_named_too(call, kind, words):
    with pytest.raises(kind) as raised:
        call()
    # The name of an argument of another type is a note.
    text = "\n".join([str(raised.value), *getattr(raised.value, "__notes__", [])])
    for word in words:
        assert word in text, text


NUMPIES = {
    "broken": ('raise RuntimeError("half of it is missing")', "half of it is missing"),
    "without an interface": ('__version__ = "2.3.0"', "numpy.lib"),
    "too old": ('__version__ = "1.20.3"', "numpy 1.20.3 is installed"),
    "of tomorrow": ('__version__ = "3.0.0"', "numpy 3.0.0 is installed"),
}


@pytest.mark.parametrize("numpy", NUMPIES)
def test_a_numpy_that_cannot_be_used_is_an_import_error_in_words(numpy, tmp_path):
    source, words = NUMPIES[numpy]
    (tmp_path / "numpy").mkdir()
    (tmp_path / "numpy/__init__.py").write_text(source)
    script = """
import sheared_layers as sl
params = {"area_fraction": 0.5, "roughness": 0.01, "friction": 0.5, "shear_rate": 1.0, "spheres": 12, "hydrodynamics": "ball-melrose"}
for call in [
    lambda: sl.scalars(1.0, 3.0),
    lambda: sl.pair(),
    lambda: sl.solve([[0.0, 0.0], [3.0, 0.0]]),
    lambda: sl.Layer(params, 1),
]:
    try:
        call()
    except ImportError as error:
        print(error)
"""
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False)
    said = done.stdout.splitlines()
    assert done.returncode == 0 and len(said) == 4, done.stderr
    assert all(words in line and "pip install" in line for line in said), said


def test_a_suspension_has_three_columns():
    rng = np.random.default_rng(3)
    flat = np.array([[0.0, 0.0], [2.2, 0.5], [-1.0, 2.4]])
    forces = rng.normal(size=(3, 2))
    deep = np.column_stack([flat, np.zeros(3)])
    layer = sl.solve(flat, hydrodynamics="ball-melrose", forces=forces)
    solid = sl.solve(
        deep,
        hydrodynamics="ball-melrose",
        forces=np.column_stack([forces, np.zeros(3)]),
    )
    assert solid.velocity_disturbance.shape == (3, 3)
    assert solid.angular_velocity_disturbance.shape == (3, 3)
    # In unbounded fluid spheres in a plane stay in it.
    np.testing.assert_allclose(
        solid.velocity_disturbance[:, :2], layer.velocity_disturbance, atol=1e-9
    )
    np.testing.assert_allclose(solid.velocity_disturbance[:, 2], 0, atol=1e-12)
    np.testing.assert_allclose(
        solid.angular_velocity_disturbance[:, 2],
        layer.angular_velocity_disturbance,
        atol=1e-9,
    )
    assert layer.stresslet_xz is None
    np.testing.assert_allclose(solid.stresslet_xz, 0, atol=1e-12)
    assert solid.contacts["normal"].shape[1:] == (3,)
    with pytest.raises(ValueError, match=r"\(N, 3\)"):
        sl.solve(deep, hydrodynamics="ball-melrose", forces=forces)
