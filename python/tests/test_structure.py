"""Structure, against networkx and freud on the same frames."""

import math

import freud
import networkx
import numpy as np
import pytest
from conftest import PARAMS, PROTOCOL

CASE = 3  # of the upper plateau
N = PARAMS["spheres"]
SIDE = math.sqrt(N * math.pi / PARAMS["area_fraction"])


@pytest.fixture(scope="module")
def frames(store):
    """Spheres and contacts of each frame after the discarded strain."""
    spheres, contacts = store.frames(CASE).to_pandas(), store.contacts(CASE).to_pandas()
    kept = spheres[spheres["strain"] > PROTOCOL["discard"] - 1e-9]
    return [(layer, contacts[contacts["step"] == step]) for step, layer in kept.groupby("step")]


def test_clusters_and_core_are_those_of_networkx(store, frames):
    table = store.structure(CASE)
    found = {name: table[name][0] for name in table.columns}
    assert found["frames"] == len(frames) > 5
    clusters, cores, degrees = [], [], []
    for _, contacts in frames:
        graph = networkx.Graph()
        graph.add_nodes_from(range(N))
        rubbing = contacts[contacts["state"] != "frictionless"]
        graph.add_edges_from(zip(rubbing["i"], rubbing["j"]))
        largest = max(len(part) for part in networkx.connected_components(graph))
        clusters.append(largest / N if largest > 1 else 0.0)
        cores.append(len(networkx.k_core(graph, 3)) / N)
        degrees.append(2 * graph.number_of_edges() / N)
    assert found["largest_cluster"] == pytest.approx(np.mean(clusters), abs=1e-12)
    assert found["core_fraction"] == pytest.approx(np.mean(cores), abs=1e-12)
    assert found["frictional_coordination"] == pytest.approx(np.mean(degrees), abs=1e-12)
    assert np.mean(clusters) > 0.1


def test_fabric_is_the_mean_of_normals(store, frames):
    normals = np.concatenate([contacts[["normal_x", "normal_y"]].to_numpy() for _, contacts in frames])
    fabric = store.structure(CASE)
    xx, xy, yy = [fabric[f"fabric_{name}"][0] for name in ["xx", "xy", "yy"]]
    np.testing.assert_allclose([[xx, xy], [xy, yy]], normals.T @ normals / len(normals), atol=1e-5)


def test_pair_distribution_is_that_of_freud(store, frames):
    found = store.structure_curves(CASE)
    of_distance = found["quantity"] == "g_r"
    r, g = found["x"][of_distance], found["value"][of_distance]
    # Up to half the distance of the planes of the sheared cell, the limit of freud.
    outer = (r > 2.1) & (r < 0.44 * SIDE)
    width = r[outer][1] - r[outer][0]
    edge = r[outer][0] - width / 2
    rdf = freud.density.RDF(outer.sum(), r_max=edge + width * outer.sum(), r_min=edge, normalization_mode="finite_size")
    for layer, _ in frames:
        offset = layer["strain"].iloc[0] * SIDE
        offset -= SIDE * math.floor(offset / SIDE + 0.5)
        box = freud.box.Box(Lx=SIDE, Ly=SIDE, xy=offset / SIDE, is2D=True)
        places = np.c_[layer["x"], layer["y"], np.zeros(N)]
        rdf.compute((box, box.wrap(places)), reset=False)
    # Single precision moves a few pairs over the edge of a bin.
    assert np.abs(rdf.rdf - g[outer]).sum() < 0.01 * g[outer].sum()
