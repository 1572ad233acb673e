"""What the package costs above the program itself: prints the least times of several tries, since the machine may be busy.

    python python/benches/overhead.py [STORE]

STORE is a store of many finished runs; `STORE=FILE cargo bench -p sweep --bench large_store` makes one of 100 000.
"""

import re
import subprocess
import sys
import time

import sheared_layers as sl

PARAMS = {
    "area_fraction": 0.65,
    "roughness": 0.01,
    "friction": 0.5,
    "shear_rate": 10.0,
    "spheres": 90,
    "time_step": 0.005,
}


def least(tries, once):
    return min(once() for _ in range(tries))


def solving():
    """Seconds of `solve` above those of the solver."""
    layer = sl.Layer({**PARAMS, "hydrodynamics": "ball-melrose"}, 1)
    centres, side = layer.positions.copy(), layer.side
    contact = {"scheme": "rigid", "roughness": 0.01, "friction": 0.5, "critical_load": 1.9}

    def once():
        begun = time.perf_counter()
        solved = sl.solve(centres, cell=(side, side), hydrodynamics="ball-melrose", contact=contact)
        return time.perf_counter() - begun - solved.computing_time_s

    return least(300, once)


def stepping(hydrodynamics):
    """Fraction of a step outside the solver."""
    layer = sl.Layer({**PARAMS, "hydrodynamics": hydrodynamics}, 1)

    def once():
        begun, computed = time.perf_counter(), layer.computing_time_s
        layer.step()
        took, computed = time.perf_counter() - begun, layer.computing_time_s - computed
        return (took - computed) / computed

    return least(60, once)


def importing():
    """Seconds of an import, in a separate process."""

    def once():
        command = [sys.executable, "-X", "importtime", "-c", "import sheared_layers"]
        said = subprocess.run(command, capture_output=True, text=True, check=True).stderr
        return 1e-6 * int(re.search(r"\|\s*(\d+) \| sheared_layers$", said, re.MULTILINE)[1])

    return least(5, once)


def reading(file):
    """CPU seconds of the store, its points, its points again, and its runs."""

    def seconds(work):
        begun = time.process_time()
        answer = work()
        return time.process_time() - begun, answer

    opened, store = seconds(lambda: sl.Store(file))
    return [opened, *(seconds(work)[0] for work in [store.points, store.points, store.runs])]


print(f"solve, 90 spheres: {1e6 * solving():.1f} us above the solver")
for name in ["ball-melrose", "stokesian-dynamics"]:
    print(f"step, 90 spheres, {name}: {100 * stepping(name):.2f} % above the solver")
print(f"import: {1e3 * importing():.1f} ms")
for file in sys.argv[1:]:
    times = zip(["Store()", "points()", "points() again", "runs()"], reading(file))
    print(f"{file}: " + ", ".join(f"{what} {time:.3f} s" for what, time in times))
