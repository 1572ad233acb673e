"""Results of `solve` and `pair`. numpy is imported when it is needed: the package can be imported without."""


def _arrays(lists):
    import numpy as np

    return {name: np.array(value) if isinstance(value, list) else value for name, value in lists.items()}


def _kinds(dimensions):
    """Shapes of a vector, and of one perpendicular to a line of centres, which is a number in a layer."""
    return (dimensions,), () if dimensions == 2 else (dimensions,)


def _records(rows, fields):
    def entry(value, field):
        if not isinstance(value, list):
            return value
        return tuple(value) if field[2:] and field[2] else value[0]

    import numpy as np

    records = [tuple(entry(value, field) for value, field in zip(row, fields)) for row in rows]
    return np.array(records, dtype=fields)


def touching(contacts, dimensions):
    """The pairs in contact of a run as a structured array."""
    v, a = _kinds(dimensions)
    fields = [("i", "i8"), ("j", "i8"), ("normal", "f8", v), ("gap", "f8"), ("normal_force", "f8")]
    return _records(contacts, fields + [("tangential_force", "f8", a), ("state", "U12")])


class Solution:
    """Motion, stresslets and contacts of a configuration.

    Units: radius a, viscosity mu and shear rate are 1. What is averaged over the cell is None in unbounded fluid.

    Attributes
    ----------
    velocity_disturbance : array [N, 2], of a suspension [N, 3]
        Velocities minus the background flow at the own centre.
    angular_velocity_disturbance : array [N], of a suspension [N, 3]
        Angular velocities minus that of the background.
    stresslet_xx, stresslet_yy, stresslet_xy : array [N]
    stresslet_xz, stresslet_yz : array [N]
        Of a suspension; None of a layer.
    viscosity, viscosity_stresslet : float
        Relative viscosity in full, and from the stresslets alone.
    dissipation : float
        v'Rv over volume and shear rate.
    n1, n2, particle_pressure : float
        Normal stress differences, particle pressure of contacts and repulsion.
    pressure_hydrodynamic : float
        Particle pressure of the fluid, which no other number includes.
    stress : dict of dicts
        The same and the shear stress, by cause, as in `sweep solve --json`.
    computing_time_s : float
        Seconds of the computation itself, without conversions.
    """

    def __init__(self, answer, dimensions, computing_time_s):
        self._pairs = answer.pop("contacts")
        self._dimensions = dimensions
        for name in ("stresslet_xz", "stresslet_yz"):
            answer.setdefault(name, None)
        self.__dict__.update(_arrays(answer))
        # Also without any sphere.
        self.velocity_disturbance = self.velocity_disturbance.reshape(-1, dimensions)
        self.computing_time_s = computing_time_s

    @property
    def contacts(self):
        """All candidate pairs, force 0 included: structured array with i, j, image [2], gap, normal [2], normal_force,
        tangential_force, normal_velocity, slip_velocity, rolling_force, rolling_velocity, state. In a suspension
        vectors have three components, and so have forces and velocities perpendicular to the line of centres.
        """
        v, a = _kinds(self._dimensions)
        fields = [("i", "i8"), ("j", "i8"), ("image", "i8", v), ("gap", "f8"), ("normal", "f8", v), ("normal_force", "f8")]
        fields += [("tangential_force", "f8", a), ("normal_velocity", "f8"), ("slip_velocity", "f8", a)]
        fields += [("rolling_force", "f8", a), ("rolling_velocity", "f8", a), ("state", "U12")]
        names = [field[0] for field in fields]
        return _records(([pair[name] for name in names] for pair in self._pairs), fields)

    def __repr__(self):
        viscosity = "unbounded fluid" if self.viscosity is None else f"viscosity={self.viscosity!r}"
        return f"Solution({len(self.stresslet_xy)} spheres, {len(self._pairs)} candidate pairs, {viscosity})"


class Passed:
    """The trajectories of two spheres that pass each other.

    Attributes
    ----------
    final_offset : float
        y of the first sphere at the end, in radii of the first.
    rotation_degrees : array [2]
        Rotation of each sphere, anticlockwise.
    minimum_gap : float
        Smallest gap met.
    time : float
        Time taken, in mu a^2 / force.
    path : array [steps, 7]
        t, x1, y1, theta1, x2, y2, theta2 at each step, angles in radians.
    """

    def __init__(self, answer):
        self.__dict__.update(_arrays(answer))

    def __repr__(self):
        numbers = ", ".join(f"{name}={getattr(self, name)!r}" for name in ("final_offset", "minimum_gap", "time"))
        return f"Passed({numbers}, path=array [{len(self.path)}, 7])"
