"""Frames of a store, through GSD and the files of LF_DEM, keep what they say."""

import numpy as np
import pytest
from conftest import PARAMS, PROTOCOL

import sheared_layers as sl
from sheared_layers import frames as of_runs

SUSPENDED = {key: value for key, value in PARAMS.items() if key != "area_fraction"} | {
    "volume_fraction": 0.5,
    "spheres": 96,
    "hydrodynamics": "lubrication",
    "tangential": "coulomb",
    "size_ratio": 1.4,
}


@pytest.fixture(scope="module", params=["layer", "suspension"])
def run(request, store, tmp_path_factory):
    """Store, number of a run, and its frames."""
    if request.param == "suspension":
        path = tmp_path_factory.mktemp("bulk") / "bulk.sqlite"
        campaign = sl.Campaign("bulk", protocol=PROTOCOL, seeds=1, **SUSPENDED)
        store = campaign.run(path, progress=False, trajectory=True)
        return store, 1, of_runs.of_run(store, 1)
    return store, 3, of_runs.of_run(store, 3)


def alike(found, expected):
    """Whether two structures are equal, up to pairs that rounding moves into the next bin."""
    assert found.keys() <= expected.keys()
    for name, value in found.items():
        if isinstance(value, dict):
            for part, numbers in value.items():
                other = expected[name][part]
                a, b = (np.asarray(x, float) for x in (numbers, other))
                assert np.shape(a) == np.shape(b)
                if not a.size:
                    continue
                smooth = np.nanmean(np.abs(np.nan_to_num(a) - np.nan_to_num(b)))
                assert smooth <= 0.02 * max(1.0, np.nanmax(np.abs(np.nan_to_num(b)))), (name, part)
        elif isinstance(value, float):
            assert value == pytest.approx(expected[name], rel=1e-3, abs=1e-3), name
        else:
            assert np.shape(value) == np.shape(expected[name]), name


def test_structure_is_that_of_the_store(run):
    store, case, frames = run
    kept = [frame for frame in frames if frame.strain > PROTOCOL["discard"] - 1e-9]
    found, table = of_runs.structure(kept), store.structure(case)
    assert found["frames"] == table["frames"][0] == len(kept) > 5
    assert found["coordination"] > 0.1
    for name in ("coordination", "frictional_coordination", "largest_cluster", "core_fraction", "fabric_xy", "rattlers"):
        assert found[name] == pytest.approx(table[name][0], abs=1e-12, nan_ok=True), name
    curves = store.structure_curves(case)
    assert found["g_r"]["g"] == pytest.approx(curves["value"][curves["quantity"] == "g_r"], abs=1e-12)
    # Two runs have an interval.
    both = of_runs.structure([kept[:5], kept[5:]])
    assert both["runs"] == 2 and both["coordination_ci95"] > 0


def test_gsd_returns_what_was_written(run, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    _, _, frames = run
    of_runs.write_gsd(tmp_path / "run.gsd", frames)
    with hoomd.open(tmp_path / "run.gsd") as file:
        for written in file:
            written.validate()
        assert file[0].configuration.dimensions == frames[0].positions.shape[1]
    back = of_runs.read_gsd(tmp_path / "run.gsd")
    assert [frame.strain for frame in back] == [frame.strain for frame in frames]
    for found, frame in zip(back, frames):
        np.testing.assert_allclose(found.lattice, frame.lattice, atol=1e-5)
        np.testing.assert_allclose(found.unwrapped, frame.unwrapped, atol=2e-5)
        np.testing.assert_allclose(found.velocities, frame.velocities, atol=1e-5)
        np.testing.assert_allclose(found.radii, frame.radii, rtol=1e-6)
        cells = np.linalg.solve(frame.lattice.T, (found.positions - frame.positions).T)
        np.testing.assert_allclose(cells, np.rint(cells), atol=1e-5)
        assert (found.contacts == frame.contacts).all()
    alike(of_runs.structure(back), of_runs.structure(frames))


def write_lf_dem(folder, frames, early):
    """Files such as LF_DEM writes them: origin in the middle, gradient along z, radii in those of the smallest sphere."""
    small, dimensions = float(1 / frames[0].radii.min()), frames[0].positions.shape[1]
    side = float(small * frames[0].lattice[0, 0])
    depth = 0.0 if dimensions == 2 else side
    head = f"# LF_DEM version v1.2\n# np {len(frames[0].radii)}\n# VF 0.5\n# Lx {side!r}\n# Ly {depth!r}\n# Lz {side!r}\n"
    state = "contact state (0 = no contact, 1 = frictionless contact, "
    if early:
        vector = lambda name, first: "".join(f"#{first + k}: {name} {axis}\n" for k, axis in enumerate("xyz"))
        par = head + "#1: number of the particle\n#2: radius\n" + vector("position", 3) + vector("velocity", 6) + "\n"
        pairs = head + "#1: particle 1 label\n#2: particle 2 label\n"
        pairs += f"#3: {state}1 = non-sliding frictional, 2 = sliding frictional)\n"
        pairs += vector("normal vector, oriented from particle 1 to particle 2", 4)
        pairs += "#7: dimensionless gap = s-2, s = 2r/(a1+a2)\n#8: norm of the normal part of the contact force\n"
        pairs += vector("tangential part of the contact force,", 9) + "\n"
    else:
        places = "#3-5: position (x, y, z)\n" if dimensions == 3 else "#3: position x\n#4: position z\n"
        par = head + "# flow_type shear\n# data in h units.\n#1: particle index\n#2: radius\n" + places + "\n"
        pairs = head + "# data in h units.\n#1: particle 1 label\n#2: particle 2 label\n"
        pairs += "#3-5: normal vector, oriented from particle 1 to particle 2\n#6: dimensionless gap = s-2, s = 2r/(a1+a2)\n"
        pairs += f"#7: {state}2 = non-sliding frictional, 3 = sliding frictional)\n"
        pairs += "#8: norm of the normal part of the contact force\n#9-11: tangential part of the contact force\n\n"
    numbers = lambda *values: " ".join(repr(float(value)) for value in values) + "\n"
    for frame in frames:
        shift = float(small * frame.lattice[1, 0])
        if early:
            told = f"# {frame.strain!r} {shift!r} 1 0 {frame.strain!r}\n"
        else:
            told = f"# cumulated strain : {frame.strain!r}\n# shear disp : {shift!r}\n# shear rate : 1\n"
        par, pairs = par + told, pairs + told
        places = small * frame.positions - 0.5 * side
        for number, (place, radius) in enumerate(zip(places, small * frame.radii)):
            x, y, z = (*place, 0.0)[:3]
            turned = [x, -z, y] if dimensions == 3 or early else [x, y]
            par += numbers(number, radius, *turned, *([0, 0, 0] if early else []))
        # A pair that does not touch, as all pairs within the range of lubrication are listed.
        pairs += numbers(0, 1, 0, 0, 0, 1, 0.3, 0, 0, 0, 0) if early else numbers(0, 1, 0, 0, 1, 0.3, 0, 0, 0, 0, 0)
        for i, j, force, friction, what in frame.contacts.tolist():
            place = of_runs.STATES.index(what)
            kind = max(place, 1) if early else place + 1
            rest = [force, 0.6 * friction, 0.0, -0.8 * friction]
            pairs += numbers(i, j, kind, 0, 0, 1, 0.0, *rest) if early else numbers(i, j, 0, 0, 1, 0.0, kind, *rest)
    (folder / "par_run.dat").write_text(par)
    (folder / "int_run.dat").write_text(pairs)
    return folder / "par_run.dat", folder / "int_run.dat"


@pytest.mark.parametrize("early", [False, True], ids=["recent", "early"])
def test_files_of_lf_dem_are_read_by_the_names_of_their_columns(run, tmp_path, early):
    _, _, frames = run
    files = write_lf_dem(tmp_path, frames, early)
    back = of_runs.read_lf_dem(*files)
    for found, frame in zip(back, frames, strict=True):
        assert found.strain == frame.strain
        np.testing.assert_allclose(found.lattice, frame.lattice, atol=1e-6)
        np.testing.assert_allclose(found.radii, frame.radii, rtol=1e-6)
        assert (found.contacts[["i", "j"]] == frame.contacts[["i", "j"]]).all()
        np.testing.assert_allclose(found.contacts["tangential_force"], frame.contacts["tangential_force"], rtol=1e-12)
    alike(of_runs.structure(back), of_runs.structure(frames))
    assert len(of_runs.read_lf_dem(files[0])[0].contacts) == 0


def test_other_files_and_frames_are_refused(run, tmp_path):
    _, _, frames = run
    par, pairs = write_lf_dem(tmp_path, frames[:3], early=False)
    shorter = tmp_path / "short.dat"
    shorter.write_text(pairs.read_text().rpartition("# cumulated strain")[0])
    with pytest.raises(ValueError, match="has 2 frames"):
        of_runs.read_lf_dem(par, shorter)
    with pytest.raises(ValueError, match="no column 'radius'"):
        of_runs.read_lf_dem(pairs)
    shorter.write_text("step,strain\n1,2\n")
    with pytest.raises(ValueError, match="no file of LF_DEM"):
        of_runs.read_lf_dem(shorter)
    shorter.write_text(par.read_text().replace("flow_type shear", "flow_type extension"))
    with pytest.raises(ValueError, match="simple shear, got extension"):
        of_runs.read_lf_dem(shorter)
    with pytest.raises(ValueError, match="no frames"):
        of_runs.structure([])
    flat = frames[0]
    lattice = np.zeros_like(flat.lattice)
    with pytest.raises(ValueError, match="lattice"):
        of_runs.structure([of_runs.Frame(0.0, lattice, flat.positions, flat.radii)])
