"""A suspension, step by step."""

import copy
import pickle

import numpy as np
import pytest

import sheared_layers as sl

PARAMS = {
    "volume_fraction": 0.5,
    "roughness": 0.01,
    "friction": 0.5,
    "shear_rate": np.inf,
    "spheres": 96,
    "size_ratio": 1.2,
    "hydrodynamics": "ball-melrose",
    "tangential": "coulomb",
    "time_step": 0.01,
}


@pytest.fixture(scope="module")
def sheared():
    """A suspension with contacts."""
    suspension = sl.Suspension(PARAMS, seed=1)
    suspension.shear(0.3)
    return suspension


def test_a_suspension_is_the_run_of_a_campaign(tmp_path):
    protocol = {"strain": 0.1, "discard": 0.0, "sample_every": 0.02, "checkpoint_every": 0.1}
    campaign = sl.Campaign("bulk", protocol=protocol, seeds=[2], **PARAMS)
    samples = campaign.run(tmp_path / "bulk.sqlite", progress=False).samples(1)
    mine = sl.Suspension(PARAMS, seed=2).shear(0.1, every=2)
    for name in mine[0]:
        np.testing.assert_array_equal([sample[name] for sample in mine], samples[name], name)


def test_arrays_have_three_columns_and_are_never_copied():
    suspension = sl.Suspension(PARAMS, seed=1)
    assert isinstance(suspension, sl.Run) and repr(suspension).startswith("Suspension(96 spheres, φ = 0.5")
    positions, orientations = suspension.positions, suspension.orientations
    before = positions.copy()
    assert positions.shape == (96, 3) and orientations.shape == (96, 4)
    np.testing.assert_array_equal(orientations, np.tile([1.0, 0.0, 0.0, 0.0], (96, 1)))
    with pytest.raises(ValueError):
        positions[0, 0] = 0.0
    suspension.step()
    assert suspension.positions is positions and (positions != before).any()
    np.testing.assert_allclose(np.linalg.norm(orientations, axis=1), 1, rtol=1e-12)
    assert (orientations[:, 1:] != 0).any()
    volume = 4 / 3 * np.pi * (suspension.radii**3).sum()
    assert volume / suspension.side**3 == pytest.approx(0.5)


def test_contacts_are_vectors_that_friction_holds(sheared):
    contacts = sheared.contacts
    assert len(contacts) == sheared.sample()["contacts"] > 0
    assert contacts["normal"].shape == contacts["tangential_force"].shape == (len(contacts), 3)
    np.testing.assert_allclose(np.linalg.norm(contacts["normal"], axis=1), 1)
    along = (contacts["normal"] * contacts["tangential_force"]).sum(axis=1)
    friction = np.linalg.norm(contacts["tangential_force"], axis=1)
    np.testing.assert_allclose(along, 0, atol=1e-9 * friction.max())
    assert friction.max() > 0 and (friction <= 0.5 * contacts["normal_force"] * (1 + 1e-6)).all()
    assert sheared.stresslets.shape == (96, 5)


def test_a_snapshot_goes_on_with_the_same_bits(sheared):
    again = sl.Suspension.from_snapshot(sheared.params, sheared.snapshot())
    copies = [again, copy.deepcopy(sheared), pickle.loads(pickle.dumps(sheared))]
    wanted = sl.Suspension.from_snapshot(PARAMS, sheared.snapshot()).shear(0.03)
    for other in copies:
        assert type(other) is sl.Suspension
        np.testing.assert_array_equal(other.positions, sheared.positions)
        assert other.shear(0.03) == wanted


def test_what_is_of_the_other_space_is_refused(sheared, params):
    with pytest.raises(ValueError, match="of a suspension, and this is a layer"):
        sl.Layer.from_snapshot(params, sheared.snapshot())
    with pytest.raises(ValueError, match="of a layer, and this is a suspension"):
        sl.Suspension.from_snapshot(PARAMS, sl.Layer(params, 1).snapshot())
    with pytest.raises(ValueError, match="to be a layer"):
        sl.Layer(PARAMS, 1)
    with pytest.raises(ValueError, match="to be a suspension"):
        sl.Suspension(params, 1)
    with pytest.raises(TypeError):
        sl.Run(PARAMS, 1)
