"""Campaigns: the same as those of the command line, on the same store."""

import math
import os
import re
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from contextlib import closing

import numpy as np
import pytest
from conftest import PARAMS, PROTOCOL, SWEEP, command, refused, small_campaign

import sheared_layers as sl


def write(campaign, folder):
    path = folder / f"{campaign.name}.toml"
    path.write_text(campaign.text)
    return path


def test_keywords_are_the_campaign_of_a_file(tmp_path):
    made = small_campaign()
    read = sl.Campaign.from_toml(write(made, tmp_path))
    assert (read.name, len(read), read.text) == (made.name, len(made), made.text) == ("small", 4, read.text)
    as_list = sl.Campaign(
        "small",
        protocol=PROTOCOL,
        grid=[{**PARAMS, "shear_rate": np.array([0.1, math.inf]), "seeds": np.int64(2)}],
    )
    assert as_list.text == made.text
    assert read.default_store == tmp_path / "results/small.sqlite"


def test_the_command_line_gives_the_same_results_to_the_bit(store, tmp_path):
    file = write(small_campaign(), tmp_path)
    there = command("run", file, "--store", tmp_path / "there.sqlite", "--quiet")
    points = store.points()
    assert len(points) == len(there["points"]) == 2
    skipped = {"wall_time_s", "cpu_time_s"}
    for name in points.columns:
        theirs = [point[name] for point in there["points"]]
        if name in skipped or name not in there["points"][0]:
            continue
        mine = [None if isinstance(v, float) and math.isnan(v) else v for v in points[name].tolist()]
        assert mine == [math.inf if value == "inf" else value for value in theirs], name
    with_store = command("report", store.path)
    assert with_store["points"][0]["viscosity"] == points["viscosity"][0]


def test_the_command_line_goes_on_where_python_was(tmp_path):
    campaign = small_campaign()
    path = tmp_path / "shared.sqlite"
    campaign.run(path, progress=False)
    more = small_campaign(seeds=3)
    file = write(more, tmp_path)
    command("run", file, "--store", path, "--quiet")
    store = more.store(path)
    assert store.counts()["done"] == 6
    assert sorted(set(store.points()["seeds"])) == [3]


def test_both_compute_one_store_at_the_same_time(tmp_path):
    campaign = small_campaign(seeds=6)
    path = tmp_path / "shared.sqlite"
    file = write(campaign, tmp_path)
    other = subprocess.Popen([SWEEP, "run", file, "--store", path, "--quiet"], stdout=subprocess.DEVNULL)
    store = campaign.run(path, progress=False, workers=1)
    assert other.wait() == 0
    assert store.counts() == {"done": 12, "jammed": 0, "failed": 0, "running": 0, "pending": 0}


def test_a_store_is_read_while_another_thread_runs_it(tmp_path):
    campaign = small_campaign(seeds=6)
    path = tmp_path / "shared.sqlite"
    running = threading.Thread(target=lambda: campaign.run(path, progress=False))
    running.start()
    seen = []
    while running.is_alive():
        if path.exists():
            try:
                seen.append(campaign.store(path).counts()["done"])
            except ValueError:  # not a store yet: the very first moment
                pass
    running.join()
    assert seen == sorted(seen) and campaign.store(path).counts()["done"] == 12


def test_plan_is_that_of_the_command(tmp_path):
    campaign = small_campaign()
    plan = campaign.plan(workers=2)
    there = command("plan", write(campaign, tmp_path), "--workers", 2)
    assert plan.keys() == there.keys()
    for name in ["campaign", "cases", "points", "axes", "workers", "disk_bytes"]:
        assert plan[name] == there[name], name


def test_progress_is_told_and_the_bar_is_drawn(tmp_path, capsys):
    calls = []
    small_campaign(seeds=8).run(tmp_path / "a.sqlite", progress=lambda fraction, text: calls.append((fraction, text)))
    assert all(0 <= fraction <= 1 and "cases" in text for fraction, text in calls)
    assert calls[-1] == (1.0, "16 of 16 cases") and calls == sorted(calls, key=lambda at: at[0])
    small_campaign().run(tmp_path / "b.sqlite", progress=True)
    assert "4 of 4 cases" in capsys.readouterr().err


INTERRUPTED = """
import sys, sheared_layers as sl
try:
    sl.Campaign.from_toml(sys.argv[1]).run(sys.argv[2], progress=lambda fraction, text: print("at work", flush=True))
except KeyboardInterrupt:
    print("interrupted")
"""


def is_at_work(campaign, path):
    """Whether a run is computed in the store."""
    try:
        return campaign.store(path).counts()["running"] > 0
    except (FileNotFoundError, ValueError):  # not there, or not a store yet
        return False


def test_an_interrupted_run_goes_on_with_the_same_bits(tmp_path):
    # Every step is sampled: a shorter run is determined by the samples of a longer one, counters
    # included.
    protocol = {**PROTOCOL, "sample_every": PARAMS["time_step"]}
    long = sl.Campaign("long", protocol={**protocol, "strain": 20.0}, seeds=2, **PARAMS)
    short = sl.Campaign("long", protocol=protocol, seeds=2, **PARAMS)
    file, path = write(long, tmp_path), tmp_path / "long.sqlite"
    running = subprocess.Popen([sys.executable, "-c", INTERRUPTED, file, path], stdout=subprocess.PIPE, text=True)
    while not is_at_work(long, path):
        running.stdout.readline()
    time.sleep(0.3)
    running.send_signal(signal.SIGINT)
    rest = running.stdout.read()
    assert running.wait() == 0 and rest.endswith("interrupted\n")
    counts = long.store(path).counts()
    assert counts["pending"] == 2 and counts["running"] == 0 and counts["failed"] == 0
    # Half of the length: computed runs are reused, whether longer or shorter than requested.
    here = short.run(path, progress=False).points()
    there = short.run(tmp_path / "other.sqlite", progress=False).points()
    for name in ["viscosity", "viscosity_stresslet", "minimum_gap", "contacts_per_sphere"]:
        np.testing.assert_array_equal(here[name], there[name], name)


STEPPING = """
import sheared_layers as sl, os, signal, threading
layer = sl.Layer({}, 1)
threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    layer.shear(1e4)
except KeyboardInterrupt:
    print(layer.steps, len(layer.positions))
    layer.step()
    print(layer.steps)
threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    sl.pair(time_step=5e-4)
except KeyboardInterrupt:
    print("pair")
"""


def test_ctrl_c_stops_at_the_next_step():
    done = subprocess.run(
        [sys.executable, "-c", STEPPING.format(PARAMS)], capture_output=True, text=True, timeout=60, check=True
    )
    steps, more, pair = done.stdout.split("\n")[:3]
    assert int(more) == int(steps.split()[0]) + 1 and int(more) > 1 and pair == "pair"


def test_failed_runs_are_a_warning(tmp_path):
    campaign = small_campaign()
    path = tmp_path / "failed.sqlite"
    file = write(campaign, tmp_path)
    # The command line ends runs that take too long: here all of them.
    done = subprocess.run([SWEEP, "run", file, "--store", path, "--quiet", "--max-wall-time", "1e-6s"], capture_output=True)
    assert done.returncode == 1, done.stderr
    with pytest.warns(RuntimeWarning, match="4 of 4 runs failed; the first"):
        store = campaign.run(path, progress=False)
    assert store.counts()["failed"] == 4
    assert campaign.run(path, progress=False, retry_failed=True).counts()["done"] == 4


def test_a_run_stops_at_its_time_limit_and_goes_on(tmp_path):
    long = sl.Campaign("long", protocol={**PROTOCOL, "strain": 1000.0}, seeds=2, **PARAMS)
    with pytest.warns(RuntimeWarning, match="time limit reached: 2 runs remain"):
        store = long.run(tmp_path / "long.sqlite", progress=False, time_limit=0.5)
    assert store.counts()["pending"] == 2
    short = sl.Campaign("long", protocol=PROTOCOL, seeds=2, **PARAMS)
    # More than enough time; as a text.
    assert short.run(tmp_path / "long.sqlite", progress=False, time_limit="2h", max_wall_time="1h").counts()["done"] == 2


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda: sl.Campaign("Big Name", seeds=1, **PARAMS), ValueError, ["name", "a-z"]),
        (lambda: sl.Campaign("a", seeds=1, **{**PARAMS, "friction": [0.1, -2]}), ValueError, ["friction", "-2", "0 to 10"]),
        (lambda: sl.Campaign("a", seeds=0, **PARAMS), ValueError, ["seeds"]),
        (lambda: sl.Campaign("a", **PARAMS), ValueError, ["seeds"]),
        (lambda: sl.Campaign("a", seeds=1, fricton=0.3, **PARAMS), ValueError, ["fricton", "friction"]),
        (lambda: sl.Campaign("a", protocol={"stran": 1.0}, seeds=1, **PARAMS), ValueError, ["stran", "strain"]),
        (lambda: sl.Campaign("a", protocol={"strain": "long"}, seeds=1, **PARAMS), ValueError, ["strain"]),
        (lambda: sl.Campaign("a", protocol=3, seeds=1, **PARAMS), TypeError, ["protocol"]),
        (lambda: sl.Campaign("a", seeds={1, 2}, **PARAMS), TypeError, ["seeds", "{1, 2}", "a list"]),
        (lambda: sl.Campaign("a", grid=[PARAMS], seeds=1), TypeError, ["seeds", "grid"]),
        (lambda: sl.Campaign("a", grid=[]), ValueError, ["grid"]),
        (lambda: sl.Campaign("a"), ValueError, ["grid"]),
        (lambda: sl.Campaign(), TypeError, ["name"]),
        (lambda: sl.Campaign.from_toml("nowhere.toml"), FileNotFoundError, ["nowhere.toml"]),
        (lambda: sl.Campaign.from_toml(os.devnull), ValueError, [os.devnull, "device"]),
        (lambda: sl.Store("nowhere.sqlite"), FileNotFoundError, ["nowhere.sqlite"]),
        (lambda: sl.Store(__file__), ValueError, ["test_campaign.py"]),
        (lambda: sl.Store(3), TypeError, ["path"]),
        (lambda: small_campaign().plan(workers=0), ValueError, ["workers", "0", "1 to 4096"]),
        (lambda: small_campaign().run("x.sqlite", workers=10**6), ValueError, ["workers", "1 to 4096"]),
        (lambda: small_campaign().run("x.sqlite", workers="all"), TypeError, ["workers"]),
        (lambda: small_campaign().run("x.sqlite", progress=3), TypeError, ["progress", "int"]),
        (lambda: small_campaign().run("x.sqlite", jobs=3), TypeError, ["jobs"]),
        (lambda: small_campaign().run("x.sqlite", time_limit="soon"), ValueError, ["time_limit", "'soon'", "2h"]),
        (lambda: small_campaign().run("x.sqlite", time_limit=0), ValueError, ["time_limit", "0", "2h"]),
        (lambda: small_campaign().run("x.sqlite", time_limit=math.nan), ValueError, ["time_limit", "nan"]),
        (lambda: small_campaign().run("x.sqlite", max_wall_time=[1]), TypeError, ["max_wall_time", "[1]"]),
    ],
)
def test_bad_input_is_named_and_writes_nothing(call, kind, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(kind) as raised:
        call()
    # The name of an argument of another type is a note.
    text = "\n".join([str(raised.value), *getattr(raised.value, "__notes__", [])])
    for word in words:
        assert word in text, text
    assert list(tmp_path.iterdir()) == []


def test_exceptions_say_what_they_are_about_without_lines_of_a_file():
    with pytest.raises(ValueError) as raised:
        sl.Campaign("a", seeds=1, fricton=0.3, **{**PARAMS, "hydrodynamics": "Ball-Melrose"})
    error = raised.value
    assert (error.key, error.value, error.suggestion) == ("fricton", None, "friction")
    assert "keys of [[grid]]" in error.allowed
    assert not re.search(r":\d+:\d+|│", str(error)), error
    assert "did you mean \"ball-melrose\"?" in str(error)
    with pytest.raises(ValueError) as raised:
        sl.Campaign("a", seeds=1, **{**PARAMS, "friction": [0.1, -2]})
    error = raised.value
    assert (error.key, error.value, error.suggestion) == ("friction", "-2", None)
    assert "0 to 10" in error.allowed
    with pytest.raises(ValueError, match=r"forces: expected shape \(N, 2\), got \(3, 3\)"):
        sl.solve([[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]], forces=[[0.0] * 3] * 3)


def test_errors_have_the_words_of_the_command(tmp_path):
    file = tmp_path / "bad.toml"
    file.write_text(small_campaign().text.replace("friction = 0.5", "friction = -0.5"))
    with pytest.raises(ValueError) as raised:
        sl.Campaign.from_toml(file)
    # The command wraps lines to the terminal.
    there, here = (re.sub(r"[\s│]", "", text) for text in (refused("plan", file), str(raised.value)))
    assert here in there


def test_an_error_of_the_callback_ends_the_run(tmp_path):
    def broken(fraction, text):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        small_campaign(seeds=50).run(tmp_path / "a.sqlite", progress=broken)
    assert small_campaign(seeds=50).store(tmp_path / "a.sqlite").counts()["running"] == 0


def test_segments_of_a_protocol(tmp_path):
    segments = [{"strain": 0.2}, {"strain": 0.2, "direction": -1}, {"oscillation": {"amplitude": 0.1, "cycles": 2}}]
    campaign = sl.Campaign(
        "reversal",
        protocol={"time_step": 0.02, "segment": segments},
        grid=[{**PARAMS, "shear_rate": 1.0, "seeds": 2}],
    )
    store = campaign.run(tmp_path / "reversal.sqlite", progress=False)
    table = store.segments()
    assert table["segment"].tolist() == [1, 2, 3]
    assert table["end"][0] == 0.2 and table["segment_direction"][1] == -1.0 and table["amplitude"][2] == 0.1
    ratio = table["reversal_ratio"]
    assert np.isnan(ratio[0]) and 0.0 < ratio[1] < 1.5 and table["eta_prime"][2] > 1.0
    import matplotlib

    matplotlib.use("Agg")
    ends = [store.plot("trace", segment=number).get_xlim()[1] for number in [2, 3]]
    assert ends[0] < 0.2 + 1e-9 < ends[1]
    with pytest.raises(ValueError, match="segment: .*the campaign has segments 1 to 3"):
        store.plot("trace", segment=4)
    with pytest.raises(ValueError, match="`strain` = 0.0 is out of range"):
        sl.Campaign("bad", protocol={"segment": [{"strain": 0.0}]}, grid=[{**PARAMS, "shear_rate": 1.0, "seeds": 1}])


def test_errors_about_a_store_name_no_argument(store):
    with pytest.raises(ValueError, match="^the campaign has no segments") as refused:
        store.segments()
    assert refused.value.key is None
    with pytest.raises(ValueError, match="^where: ") as refused:
        store.points(where={"shear_rat": 1.0})
    assert "did you mean shear_rate?" in str(refused.value)
    assert refused.value.key == "where"


def test_a_fit_is_that_of_the_command(tmp_path):
    axes = {**PARAMS, "area_fraction": [0.45, 0.55], "shear_rate": [0.1, 1.0, 10.0], "seeds": 2}
    store = sl.Campaign("fit", protocol=PROTOCOL, grid=[axes]).run(tmp_path / "fit.sqlite", progress=False)
    fit = store.fit(replicates=20)
    there = command("fit", store.path, "--replicates", "20")
    assert fit == there and len(fit["points"]) == 6 and fit["parameters"]["c_0"]["value"] > 0.55
    with pytest.raises(ValueError, match="at least 6 points"):
        store.fit(where={"shear_rate": 1.0})


def test_notebooks_can_be_converted():
    from importlib.metadata import requires

    extra = [line for line in requires("sheared-layers") if "notebook" in line]
    assert any(line.startswith("nbconvert") for line in extra), extra


def test_flow_curves_at_imposed_stress_have_the_intervals_of_rates(tmp_path):
    import matplotlib

    matplotlib.use("Agg")
    axes = {name: value for name, value in PARAMS.items() if name != "shear_rate"}
    grid = [{**axes, "shear_stress": [0.3, 3.0], "seeds": 2}]
    store = sl.Campaign("flow", protocol=PROTOCOL, grid=grid).run(tmp_path / "flow.sqlite", progress=False)
    bars = store.plot("flow-curve").collections
    assert len(bars) == 2
    for bar, stress in zip(bars, [0.3, 3.0]):
        ((start, low), (end, high)) = bar.get_segments()[0]
        assert start < end and low == high == pytest.approx(stress)
