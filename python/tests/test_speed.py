"""What the package costs above the program itself. Least times of several tries, since the machine may be busy.

Timings decide nothing in continuous integration: these run with SPEED=1 in the environment.
"""

import os
import re
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import PARAMS

import sheared_layers as sl

pytestmark = pytest.mark.skipif("SPEED" not in os.environ, reason="timings run with SPEED=1")

def test_solving_costs_twenty_microseconds_more_than_the_solver():
    layer = sl.Layer({**PARAMS, "spheres": 90}, 1)
    centres, side = layer.positions.copy(), layer.side
    contact = {"scheme": "rigid", "roughness": 0.01, "friction": 0.5, "critical_load": 1.9}

    def overhead():
        begun = time.perf_counter()
        solved = sl.solve(centres, cell=(side, side), hydrodynamics="ball-melrose", contact=contact)
        return time.perf_counter() - begun - solved.computing_time_s

    least = min(overhead() for _ in range(300))
    print(f"\nsolve of 90 spheres: {1e6 * least:.1f} us above the solver")
    assert least < 20e-6


@pytest.mark.parametrize("hydrodynamics", ["ball-melrose", "stokesian-dynamics"])
def test_a_step_costs_less_than_a_hundredth_more(hydrodynamics):
    layer = sl.Layer({**PARAMS, "spheres": 90, "hydrodynamics": hydrodynamics}, 1)

    def share():
        begun, computed = time.perf_counter(), layer.computing_time_s
        layer.step()
        took, computed = time.perf_counter() - begun, layer.computing_time_s - computed
        return (took - computed) / computed

    least = min(share() for _ in range(60))
    print(f"\nstep of 90 spheres, {hydrodynamics}: {100 * least:.2f} % above the solver")
    assert least < 0.01


def test_importing_takes_fifty_milliseconds():
    def once():
        done = subprocess.run(
            [sys.executable, "-X", "importtime", "-c", "import sheared_layers"], capture_output=True, text=True, check=True
        )
        assert "numpy" not in done.stderr
        return int(re.search(r"\|\s*(\d+) \| sheared_layers$", done.stderr, re.MULTILINE)[1])

    least = min(once() for _ in range(5))
    print(f"\nimport: {least / 1e3:.1f} ms")
    assert least < 50_000


@pytest.fixture(scope="module")
def large_file():
    """A store of 100 000 finished runs: `STORE=FILE cargo bench -p sweep --bench large_store` makes it."""
    if "STORE" not in os.environ:
        pytest.skip("STORE names no store of 100 000 finished runs")
    return os.environ["STORE"]


def test_points_of_a_hundred_thousand_runs_take_half_a_second(large_file):
    def seconds(work):
        # Computing time, which a busy machine does not change; nothing is waited for.
        begun = time.process_time()
        answer = work()
        return time.process_time() - begun, answer

    def once():
        # Here the store is compared with its checksums; then it is known to be whole for as long as its files do not change.
        opened, store = seconds(lambda: sl.Store(large_file))
        first, points = seconds(store.points)
        again, _ = seconds(store.points)
        assert len(points) == 2500 and points["seeds"].sum() == 100_000
        return opened, first, again

    opened, first, again = map(min, zip(*(once() for _ in range(3))))
    print(f"\n100 000 runs: Store() {opened:.3f} s, points() {first:.3f} s, again {again:.3f} s")
    assert first < 0.5 and again < 0.5


def test_runs_of_a_hundred_thousand_are_a_table(large_file):
    large_store = sl.Store(large_file)
    begun = time.perf_counter()
    runs = large_store.runs()
    print(f"\n100 000 runs: {time.perf_counter() - begun:.3f} s")
    assert len(runs) == 100_000
