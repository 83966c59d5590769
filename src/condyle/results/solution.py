"""Results: one labelled dataset with units, and the files it becomes."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from .. import __version__
from ..atomic import replacing
from ..errors import InputError, no_such_file
from ..kinematics.chain import FAMILIES
from ..kinematics.singularity import KINDS, NEAR
from ..mechanism.files import recall, record
from ..mechanism.home import home_warnings
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..model import STATUS_NAMES
from ..progress import step
from .accessors import extend

if TYPE_CHECKING:
    from ..model import Evaluation, Model
    from ..motion import Load, Motion

AXES = ("x", "y", "z")
WRENCH = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
POSE_UNITS = "m, m, m, rad, rad, rad"
LIFT_OFF = {
    "units": "1",
    "long_name": "whether a one-sided contact would have to pull: the ball lifts off",
}


class Solution(xr.Dataset):
    """Inverse dynamics along a motion: an `xarray.Dataset` that knows its mechanism.

    Dimensions time, chain, contact, coordinate, part, axis. The variables and their units are in
    the documentation's table of results; each has the attributes `units` and `long_name`.
    """

    __slots__ = ()

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism that was solved.

        In the place of a surface written in Python is an `Unknown` one, which has no equation.
        """
        return recall(self.attrs["mechanism"], self.attrs["mechanism_name"])

    @property
    def warnings(self) -> list[str]:
        """What the run had to say."""
        return json.loads(self.attrs["warnings"])

    @property
    def options(self) -> dict[str, Any]:
        """How the solution was made: formulation, route, sources, seconds."""
        return json.loads(self.attrs["options"])

    @property
    def plot(self) -> Any:  # type: ignore[override]
        """Figures: `solution.plot.torque()` and friends; xarray's own are there too."""
        return extend("solution.plot", self)

    def save(self, *paths: str | Path) -> None:
        """Write as NetCDF (.nc) or CSV (.csv): every file whole, or none of them."""
        from ..motion import write_table

        with step("writing results"), ExitStack() as stack:
            for path in paths:
                suffix = Path(path).suffix.lower()
                if suffix not in (".nc", ".csv"):
                    raise InputError(
                        f'{path}: expected a name that ends in .nc or .csv, got "{suffix}"'
                    )
                temporary = stack.enter_context(replacing(path))
                if suffix == ".nc":
                    self.to_netcdf(temporary, engine="h5netcdf")
                else:
                    write_table(temporary, self.columns())

    def columns(self) -> dict[str, np.ndarray | list[str]]:
        """Columns of the CSV: t, tau_<chain>, contact_<contact>, pose, joint_<chain>.

        Then reactions, if there are any, lift_off_<contact> (0 or 1) of one-sided contacts, and
        status, if a sample failed.
        """
        columns: dict[str, np.ndarray | list[str]] = {"t": self["time"].values}
        columns |= named_columns("tau_", self["chain"].values, self["torque"].values)
        columns |= named_columns("contact_", self["contact"].values, self["contact_force"].values)
        columns |= named_columns("", self["coordinate"].values, self["pose"].values)
        columns |= named_columns("joint_", self["chain"].values, self["joint"].values)
        for variable in self.data_vars:
            if str(variable).startswith("reaction_") or variable == "contact_force_vector":
                owners = self[self[variable].dims[1]].values
                name = "reaction_contact" if variable == "contact_force_vector" else variable
                for i, axis in enumerate(AXES):
                    prefix, values = f"{name}_", self[variable].values[:, :, i]
                    columns |= {
                        f"{name}_{axis}": column
                        for name, column in named_columns(prefix, owners, values).items()
                    }
        columns |= lift_off_columns(self.mechanism, self["lift_off"].values)
        if self["status"].values.any():
            columns["status"] = [STATUS_NAMES[i] for i in self["status"].values]
        return columns


def named_columns(prefix: str, names: Any, values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{prefix}{name}": values[:, i] for i, name in enumerate(names)}


def open_solution(path: str | Path) -> Solution:
    """Read a solution that was saved as NetCDF.

    Raises: InputError: if the file is missing or is not a condyle solution.
    """
    if Path(path).is_dir():
        raise InputError(f"{path}: is a folder; give the name of a solution (.nc) in it")
    try:
        dataset = xr.load_dataset(path, engine="h5netcdf")
    except FileNotFoundError:
        raise no_such_file(path) from None
    except Exception as error:
        raise InputError(f"{path} is not a NetCDF solution: {error}") from None
    if "mechanism" not in dataset.attrs or "torque" not in dataset:
        raise InputError(f"{path} is NetCDF, but not a condyle solution")
    solution = Solution(dataset.data_vars, dataset.coords, dataset.attrs)
    if "lift_off" not in solution:  # written before there were one-sided contacts
        force = solution["contact_force"]
        lifted = lift_off(solution.mechanism, force.values)
        solution["lift_off"] = force.dims, lifted, LIFT_OFF
    return solution


def assemble(
    model: Model,
    motion: Motion,
    load: Load,
    wrench: np.ndarray,
    load_point: str | None,
    evaluation: Evaluation,
    residual: float | None,
    seconds: float,
) -> Solution:
    """The labelled dataset of an evaluation along a motion."""
    mechanism = model.mechanism
    e, t, p = evaluation.poses, evaluation.torques, evaluation.posture
    assert t.contact_force is not None
    ok = evaluation.status == 0
    efforts = [FAMILIES[chain.kind].effort_unit for chain in mechanism.chains]
    joints = [FAMILIES[chain.kind].joint_unit for chain in mechanism.chains]
    effort, joint = ", ".join(dict.fromkeys(efforts)), ", ".join(dict.fromkeys(joints))
    s = p.singularity

    def variable(dims: tuple[str, ...], values: Any, units: str, name: str) -> tuple[Any, ...]:
        values = np.array(values, dtype=float)
        values[~ok if dims[0] == "time" else (slice(None), ~ok)] = np.nan
        return dims, values, {"units": units, "long_name": name}

    by_chain, by_pose = ("time", "chain"), ("time", "coordinate")
    variables = {
        "pose": variable(by_pose, e.pose, POSE_UNITS, "pose of the platform X_EE"),
        "pose_rate": variable(by_pose, e.rate, per_second(POSE_UNITS, 1), "rate of X_EE"),
        "pose_acceleration": variable(
            by_pose, e.acceleration, per_second(POSE_UNITS, 2), "acceleration of X_EE"
        ),
        "torque": variable(by_chain, t.torque, effort, "actuator effort of least norm"),
        "share": variable(
            ("part", "time", "chain"), t.share, effort, "part of the effort each part needs"
        ),
        "contact_force": variable(
            ("time", "contact"),
            t.contact_force,
            "N",
            "contact force on the platform along the unit normal of the surface",
        ),
        "lift_off": (
            ("time", "contact"),
            lift_off(mechanism, t.contact_force) & ok[:, None],
            LIFT_OFF,
        ),
        "contact_point": variable(
            ("time", "contact", "axis"), p.contact_point, "m", "centre of the contact ball in {S}"
        ),
        "contact_normal": variable(
            ("time", "contact", "axis"),
            p.contact_normal,
            "1",
            "unit normal of the surface at the contact in {S}",
        ),
        "bound_margin": variable(
            ("time", "contact"),
            bound_margins(mechanism, p.contact_point),
            "m",
            "distance of the contact point to its nearest bound; negative outside",
        ),
        "joint": variable(by_chain, p.joint, joint, "joint coordinate, zero at home"),
        "joint_rate": variable(by_chain, t.rate, per_second(joint, 1), "joint rate"),
        "joint_acceleration": variable(
            by_chain, t.acceleration, per_second(joint, 2), "joint acceleration"
        ),
        "rod_beta": variable(by_chain, p.beta, "rad", "rod angle beta_i"),
        "rod_gamma": variable(by_chain, p.gamma, "rad", "rod angle gamma_i"),
        "load": variable(("time", "component"), wrench, "N, N m", "load on the platform in {S}"),
        "J_A": variable(
            by_chain,
            s.J_A,
            ", ".join(f"m^2/{unit}" for unit in joint.split(", ")),
            "diagonal of J_A, eq. (26)",
        ),
        "transmission": variable(by_chain, s.transmission, "1", "J_A made dimensionless"),
        "J_W_sigma": variable(
            ("time", "independent"), s.J_W_sigma, "1", "singular values of the dimensionless J_W"
        ),
        "condition": variable(("time",), s.condition, "1", "condition number of J_W"),
        "singularity_ratio": variable(
            ("time",), s.ratio, "1", "smallest over largest singular value of J_A or J_W"
        ),
        "singularity": (
            ("time",),
            np.where(ok, s.kind(), 0).astype(np.int8),
            {
                "units": "1",
                "long_name": "kind of singularity that is near",
                "flag_meanings": " ".join(KINDS),
            },
        ),
        "status": (
            ("time",),
            evaluation.status.astype(np.int8),
            {"units": "1", "long_name": "status", "flag_meanings": " ".join(STATUS_NAMES)},
        ),
    }
    coordinates = {
        "time": ("time", motion.t, {"units": "s", "long_name": "time"}),
        "chain": list(mechanism.chain_names),
        "contact": np.array(mechanism.contact_names, dtype=object),
        "coordinate": list(COORDINATES),
        "part": list(model.parts),
        "axis": list(AXES),
        "component": list(WRENCH),
        "independent": list(model.independent),
        "effort_unit": ("chain", efforts),
        "joint_unit": ("chain", joints),
    }
    options = {
        "formulation": model.formulation,
        "route": model.route,
        "motion": motion.source,
        "motion_sha256": motion.sha256,
        "motion_kind": motion.kind,
        "landmark": motion.landmark,
        "load": load.source,
        "load_sha256": load.sha256,
        "load_point": load_point,
        "independent": list(model.independent),
        "dependent": list(model.dependent),
        "characteristic_length": s.length,
        "contact_residual_of_given_pose": residual,
        "smoothing": None if motion.smoothing is None else str(motion.smoothing),
        "derivation_seconds": model.derivation_seconds,
        "solve_seconds": seconds,
    }
    solution = Solution(variables, coordinates)
    solution.attrs = {
        "title": f"Inverse dynamics of {mechanism.name}",
        "source": f"condyle {__version__}",
        "condyle_version": __version__,
        "mechanism_name": mechanism.name,
        "mechanism": record(mechanism),
        "options": json.dumps(options),
        "warnings": json.dumps(run_warnings(mechanism, solution, residual)),
    }
    return solution


def per_second(units: str, order: int) -> str:
    """'m/s, rad/s' for 'm, rad'."""
    suffix = "/s" if order == 1 else f"/s^{order}"
    return ", ".join(unit + suffix for unit in units.split(", "))


def bound_margins(mechanism: Mechanism, points: np.ndarray) -> np.ndarray:
    """Distance of contact points, (N, k, 3), to their nearest bound, (N, k); inf without one."""
    margins = np.full(points.shape[:2], np.inf)
    for i, contact in enumerate(mechanism.contacts):
        for axis, name in enumerate(AXES):
            if (interval := getattr(contact.bounds, name)) is not None:
                low, high = interval
                coordinate = points[:, i, axis]
                inside = np.minimum(coordinate - low, high - coordinate)
                margins[:, i] = np.minimum(margins[:, i], inside)
    return margins


def lift_off(mechanism: Mechanism, force: np.ndarray) -> np.ndarray:
    """Whether one-sided contacts would have to pull at contact forces (N, k), (N, k)."""
    push = np.array([c.push if c.one_sided else 0 for c in mechanism.contacts], dtype=float)
    return push * force < -FORCE_TOLERANCE


def lift_off_columns(mechanism: Mechanism, lifted: np.ndarray) -> dict[str, np.ndarray]:
    """Columns lift_off_<contact>, 0 or 1, of the contacts that can lift off."""
    return {
        f"lift_off_{contact.name}": lifted[:, i].astype(int)
        for i, contact in enumerate(mechanism.contacts)
        if contact.one_sided
    }


def run_warnings(mechanism: Mechanism, solution: Solution, residual: float | None) -> list[str]:
    """What the reader of the results should know."""
    warnings = [*home_warnings(mechanism), *bound_warnings(solution)]
    warnings += lift_off_warnings(solution)
    if residual is not None and residual > 1e-9:
        warnings.append(
            f"the given poses are up to {residual * 1e3:.3g} mm off the contact surfaces; the "
            "dependent coordinates were recomputed"
        )
    failed = int((solution["status"].values != 0).sum())
    if failed:
        warnings.append(f"{failed} samples are unreachable or singular and left empty")
    near = int((solution["singularity"].values != 0).sum())
    if near:
        warnings.append(f"{near} samples are near a singularity (ratio below {NEAR:g})")
    warnings += limit_warnings(mechanism, solution)
    if (np.abs(np.cos(solution["rod_gamma"].values)) < NEAR).any():
        warnings.append(
            "a rod comes near gamma_i = +-90 degrees, where its two angles lose their meaning; "
            "that is a singularity of the description, not of the mechanism"
        )
    return warnings


def bound_warnings(solution: Solution) -> list[str]:
    """Which contact leaves its bounds, when and by how much."""
    warnings = []
    for i, name in enumerate(solution["contact"].values):
        margin = solution["bound_margin"].values[:, i]
        outside = np.flatnonzero(margin < -BOUND_TOLERANCE)
        if outside.size:
            worst = int(np.nanargmin(margin))
            time = solution["time"].values
            warnings.append(
                f'contact "{name}" leaves its bounds at t = {time[outside[0]]:g} s '
                f"({outside.size} samples), by up to {-margin[worst] * 1e3:.3g} mm at "
                f"t = {time[worst]:g} s"
            )
    return warnings


BOUND_TOLERANCE = 1e-12  # metres: rounding at a bound is not outside
FORCE_TOLERANCE = 1e-12  # newtons: rounding of no force is not a pull


def lift_off_warnings(solution: Solution) -> list[str]:
    """Which one-sided contact would have to pull, since when and how often."""
    lifted, time = solution["lift_off"].values, solution["time"].values
    return [
        f'contact "{name}" lifts off at t = {time[np.argmax(lifted[:, i])]:g} s '
        f"({lifted[:, i].sum()} samples): there its surface would have to pull the ball"
        for i, name in enumerate(solution["contact"].values)
        if lifted[:, i].any()
    ]


def limit_warnings(mechanism: Mechanism, solution: Solution) -> list[str]:
    """Which actuator exceeds a limit, and by how much."""
    warnings = []
    with np.errstate(all="ignore"):
        for i, chain in enumerate(mechanism.chains):
            limits = chain.actuator.model_dump()
            effort = limits.get("torque_limit") or limits.get("force_limit")
            family = FAMILIES[chain.kind]
            for limit, variable, unit in (
                (effort, "torque", family.effort_unit),
                (limits.get("speed_limit"), "joint_rate", f"{family.joint_unit}/s"),
            ):
                peak = np.nanmax(np.abs(solution[variable].values[:, i]), initial=0.0)
                if limit is not None and peak > limit:
                    what = "effort" if variable == "torque" else "speed"
                    warnings.append(
                        f'chain "{chain.name}": {what} reaches {peak:.4g} {unit}, above its '
                        f"limit of {limit:g}"
                    )
    return warnings
