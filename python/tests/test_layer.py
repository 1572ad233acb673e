"""A layer, step by step."""

import copy
import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest

import sheared_layers as sl


def test_importing_the_package_leaves_numpy_for_later():
    script = "import sys, sheared_layers; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_a_layer_is_the_run_of_a_campaign(store, params):
    runs = store.runs()
    case = list(zip(runs["shear_rate"], runs["seed"])).index((np.inf, 2))
    samples = store.samples(runs["key"][case])
    layer = sl.Layer({**params, "shear_rate": np.inf}, seed=2)
    mine = layer.shear(0.4, every=4)
    # The columns after those of a sample are of order and motion, and of the contact network, which
    # a campaign observes on request.
    columns = ["step", *mine[0]]
    # An imposed pressure has a fraction too.
    theirs = [name for name in samples.columns if name != "fraction"]
    assert theirs[: len(columns)] == columns
    assert theirs[len(columns)] == "layering"
    np.testing.assert_allclose(samples["n1"], samples["normal_stress_difference"], rtol=1e-9, atol=1e-9)
    for name in mine[0]:
        theirs = samples[name]
        np.testing.assert_array_equal([sample[name] for sample in mine], theirs, name)
    assert layer.steps == 80 and layer.strain == pytest.approx(0.4)


def test_positions_are_the_layers_own_and_never_copied(params):
    layer = sl.Layer(params, 1)
    positions, orientations = layer.positions, layer.orientations
    before = positions.copy()
    assert layer.positions is positions and positions.shape == (40, 2) and positions.dtype == np.float64
    assert not positions.flags.writeable and not positions.flags.owndata
    with pytest.raises(ValueError):
        positions[0, 0] = 0.0
    layer.step()
    assert layer.positions is positions and layer.orientations is orientations
    assert (positions != before).any() and (orientations != 0).any()
    assert np.all((positions >= 0) | (positions < layer.side))


def test_the_first_step_is_the_flow_and_the_disturbance(params):
    # Euler's step with the velocities of solve, as the step becomes small.
    layer = sl.Layer({**params, "time_step": 1e-6, "friction": 0.0}, 3)
    before, side = layer.positions.copy(), layer.side
    solved = sl.solve(
        before,
        cell=[side, side],
        hydrodynamics="ball-melrose",
        contact={
            "scheme": "rigid",
            "roughness": 0.01,
            "friction": 0.0,
            "critical_load": 6 * np.pi / 10,
            "time_span": 1e-6,
        },
    )
    layer.step()
    moved = (layer.positions - before) / 1e-6
    flow = np.column_stack([before[:, 1], np.zeros(len(before))])
    inside = np.abs(moved).max(axis=1) < 100  # not carried through a side of the cell
    assert inside.sum() > 30
    np.testing.assert_allclose(moved[inside], (flow + solved.velocity_disturbance)[inside], atol=1e-3)


def test_all_that_is_shown_belongs_to_one_instant(params):
    layer, plain = sl.Layer(params, 1), sl.Layer(params, 1)
    for _ in range(10):
        sample = layer.sample()
        assert sample["strain"] == layer.strain
        contacts = layer.contacts
        assert sample["contacts"] == len(contacts)
        assert (contacts["normal_force"] > 0).all()
        np.testing.assert_allclose(np.hypot(*contacts["normal"].T), 1)
        assert layer.sample() == sample
        # Reading changes nothing: the same bits as without.
        assert layer.step() == sample == plain.step()
    np.testing.assert_array_equal(layer.positions, plain.positions)
    assert layer.snapshot() == plain.snapshot()
    assert layer.stresslets.shape == (40, 3)


def test_stresses_of_a_sample_are_the_sums_of_their_parts(params):
    layer = sl.Layer({**params, "time_step": 0.01}, 1)
    layer.shear(0.4)
    sample = layer.sample()
    causes = ["hydrodynamic", "normal_contact", "tangential_contact", "repulsion"]
    # Tangential forces are perpendicular to the line of centres, and stresslets traceless.
    of_traces = ["normal_contact", "repulsion"]
    for stress, named in [("n1", causes), ("n2", causes), ("particle_pressure", of_traces)]:
        parts = [sample[f"{stress}_{cause}"] for cause in named]
        assert sample[stress] == pytest.approx(sum(parts), rel=1e-12)
    shear = [sample[f"shear_{cause}"] for cause in causes]
    assert sample["viscosity"] == pytest.approx(1 + sum(shear), rel=1e-12)
    assert sample["particle_pressure"] > 0 and sample["shear_normal_contact"] > 0


def test_a_snapshot_goes_on_with_the_same_bits(params):
    layer = sl.Layer(params, 1)
    layer.shear(0.05)
    again = sl.Layer.from_snapshot(layer.params, layer.snapshot())
    copies = [again, copy.deepcopy(layer), pickle.loads(pickle.dumps(layer))]
    for other in copies:
        np.testing.assert_array_equal(other.positions, layer.positions)
        assert other.strain == layer.strain
    wanted = layer.shear(0.05)
    for other in copies:
        assert other.shear(0.05) == wanted
        np.testing.assert_array_equal(other.positions, layer.positions)


def test_a_snapshot_of_another_layer_is_refused(params):
    snapshot = sl.Layer(params, 1).snapshot()
    with pytest.raises(ValueError, match="other"):
        sl.Layer.from_snapshot({**params, "spheres": 41}, snapshot)
    torn = bytearray(snapshot)
    torn[-1] ^= 1
    with pytest.raises(ValueError, match="checksum"):
        sl.Layer.from_snapshot(params, bytes(torn))


def test_params_come_back(params):
    layer = sl.Layer(params, 1)
    assert params.items() <= layer.params.items()
    assert layer.params["contact"] == "rigid" and layer.seed == 1
    np.testing.assert_array_equal(sl.Layer(layer.params, 1).positions, layer.positions)
    assert layer.flow == "flowing" and layer.radii.shape == (40,)


@pytest.mark.parametrize(
    ("strain", "every", "word"),
    [(0.0033, 1, "multiple of the time step"), (-0.1, 1, "non-negative"), (float("nan"), 1, "strain"), (0.1, 0, "every")],
)
def test_strains_that_cannot_be_are_refused(params, strain, every, word):
    layer = sl.Layer(params, 1)
    with pytest.raises(ValueError, match=word):
        layer.shear(strain, every=every)
    assert layer.steps == 0


def test_threads_compute_at_the_same_time_and_whole_steps_only(params):
    layers = [sl.Layer(params, seed) for seed in (1, 2)]
    shared = sl.Layer(params, 3)
    torn = []

    def work(layer):
        layer.shear(0.05)
        for _ in range(10):
            shared.step()

    def watch():
        while any(thread.is_alive() for thread in threads):
            layer = shared
            if not np.isfinite(layer.positions).all():
                torn.append(layer.strain)
            layer.sample()

    threads = [threading.Thread(target=work, args=(layer,)) for layer in layers]
    watcher = threading.Thread(target=watch)
    for thread in [*threads, watcher]:
        thread.start()
    for thread in [*threads, watcher]:
        thread.join()
    assert not torn and shared.steps == 20
    for layer, seed in zip(layers, (1, 2)):
        alone = sl.Layer(params, seed)
        alone.shear(0.05)
        np.testing.assert_array_equal(layer.positions, alone.positions)
    alone = sl.Layer(params, 3)
    alone.shear(0.1)
    np.testing.assert_array_equal(shared.positions, alone.positions)


def test_other_threads_go_on_while_a_step_is_computed(params):
    layer = sl.Layer({**params, "spheres": 200, "hydrodynamics": "stokesian-dynamics"}, 1)
    counted = 0

    def step():
        layer.step()

    thread = threading.Thread(target=step)
    thread.start()
    while thread.is_alive():
        counted += 1
    thread.join()
    # A step takes tens of milliseconds: this thread would not run at all if the lock of the
    # interpreter were held.
    assert counted > 1000


def test_velocities_move_the_spheres_and_unwrapped_positions_follow_them(params):
    def error_of_a_step(step):
        """The largest difference between a step's displacement over its time and its velocity."""
        layer = sl.Layer(params | {"friction": 0.0, "time_step": step}, seed=3)
        before, velocities = layer.unwrapped_positions, layer.velocities
        assert velocities.shape == (40, 2) and layer.angular_velocities.shape == (40,)
        layer.step()
        moved = (layer.unwrapped_positions - before) / step
        return np.abs(moved - velocities).max() / np.abs(velocities).max()

    # The difference is half the acceleration times the step: of first order.
    errors = [error_of_a_step(step) for step in (4e-4, 2e-4, 1e-4)]
    assert errors[2] < 1e-2
    assert errors[0] / errors[1] == pytest.approx(2, abs=0.2)
    assert errors[1] / errors[2] == pytest.approx(2, abs=0.2)


def test_unwrapped_positions_differ_from_positions_by_lattice_vectors(params):
    layer = sl.Layer(params, seed=3)
    layer.shear(1.0)
    lattice = layer.lattice
    assert lattice.shape == (2, 2) and lattice[1, 1] == layer.side
    assert lattice[0] == pytest.approx([layer.side, 0])
    cells = (layer.unwrapped_positions - layer.positions) @ np.linalg.inv(lattice)
    assert cells == pytest.approx(np.round(cells), abs=1e-9)
    assert np.abs(np.round(cells)).max() >= 1


def test_a_picture_replaces_no_store(store):
    with pytest.raises(ValueError, match="is a store"):
        linked = store.path.with_name("linked.svg")
        linked.symlink_to(store.path)
        store.draw(1, linked)
    with pytest.raises(ValueError, match="slab: .* is no range"):
        store.draw(1, "picture.svg", slab=(2.0, 1.0))
