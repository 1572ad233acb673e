"""Frames of runs: those of a store, GSD, the files of LF_DEM, and their structure.

Lengths are in the mean radius. Flow is along x, its gradient along y, the vorticity along z.
"""

from dataclasses import dataclass, field

import numpy as np

STATES = ("frictionless", "rolling", "slipping")
_CONTACT = [
    ("i", np.int64),
    ("j", np.int64),
    ("normal_force", np.float64),
    ("tangential_force", np.float64),
    ("state", "U12"),
]


def _no_contacts():
    return np.zeros(0, _CONTACT)


@dataclass
class Frame:
    """Spheres in a periodic cell, and their contacts."""

    strain: float
    lattice: np.ndarray
    """Lattice vectors of the cell, one a row: along the flow, to the cell above, along the vorticity."""
    positions: np.ndarray
    radii: np.ndarray
    contacts: np.ndarray = field(default_factory=_no_contacts)
    """Structured array: i, j, normal_force, size of the tangential_force, state. Forces have any one unit."""
    velocities: np.ndarray | None = None
    unwrapped: np.ndarray | None = None
    """Positions that follow the spheres over the edges of the cell."""


def of_run(store, case, *, every=1):
    """The kept frames of a run of a store."""
    spheres, touching = (table(case, every=every) for table in (store.frames, store.contacts))
    axes = [axis for axis in "xyz" if axis in spheres.columns]
    columns = {name: np.asarray(spheres[name]) for name in spheres.columns}
    contacts = {name: np.asarray(touching[name]) for name in touching.columns}
    forces = [contacts[name] for name in contacts if name.startswith("tangential_force")]
    size = np.sqrt(sum(force**2 for force in forces))
    frames = []
    for step in np.unique(columns["step"]):
        rows, pairs = columns["step"] == step, contacts["step"] == step

        def of(prefix, rows=rows):
            return np.column_stack([columns[prefix + axis][rows] for axis in axes])

        lattice = _lattice({name: values[rows][0] for name, values in columns.items()}, axes)
        frame = Frame(float(columns["strain"][rows][0]), lattice, of(""), columns["radius"][rows])
        frame.velocities, frame.unwrapped = of("velocity_"), of("unwrapped_")
        frame.contacts = np.zeros(pairs.sum(), _CONTACT)
        for name in ("i", "j", "normal_force", "state"):
            frame.contacts[name] = contacts[name][pairs]
        frame.contacts["tangential_force"] = size[pairs]
        frames.append(frame)
    return frames


def _lattice(row, axes):
    """Lattice vectors of the cell of a row of the table of spheres."""
    if "lattice_1_x" in row:
        return np.array([[row[f"lattice_{k + 1}_{axis}"] for axis in axes] for k in range(len(axes))])
    lattice = row["cell_side"] * np.eye(len(axes))
    lattice[1, 0] = row["cell_offset"]
    if len(axes) == 3:
        lattice[1, 2] = row["cell_cross_offset"]
    return lattice


def structure(frames):
    """The structure of frames of one run, or of a list of runs.

    Returns
    -------
    dict
        As a point of ``sweep structure --json``, without axes.
    """
    from ._core import frame_structure

    frames = list(frames)
    runs = [frames] if all(isinstance(frame, Frame) for frame in frames) else frames
    return frame_structure([[_arrays(frame) for frame in run] for run in runs])


def _arrays(frame):
    contacts = frame.contacts
    states = [STATES.index(state) for state in contacts["state"]]
    numbers = [np.asarray(part, float).ravel().tolist() for part in (frame.lattice, frame.positions, frame.radii)]
    pairs = zip(*(contacts[name].tolist() for name in _names()), states)
    return (*numbers, list(pairs))


def _names():
    return ("i", "j", "normal_force", "tangential_force")


def write_gsd(path, frames):
    """Write frames as GSD, which HOOMD-blue, freud and OVITO read.

    Contacts are bonds; their forces and states, and the strain, are logged quantities.
    """
    import gsd.hoomd

    with gsd.hoomd.open(path, "w") as file:
        for number, frame in enumerate(frames):
            file.append(_to_gsd(gsd.hoomd.Frame(), number, frame))


def _to_gsd(out, number, frame):
    lattice = _in_space(frame.lattice, height=1.0)
    if np.triu(lattice, 1).any():
        raise ValueError("frames must be of shear, none of it along the vorticity: a box of GSD has no other shape")
    sides = np.diag(lattice)
    middle = lattice.sum(axis=0) / 2
    followed = frame.positions if frame.unwrapped is None else frame.unwrapped
    away = np.linalg.solve(lattice.T, (_in_columns(followed) - middle).T).T
    images = np.rint(away)
    out.configuration.step = number
    out.configuration.dimensions = frame.positions.shape[1]
    out.configuration.box = [*sides, lattice[1, 0] / sides[1], lattice[2, 0] / sides[2], lattice[2, 1] / sides[2]]
    particles, bonds, contacts = out.particles, out.bonds, frame.contacts
    particles.N, particles.types = len(frame.radii), ["sphere"]
    particles.position, particles.image = (away - images) @ lattice, images.astype(np.int32)
    particles.diameter = 2 * frame.radii
    if frame.velocities is not None:
        particles.velocity = _in_columns(frame.velocities)
    bonds.N, bonds.types = len(contacts), list(STATES)
    bonds.group = np.column_stack([contacts["i"], contacts["j"]])
    bonds.typeid = [STATES.index(state) for state in contacts["state"]]
    out.log["strain"] = np.array([frame.strain])
    for name in ("normal_force", "tangential_force"):
        out.log[f"bonds/{name}"] = np.ascontiguousarray(contacts[name])
    return out


def read_gsd(path):
    """Read frames from GSD; bonds are contacts where ``write_gsd`` logged their forces.

    Lengths are divided by the mean radius of each frame.
    """
    import gsd.hoomd

    with gsd.hoomd.open(path, "r") as file:
        return [_of_gsd(frame) for frame in file]


def _of_gsd(frame):
    configuration, particles, bonds = frame.configuration, frame.particles, frame.bonds
    dimensions = configuration.dimensions
    x, y, z, xy, xz, yz = np.asarray(configuration.box, float)
    lattice = np.array([[x, 0, 0], [xy * y, y, 0], [xz * z, yz * z, z]])
    radii = np.asarray(particles.diameter, float) / 2
    mean = radii.mean()
    positions = np.asarray(particles.position, float) + lattice.sum(axis=0) / 2
    unwrapped = positions + np.asarray(particles.image, float) @ lattice
    contacts = _no_contacts()
    if "bonds/normal_force" in frame.log and bonds.N:
        contacts = np.zeros(bonds.N, _CONTACT)
        contacts["i"], contacts["j"] = np.asarray(bonds.group).T
        for name in ("normal_force", "tangential_force"):
            contacts[name] = frame.log[f"bonds/{name}"]
        contacts["state"] = np.array(STATES)[np.asarray(bonds.typeid)]
    strain = float(frame.log["strain"][0]) if "strain" in frame.log else float(configuration.step)

    def few(vectors):
        return np.asarray(vectors, float)[:, :dimensions] / mean

    velocities = few(particles.velocity)
    shape = few(lattice)[:dimensions]
    return Frame(strain, shape, few(positions), radii / mean, contacts, velocities, few(unwrapped))


def _in_space(lattice, height):
    """Lattice vectors of a layer with a third one across it."""
    if len(lattice) == 3:
        return np.asarray(lattice, float)
    out = height * np.eye(3)
    out[:2, :2] = lattice
    return out


def _in_columns(vectors):
    """Vectors with three components."""
    return np.column_stack([vectors, np.zeros((len(vectors), 3 - vectors.shape[1]))])


def read_lf_dem(particles, interactions=None):
    """Read frames that LF_DEM wrote: its file ``par_….dat``, and for contacts ``int_….dat``.

    LF_DEM has the gradient along z; its frames are turned. Lengths are divided by the mean radius.
    Columns are found by the names in the heads of the files.
    """
    meta, columns, snapshots = _lf_dem(particles)
    if "extension" in meta.get("flow_type", ""):
        raise ValueError(f"{particles} must be of simple shear, got {meta['flow_type']}")
    missing = [name for name in ("Lx", "Ly", "Lz") if name not in meta]
    if missing or not snapshots:
        raise ValueError(f"{particles} is no file par_….dat of LF_DEM: it has no {', '.join(missing) or 'frame'}")
    sides = [float(meta[name]) for name in ("Lx", "Ly", "Lz")]
    frames = [_of_lf_dem(particles, sides, columns, *snapshot) for snapshot in snapshots]
    if interactions is None:
        return [frame for frame, _ in frames]
    _, columns, snapshots = _lf_dem(interactions)
    if len(snapshots) != len(frames):
        raise ValueError(f"{interactions} has {len(snapshots)} frames, and {particles} {len(frames)}")
    for (frame, _), (strain, _, rows) in zip(frames, snapshots):
        if abs(strain - frame.strain) > 1e-6 * max(1.0, abs(strain)):
            raise ValueError(f"{interactions} has a frame at strain {strain}, and {particles} at {frame.strain}")
        frame.contacts = _contacts_of_lf_dem(interactions, columns, rows)
    return [frame for frame, _ in frames]


def _lf_dem(path):
    """Meta data, columns by name, and frames (strain, displacement of the cell above, rows) of a file."""
    meta, columns, snapshots = {}, {}, []
    with open(path, encoding="utf-8") as file:
        for line in file:
            if not line.strip():
                break
            head, _, rest = line[1:].strip().partition(" ")
            if line.startswith("# "):
                meta[head], rest = rest.strip(), ""
            elif line.startswith("#") and head.endswith(":"):
                first, _, last = head[:-1].partition("-")
                columns[rest.strip()] = slice(int(first) - 1, int(last or first))
            else:
                raise ValueError(f"{path} is no file of LF_DEM: its head has the line {line.strip()!r}")
        told, rows = {}, []

        def finish():
            if rows:
                table = [[float("nan") if word == "n" else float(word) for word in row] for row in rows]
                snapshots.append((told.get("cumulated strain", 0.0), told.get("shear disp", 0.0), np.array(table)))
                rows.clear()
                told.clear()

        for line in file:
            if line.startswith("#"):
                finish()
                name, colon, value = line[1:].rpartition(" : ")
                if colon:
                    told[name.strip()] = float(value)
                else:
                    numbers = [float(word) for word in line[1:].split()]
                    told.update(zip(("cumulated strain", "shear disp"), numbers))
            elif line.strip():
                rows.append(line.split())
        finish()
    return meta, columns, snapshots


def _column(path, columns, rows, *names):
    """The columns whose name begins with one of these, or the three that are named by their axes."""
    for name in names:
        found = [place for known, place in columns.items() if known.startswith(name)]
        if found:
            return np.concatenate([rows[:, place] for place in found], axis=1)
    raise ValueError(f"{path} has no column {names[0]!r}; there are {', '.join(columns) or 'none'}")


def _of_lf_dem(path, sides, columns, strain, shift, rows):
    radii = _column(path, columns, rows, "radius")[:, 0]
    where = _column(path, columns, rows, "position")
    mean = radii.mean()
    lattice = np.array([[sides[0], 0.0, 0.0], [shift, sides[2], 0.0], [0.0, 0.0, sides[1]]]) / mean
    if sides[1] == 0.0:
        return Frame(strain, lattice[:2, :2], where[:, [0, -1]] / mean, radii / mean), mean
    turned = np.column_stack([where[:, 0], where[:, 2], -where[:, 1]])
    return Frame(strain, lattice, turned / mean, radii / mean), mean


def _contacts_of_lf_dem(path, columns, rows):
    state_name = next((name for name in columns if name.startswith("contact state")), "")
    state = _column(path, columns, rows, "contact state")[:, 0].astype(int)
    friction = np.linalg.norm(_column(path, columns, rows, "tangential part of the contact force"), axis=1)
    contacts = np.zeros(len(rows), _CONTACT)
    contacts["i"] = _column(path, columns, rows, "particle 1 label")[:, 0]
    contacts["j"] = _column(path, columns, rows, "particle 2 label")[:, 0]
    contacts["normal_force"] = _column(path, columns, rows, "norm of the normal part of the contact force")[:, 0]
    contacts["tangential_force"] = friction
    # Early versions number contacts without friction and those that stick alike.
    slides, sticks = (3, state == 2) if "3 = sliding" in state_name else (2, (state == 1) & (friction > 0))
    contacts["state"] = np.select([state == slides, sticks], ["slipping", "rolling"], "frictionless")
    return contacts[state > 0]
