"""Tables: equal to those of the command line, and readable by other packages."""

import csv
import math
import subprocess

import numpy as np
import pandas
import polars
import pyarrow
import pytest
from conftest import SWEEP

import sheared_layers as sl


def test_pandas_polars_and_pyarrow_take_them(store):
    for table in [store.points(), store.runs(), store.samples(1), store.frames(1), store.contacts(1)]:
        arrow = pyarrow.table(table)
        assert arrow.column_names == table.columns and arrow.num_rows == len(table) > 0
        frames = [pandas.DataFrame.from_arrow(table), table.to_pandas(), polars.DataFrame(table)]
        for frame in frames:
            assert list(frame.columns) == table.columns and len(frame) == len(table)
        for name in table.columns:
            column = table[name]
            if column.dtype == object:
                assert column.tolist() == arrow[name].to_pylist()
            else:
                np.testing.assert_array_equal(column, frames[1][name].to_numpy(dtype=float), name)
        kinds = {pyarrow.string(), pyarrow.int64(), pyarrow.float64()}
        assert {field.type for field in arrow.schema} <= kinds
        assert pyarrow.schema(table) == arrow.schema


def test_notebooks_show_them(store):
    html = store.points()._repr_html_()
    assert html.startswith("<table>") and html.count("<tr>") == 3
    assert 'title="viscosity' in html and "2 rows ×" in html
    many = store.samples(1)._repr_html_()
    assert "…" in many if len(store.samples(1)) > 30 else many.count("<tr>") == len(store.samples(1)) + 1


def test_structure_is_that_of_the_command(store, tmp_path):
    files = [tmp_path / "numbers.parquet", tmp_path / "curves.parquet"]
    subprocess.run([SWEEP, "structure", store.path, "--parquet", files[0], "--curves", files[1]], check=True)
    import pyarrow.parquet

    for table, file in zip([store.structure(), store.structure_curves()], files):
        there = pyarrow.parquet.read_table(file)
        assert pyarrow.table(table).to_pylist() == there.to_pylist() and len(table) > 1
    assert store.structure()["runs"].tolist() == [2, 2]
    one = store.structure(1, where={"shear_rate": 0.1})
    assert len(one) == 1 and math.isnan(one["coordination_ci95"][0])
    with pytest.raises(ValueError, match="no frames"):
        store.structure(1, where={"shear_rate": math.inf})


def test_pictures_are_those_of_the_command(store, tmp_path):
    from conftest import command

    here, there = tmp_path / "here.svg", tmp_path / "there.svg"
    store.draw(1, here, strain=0.2, colour="cluster")
    command("draw", store.path, "1", "--strain", "0.2", "--colour", "cluster", "--out", there)
    assert here.read_bytes() == there.read_bytes()
    for wrong, parts in [
        ({"strain": 9.0}, "frames are kept"),
        ({"colour": "force"}, "pressure"),
        ({"slab": (0, 1)}, "no depth"),
        ({"slab": (1, 0)}, "slab"),
    ]:
        with pytest.raises(ValueError, match=parts):
            store.draw(1, here, **wrong)
    with pytest.raises(ValueError, match=r"\.svg"):
        store.draw(1, tmp_path / "here.gif")


def test_what_to_pandas_lacks_is_named(store, monkeypatch):
    import sys

    for name in ["pandas", "pyarrow"]:
        with monkeypatch.context() as without:
            without.setitem(sys.modules, name, None)
            with pytest.raises(ImportError, match=rf"needs {name}: pip install 'sheared-layers\[pandas\]'"):
                store.points().to_pandas()


def test_no_numbers_are_copied(store):
    table = store.samples(1)
    columns = [pyarrow.table(table)["viscosity"].chunk(0).buffers()[1].address for _ in range(2)]
    assert columns[0] == columns[1]


def test_a_table_outlives_what_it_came_from(store):
    table = store.samples(1)
    arrow = pyarrow.table(table)
    wanted = table["viscosity"].tolist()
    del table
    assert arrow["viscosity"].to_pylist() == wanted
    store.points().__arrow_c_stream__()  # an unread stream is freed


def test_points_are_the_table_of_the_report(store, tmp_path):
    there = tmp_path / "points.parquet"
    subprocess.run([SWEEP, "report", store.path, "--parquet", there], check=True)
    import pyarrow.parquet

    there = pyarrow.parquet.read_table(tmp_path / "points.parquet")
    here = pyarrow.table(store.points())
    assert here.column_names == there.column_names
    assert here.to_pylist() == there.to_pylist()
    units = store.points().units
    assert units["viscosity"] == "mu" and units["friction"] == "1"
    assert "viscosity" in store.points().meanings["viscosity"]


def test_frames_are_the_tables_of_the_export(store, tmp_path):
    out = tmp_path / "layer.csv"
    subprocess.run([SWEEP, "export", store.path, "2", "--format", "csv", "--every", "2", "--out", out], check=True)
    for table, path in [
        (store.frames(2, every=2), out),
        (store.contacts(2, every=2), out.with_suffix(".contacts.csv")),
    ]:
        with open(path) as file:
            rows = list(csv.DictReader(file))
        assert list(rows[0]) == table.columns and len(rows) == len(table)
        for name in table.columns:
            column = table[name]
            assert column.tolist() == [type(column[0])(row[name]) for row in rows], name


def test_runs_have_axes_results_and_states(store):
    runs = store.runs()
    assert set(runs["state"]) == {"done"} and runs["seed"].tolist() == [1, 2, 1, 2]
    assert runs["shear_rate"].tolist() == [0.1, 0.1, math.inf, math.inf]
    means = runs["viscosity"].reshape(2, 2).mean(axis=1)
    np.testing.assert_allclose(store.points()["viscosity"], means, rtol=1e-15)
    assert store.samples(str(runs["key"][0][:8]))["viscosity"].tolist() == store.samples(1)["viscosity"].tolist()


def test_points_are_chosen_as_on_the_command_line(store):
    assert store.points(where={"shear_rate": math.inf})["shear_rate"].tolist() == [math.inf]
    assert len(store.points(where={"shear_rate": [0.1, np.inf], "contact": "rigid"})) == 2
    assert len(store.points(where={"shear_rate": np.array([0.1])})) == 1


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda s: s.points(where={"fricton": 1}), ValueError, ["where", "fricton", "friction"]),
        (lambda s: s.points(where={"friction": 0.7}), ValueError, ["where", "0.7", "0.5"]),
        (lambda s: s.points(where=3), TypeError, ["where"]),
        (lambda s: s.points("all"), TypeError, [""]),
        (lambda s: s.samples(99), ValueError, ["99"]),
        (lambda s: s.samples("zz"), ValueError, ["zz"]),
        (lambda s: s.samples(0), TypeError, ["case", "0", "from 1"]),
        (lambda s: s.samples(1.5), TypeError, ["case", "1.5"]),
        (lambda s: s.frames(1, every=0), ValueError, ["every", "0"]),
        (lambda s: s.points()["viscosty"], KeyError, ["viscosty", "viscosity"]),
        (lambda s: s.plot("pie"), ValueError, ["kind", "pie", "curve", "trace"]),
        (lambda s: s.plot(quantity="mass"), ValueError, ["quantity", "mass", "viscosity_median"]),
        (lambda s: s.plot(along="contact"), ValueError, ["along", "contact", "friction"]),
        (lambda s: s.plot("trace", cases=["zz"]), ValueError, ["zz"]),
        (lambda s: s.plot(colour="red"), TypeError, ["colour"]),
    ],
)
def test_bad_input_is_named(store, call, kind, words):
    with pytest.raises(kind) as raised:
        call(store)
    # The name of an argument of another type is a note.
    text = "\n".join([str(raised.value), *getattr(raised.value, "__notes__", [])])
    for word in words:
        assert word in text, text


def test_runs_without_frames_say_so(tmp_path):
    from conftest import small_campaign

    store = small_campaign().run(tmp_path / "a.sqlite", progress=False)
    with pytest.raises(ValueError, match="trajectory"):
        store.frames(1)


def test_a_plot_shows_what_the_figure_shows(store, tmp_path):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure = tmp_path / "there.svg"
    subprocess.run([SWEEP, "report", store.path, "--figure", figure], check=True)
    there = figure.read_text()
    ax = store.plot()
    points = store.points()
    line = ax.get_lines()[0]
    np.testing.assert_array_equal(line.get_ydata(), points["viscosity"])
    # One decade at 0.1, and infinity one decade beyond the end of the axis.
    assert [float(x) for x in line.get_xdata()] == [-1, 0]
    for text in [ax.get_xlabel(), ax.get_ylabel(), *(tick.get_text() for tick in ax.get_xticklabels())]:
        assert text.split(" ")[0] in there, text
    assert line.get_color().lower() in there.lower()
    width, height = ax.figure.get_size_inches() * 25.4
    assert f'width="{width:.3f}mm"' in there and f'height="{height:.3f}mm"' in there
    dilute = 1 + 5 / 3 * 0.65
    assert any(abs(float(other.get_ydata()[0]) - dilute) < 1e-12 for other in ax.get_lines()[1:])
    _, mine = pyplot.subplots()
    for kind in ["contacts", "trace", "curve"]:
        assert store.plot(kind, ax=mine, along=None) is mine
    assert store.plot(quantity="n1", ax=mine).get_ylabel().startswith("first normal stress difference")
    # The means over the seeds of both points have bands, single runs have none.
    assert [len(store.plot("trace", cases=cases).collections) for cases in [None, ["1"]]] == [2, 0]
    pyplot.close("all")


def test_a_pending_run_has_a_table_of_no_samples(tmp_path):
    from conftest import small_campaign

    small_campaign(seeds=1).run(tmp_path / "a.sqlite", progress=False)
    with pytest.raises(ZeroDivisionError):
        small_campaign(seeds=200).run(tmp_path / "b.sqlite", progress=lambda f, t: 1 / 0)
    done = sl.Store(tmp_path / "a.sqlite")
    begun = sl.Store(tmp_path / "b.sqlite")
    assert begun.samples(400).columns == done.samples(1).columns and len(begun.samples(400)) == 0
    assert math.isnan(begun.runs()["viscosity"][-1])
