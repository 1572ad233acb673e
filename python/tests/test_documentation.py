"""The blocks of the documentation and the notebooks, run as written; the stubs against the module."""

import importlib.util
import os
import re
import subprocess
import sys

import pytest
from conftest import ROOT

import sheared_layers as sl

NOTEBOOKS = sorted((ROOT / "python/notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("page", ["docs/python.md", "python/README.md"])
def test_every_block_runs(page, tmp_path, monkeypatch):
    import matplotlib

    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python *(.*)\n((?:.*\n)*?)```$", (ROOT / page).read_text(), re.MULTILINE)
    assert blocks
    names = {}
    for needs, text in blocks:
        needed = needs.removeprefix("needs=").split(",") if needs else []
        if all(importlib.util.find_spec(module) for module in needed):
            exec(compile(text, page, "exec"), names)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_notebook_runs(notebook, tmp_path, monkeypatch):
    import nbclient
    import nbformat

    monkeypatch.delenv("MPLBACKEND", raising=False)  # figures are shown in the notebook

    content = nbformat.read(notebook, as_version=4)
    assert not any(cell.get("outputs") for cell in content.cells), "notebooks are kept without their outputs"
    client = nbclient.NotebookClient(content, timeout=120, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    outputs = [output for cell in content.cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs), "a notebook shows a figure"


def test_there_are_two_notebooks():
    assert [path.stem for path in NOTEBOOKS] == ["friction-law", "thickening"]


def test_stubs_are_those_of_the_package():
    pytest.importorskip("mypy")
    done = subprocess.run(
        [
            *(sys.executable, "-m", "mypy.stubtest", "sheared_layers", "--ignore-missing-stub", "--ignore-disjoint-bases"),
            *("--mypy-config-file", ROOT / "python/pyproject.toml"),
        ],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "NO_COLOR": "1"},
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_stubs_and_a_typed_script_pass_strict_mypy():
    pytest.importorskip("mypy")
    files = ROOT / "python/sheared_layers/__init__.pyi", ROOT / "python/tests/typed_script.py"
    for file in files:
        command = [sys.executable, "-m", "mypy", "--strict", "--no-incremental", file]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT / "python/tests")
        assert done.returncode == 0, done.stdout + done.stderr
    spoilt = files[1].read_text().replace("seed=1", 'seed="one"').replace('"contacts"', '"softness"')
    done = subprocess.run([*command[:-1], "-c", spoilt], capture_output=True, text=True, check=False, cwd=ROOT / "python/tests")
    assert done.stdout.count("[arg-type]") == 2, done.stdout + done.stderr


def test_the_typed_script_runs(tmp_path):
    subprocess.run([sys.executable, ROOT / "python/tests/typed_script.py", tmp_path], check=True)


def test_everything_has_a_docstring_with_its_arguments():
    for name in sl.__all__:
        thing = getattr(sl, name)
        assert thing.__doc__, name
        members = vars(thing) if isinstance(thing, type) else {}
        for member, value in members.items():
            if not member.startswith("_") and (callable(value) or hasattr(value, "__get__")):
                assert value.__doc__, f"{name}.{member}"
