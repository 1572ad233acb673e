"""The units of published soft-sphere simulations, as in `sweep convert`
(crates/sd-core/src/model/published_units.rs)."""

import math


class PublishedUnits:
    """Lengths in radii of the small spheres, stresses of a layer as thick as one of them."""

    def __init__(self, area_fraction, size_ratio, large_fraction):
        large = large_fraction if size_ratio > 1 else 0.0

        def moment(power):
            return 1 - large + large * size_ratio**power

        self.mean_radius = moment(1)
        self.isolated = 5 / 3 * area_fraction * moment(3) / (moment(1) * moment(2))

    def difference(self, ours):
        """A difference or an error of viscosities."""
        return 2 * self.mean_radius * ours

    def viscosity(self, ours):
        return 1 + self.difference(ours - 1 - self.isolated)

    def shear_stress(self, viscosity, shear_rate):
        """The stress in F_crit / a_s²."""
        return self.viscosity(viscosity) * shear_rate / self.mean_radius**2 / (6 * math.pi)
