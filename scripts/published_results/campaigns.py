"""The campaigns of results/published and their figures."""

import shutil

from . import lattices, windows
from .place import RESULTS, sweep


def figure(*options, suffix=""):
    """A figure NAME SUFFIX.svg, by the options of `sweep report`."""
    return suffix, options


def _of_areas():
    for c in ["0.57", "0.693", "0.75", "0.8"]:
        where = ("--where", f"area_fraction={c}")
        yield figure(*where, "--quantity", "viscosity_median", suffix=f"-{c}")
        yield figure(*where, "--quantity", "viscosity_stresslet", suffix=f"-{c}-stresslet")


def _of_rigid_thickening():
    for space, fractions in [("layers", "area_fraction=0.74,0.76,0.78"), ("suspensions", "volume_fraction=0.5,0.54,0.56")]:
        for kind, suffix in [("flow-curve", ""), ("state-diagram", "-states")]:
            yield figure("--kind", kind, "--where", "contact=rigid", "--where", fractions, suffix=f"-{space}{suffix}")


# In the order of the list in the README.
CAMPAIGNS = {
    # Their effects and the figure are made with the tables.
    "cause-of-thickening": [],
    "cause-of-thickening-full": [],
    "figure-06": [figure("--quantity", "mean_approach_velocity")],
    "figure-07": [figure("--kind", "contacts", "--where", "shear_rate=inf")],
    "figure-10": [figure("--kind", "trace")],
    "figure-11": [figure("--where", f"contact={contact}", suffix=f"-{contact}") for contact in ["rigid", "procedure"]],
    "figure-12": [
        *(figure("--where", f"area_fraction={c}", suffix=f"-{c}") for c in ["0.693", "0.75"]),
        # Short peaks near jamming dominate the means.
        figure("--where", "area_fraction=0.8", "--quantity", "viscosity_median", suffix="-0.8"),
    ],
    "figure-13": [figure()],
    "figure-14": [
        figure("--quantity", "viscosity_median"),
        figure("--quantity", "viscosity_stresslet", suffix="-stresslet"),
    ],
    "figure-14-procedure": list(_of_areas()),
    "figure-15": [figure()],
    "beyond-14": [figure("--quantity", "viscosity_median")],
    "stiff-limit": [figure("--along", "stiffness", "--quantity", "viscosity_median", "--where", "contact=linear-spring")],
    "time-step": [figure("--along", "time_step", "--quantity", "viscosity_median", "--panels", "area_fraction")],
    "field-model": [figure()],
    "field-plateau": [figure("--along", "area_fraction", "--where", "lubrication_regularisation=0.001")],
    "published-2d": [
        figure(
            *("--along", "shear_stress"),
            *("--where", "friction=1", "--where", "lubrication_regularisation=0.001", "--where", "spheres=200"),
            *("--where", "repulsion_length=0.0441", "--where", "stiffness=5348"),
        )
    ],
    "flow-curve": [figure("--kind", "flow-curve"), figure("--along", "shear_stress", suffix="-viscosity")],
    "quickstart": [figure()],
    "suspension": [figure("--along", "volume_fraction")],
    # Its figure is made with the tables.
    "suspension-plateaus": [],
    # Its effects and the figure too.
    "cause-of-thickening-bulk": [],
    "cause-of-thickening-bulk-full": [],
    "suspension-field-model": [figure("--along", "friction", "--panels", "spheres")],
    "suspension-random": [figure("--along", "volume_fraction")],
    # Their figure is made with the tables.
    "mu-of-j": [],
    "mu-of-j-loose": [],
    "flows": [figure("--along", "volume_fraction")],
    "brownian-viscosity": [figure("--along", "peclet")],
    "thermal-thickening": [
        figure("--along", "shear_rate", "--where", "friction=1"),
        figure("--along", "peclet", "--where", "friction=0", suffix="-frictionless"),
    ],
    "discontinuous": list(_of_rigid_thickening()),
    "hydrodynamic-friction": [
        figure("--along", "shear_stress", "--where", "area_fraction=0.7", suffix="-layers"),
        figure("--along", "shear_stress", "--where", "volume_fraction=0.5,0.54", "--panels", "volume_fraction", suffix="-suspensions"),
    ],
    # Its figure is made with the tables.
    "ordering": [],
    "suspension-controls": [
        figure("--along", "stiffness", "--quantity", "n1_over_stress", "--where", "spheres=200", "--where", "volume_fraction=0.54")
    ],
}
# Campaigns of which single runs are published too.
OF_EVERY_RUN = [name for name in CAMPAIGNS if name.startswith("cause-of-thickening") or name == "mu-of-j"]
# Fits of the model of Wyart and Cates, by suffix: the chosen points of a campaign. Parameters are
# in NAME-fit.json, residuals in NAME-fit.csv.
FITS = {
    # From the stress above which the repulsion has no effect.
    "published-2d": {
        "-fit": ["friction=1", "repulsion_length=0.0441", "stiffness=5348", "lubrication_regularisation=0.001", "spheres=200", "shear_stress=0.03..inf"]
    },
    "flow-curve": {"-fit": []},
}
# Two spheres that pass each other: `sweep pair`, by suffix.
PASSING = {
    "a": ["--no-contact"],
    "b": ["--roughness", "0.05"],
    "c": ["--roughness", "0.05", "--friction", "0.1"],
    "d": ["--roughness", "0.05", "--friction", "0.5"],
    "half": ["--roughness", "0.05", "--friction", "0.5", "--size-ratio", "0.5"],
    "tenth": ["--roughness", "0.05", "--friction", "0.5", "--size-ratio", "0.1"],
}
NAMES = [*CAMPAIGNS, "figure-08", "lattices"]


def _fit(campaign, name, wanted):
    """Fits the model of Wyart and Cates; writes no file if the program finds no parameters."""
    where = [word for value in wanted for word in ["--where", value]]
    files = [RESULTS / f"{name}.{ending}" for ending in ["svg", "csv", "json"]]
    for file in files:
        file.unlink(missing_ok=True)
    figure, residuals, parameters = files
    sweep("fit", campaign, "--quiet", *where, "--figure", figure, "--csv", residuals, "--json", output=parameters, may_fail=[2])
    if not parameters.stat().st_size:
        parameters.unlink()


def make(name):
    """Completes a campaign, and writes its report, CSV files and figures."""
    if name == "figure-08":
        for suffix, options in PASSING.items():
            file = RESULTS / f"figure-08-{suffix}"
            sweep("pair", "--figure", f"{file}.svg", *options, output=f"{file}.txt")
        return
    if name == "lattices":
        lattices.make()
        return
    campaign = f"sweeps/{name}.toml"
    # Failed runs are results too, shown in the report.
    report = RESULTS / f"{name}.txt.new"
    sweep("run", campaign, "--quiet", output=report, may_fail=[1])
    shutil.move(report, RESULTS / f"{name}.txt")
    sweep("report", campaign, "--quiet", "--csv", RESULTS / f"{name}.csv")
    if name in OF_EVERY_RUN:
        sweep("report", campaign, "--quiet", "--runs", RESULTS / f"{name}-runs.csv")
    if name in windows.WINDOWS:
        windows.make(name)
    for suffix, options in CAMPAIGNS[name]:
        sweep("report", campaign, "--quiet", "--figure", RESULTS / f"{name}{suffix}.svg", *options)
    for suffix, wanted in FITS.get(name, {}).items():
        _fit(campaign, f"{name}{suffix}", wanted)
