"""The blocks of the documentation and the notebooks, run as written; the stubs against the module."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys

import pytest
from conftest import ROOT, SWEEP

import sheared_layers as sl

NOTEBOOKS = sorted((ROOT / "python/notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("page", ["docs/python.md", "docs/other-tools.md", "python/README.md"])
def test_every_block_runs(page, tmp_path, monkeypatch):
    import matplotlib

    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    # For the blocks of a shell: the program, the tools beside this interpreter, a short campaign.
    folders = [os.path.dirname(SWEEP), os.path.dirname(sys.executable), os.environ["PATH"]]
    monkeypatch.setenv("PATH", os.pathsep.join(folders))
    (tmp_path / "sweeps").mkdir()
    quickstart = (ROOT / "sweeps/quickstart.toml").read_text()
    short = quickstart.replace("strain = 4.0", "strain = 0.3").replace("discard = 1.0", "discard = 0.0")
    assert short != quickstart
    (tmp_path / "sweeps/quickstart.toml").write_text(short.replace("seeds = 8 ", "seeds = 2 "))
    blocks = re.findall(r"^```(python|sh) *(.*)\n((?:.*\n)*?)```$", (ROOT / page).read_text(), re.MULTILINE)
    assert any(kind == "python" for kind, _, _ in blocks)
    names = {}
    for kind, needs, text in blocks:
        needed = needs.removeprefix("needs=").split(",") if needs else []
        if kind == "sh":
            if all(shutil.which(program) for program in needed):
                subprocess.run(["sh", "-eu", "-c", text], check=True)
        elif all(importlib.util.find_spec(module) for module in needed):
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
