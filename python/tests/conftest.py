"""Common fixtures: the command line, parameters of a small layer, a small finished campaign."""

import json
import os
import subprocess
from pathlib import Path

import pytest

import sheared_layers as sl

ROOT = Path(__file__).resolve().parents[2]
SWEEP = Path(os.environ.get("SWEEP", ROOT / "target/release/sweep"))

PARAMS = {
    "area_fraction": 0.65,
    "roughness": 0.01,
    "friction": 0.5,
    "shear_rate": 10.0,
    "spheres": 40,
    "hydrodynamics": "ball-melrose",
    "time_step": 0.005,
}
PROTOCOL = {"strain": 0.4, "discard": 0.2, "sample_every": 0.02, "checkpoint_every": 0.1}


def command(*arguments, text=None):
    """JSON output of the command line."""
    done = subprocess.run(
        [SWEEP, *map(str, arguments), "--json"], input=text, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def refused(*arguments, text=None):
    """Message of the command line about bad input."""
    done = subprocess.run(
        [SWEEP, *map(str, arguments)], input=text, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2, done.stderr
    return done.stderr


@pytest.fixture
def params():
    return dict(PARAMS)


def small_campaign(name="small", seeds=2, shear_rate=(0.1, float("inf"))):
    axes = {**PARAMS, "shear_rate": list(shear_rate)}
    return sl.Campaign(name, protocol=PROTOCOL, seeds=seeds, **axes)


@pytest.fixture(scope="session")
def store(tmp_path_factory):
    """The store of a small campaign, with frames."""
    path = tmp_path_factory.mktemp("store") / "small.sqlite"
    return small_campaign().run(path, progress=False, trajectory=True)
