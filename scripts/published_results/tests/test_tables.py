import json

import pytest

from published_results.place import Wrong
from published_results.tables import BEGIN, END, with_tables

FILE = """friction,shear_rate,seeds,viscosity,viscosity_ci95,rolling_fraction
0.1,0.0,8,7.0,0.25,
0.1,inf,8,9.8,0.5,0.625
0.3,inf,1,10.5,,0.4
0.3,1.0,0,,,
"""


@pytest.fixture
def made(tmp_path):
    """The table that a marker describes."""
    (tmp_path / "some.csv").write_text(FILE)

    def make(marker):
        page = f"before\n{BEGIN}some | {marker} -->\nold\n{END}\nafter\n"
        text = with_tables(page, tmp_path)
        assert with_tables(text, tmp_path) == text, "it does not change when it is made again"
        assert text.startswith("before\n") and text.endswith(f"{END}\nafter\n") and "old" not in text
        return text.splitlines()[2:-2]

    return make


def test_rows_and_columns_are_those_asked_for(made):
    assert made("rows: friction | columns: shear_rate | cells: viscosity (seeds)") == [
        "| ν | Γ = 0 | 1 | ∞ |",
        "| --- | --- | --- | --- |",
        "| 0.1 | 7.00 ± 0.25 (8) |  | 9.80 ± 0.50 (8) |",
        "| 0.3 |  | – (0) | 10.50 (1) |",
    ]
    assert made("rows: friction, seeds | cells: viscosity, rolling_fraction % | where: shear_rate=inf") == [
        "| ν | runs | η | rolling |",
        "| --- | --- | --- | --- |",
        "| 0.1 | 8 | 9.80 ± 0.50 | 62.5 % |",
        "| 0.3 | 1 | 10.50 | 40.0 % |",
    ]


def test_one_standard_error_is_that_of_students_interval(made):
    # 0.25 over 2.365, for 8 runs.
    assert made("rows: friction, shear_rate | cells: viscosity_se | where: seeds=8")[2] == "| 0.1 | 0 | 7.00 ± 0.11 |"


def test_a_table_of_files_that_are_not_there_is_left_out(tmp_path):
    page = f"{BEGIN}other | rows: friction | cells: viscosity -->\n| a |\n{END}\n{BEGIN}a-fit.json, b-fit.json -->\n{END}\n"
    assert with_tables(page, tmp_path) == page.replace("| a |\n", "")


def test_fits_stand_side_by_side(tmp_path):
    names = ["c_0", "c_m", "sigma_c", "beta", "prefactor"]
    for file, low, high in [("a", None, None), ("b", 0.5, "inf")]:
        parameters = {name: {"value": 0.8, "low": low, "high": high} for name in names}
        (tmp_path / f"{file}-fit.json").write_text(json.dumps({"parameters": parameters, "points": [1, 2], "rms": 0.1}))
    lines = with_tables(f"{BEGIN}a-fit.json, b-fit.json -->\n{END}\n", tmp_path).splitlines()
    assert lines[1:4] == ["|  | a | b |", "| --- | --- | --- |", "| c_0 | 0.8000 | 0.8000 (0.5000 to inf) |"]
    assert lines[-3:-1] == ["| points | 2 | 2 |", "| root mean square of ln(η/fit) | 0.10 | 0.10 |"]


@pytest.mark.parametrize(
    ("marker", "said"),
    [
        ("rows: friction | cells: viscosity", "several rows"),
        ("rows: friktion | cells: viscosity", "no column friktion"),
        ("rows: friction | cells: viscosity | where: friction=0.7", "no row of some.csv has friction = 0.7"),
        ("rows: friction | columns: shear_rate | cells: viscosity | where: shear_rate=1 | labels: 3=three", "has no label"),
        ("row: friction", "no part of a table is called row"),
        ("rows", "is no KEY: VALUES"),
    ],
)
def test_what_cannot_be_made_is_named(made, marker, said):
    with pytest.raises(Wrong, match=said) as error:
        made(marker)
    assert BEGIN in str(error.value), "with its place"


def test_a_table_without_its_end_is_refused(tmp_path):
    (tmp_path / "some.csv").write_text(FILE)
    with pytest.raises(Wrong, match="has no"):
        with_tables(f"{BEGIN}some | rows: friction, shear_rate | cells: seeds -->\n", tmp_path)


def test_averages_of_unsteady_runs_are_marked(tmp_path):
    rows = ["0.1,8,7.0,1,0", "0.2,8,7.5,0,1", "0.3,8,8.0,0,0"]
    (tmp_path / "some.csv").write_text("\n".join(["friction,seeds,viscosity,not_steady,ordering", *rows]) + "\n")
    page = f"{BEGIN}some | rows: friction | cells: viscosity, seeds -->\n{END}\nafter\n"
    text = with_tables(page, tmp_path)
    assert text.splitlines()[3:-1] == [
        "| 0.1 | 7.000 † | 8 |",
        "| 0.2 | 7.500 ‡ | 8 |",
        "| 0.3 | 8.000 | 8 |",
        "",
        "† not steady, ‡ ordering",
        END,
    ]
    assert with_tables(text, tmp_path) == text
