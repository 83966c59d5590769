"""A solution in a few lines."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..kinematics.causes import shortfall_text
from ..mechanism.mechanism import Mechanism
from ..mechanism.vocabulary import words_of
from .contacts import BOUND_TOLERANCE, joint_loads, load_sign
from .emg_followed import emg_lags
from .failed_samples import Failure
from .row_stream import GREATEST_ACTIVATION

if TYPE_CHECKING:
    import xarray as xr

FEW = 6  # intervals without a result that a screen shows


@dataclass(frozen=True)
class Summary:
    """Summary of a run: `data` for programs, `str` to read, in the words of the mechanism."""

    data: dict[str, Any]
    mechanism: Mechanism

    def __str__(self) -> str:
        d, say = self.data, words_of(self.mechanism)
        width = max(map(len, [*d["peak_effort"], *d["peak_contact_force"]]), default=0)
        lines = [
            f"{d['mechanism']}: {d['samples']} samples, {d['time'][0]:g} to {d['time'][1]:g} s, "
            f"{d['formulation']}/{d['route']}, {d['seconds']:.2f} s",
            say("peak effort") + (", peak power and work" if d["power"] else ""),
        ]
        for name, (value, unit) in d["peak_effort"].items():
            own = d["power"].get(name)
            power = "" if own is None else f"{own['peak']:11.4g} W{own['work']:11.4g} J"
            lines.append(f"  {name:<{width}}  {value:10.5g} {unit}{power}")
        if (most := d["greatest_activation"]) is not None:
            lines.append(
                f"{say(GREATEST_ACTIVATION)}: "
                f"{most['value']:.4g}, {most['chain']} at t = {most['time']:g} s"
            )
        if lags := d["emg_lag"]:
            lines.append("activation behind its EMG, and their correlation there")
            lines += [
                f"  {name:<{width}}  {1e3 * lag['lag']:8.0f} ms {lag['correlation']:8.2f}"
                for name, lag in lags.items()
            ]
        if (most := d["residual"]) is not None:
            lines.append(
                "not balanced by EMG's activations: "
                f"at most {most['force']:.4g} N and {most['moment']:.4g} N m"
            )
        if fit := d["contact_fit"]:
            lines.append(say("moved onto the contacts (RMS, at most)"))
            lines += [
                f"  {name:<{width}}  {rms * 1e3:10.4g} {most * 1e3:10.4g} mm"
                for name, (rms, most) in fit.items()
            ]
        if (own := d["gravity"]) is not None:
            lines.append(
                f"gravity of the motion: {own['least']:.4g} to {own['most']:.4g} m/s^2, at most "
                f"{own['tilt']:.3g} degrees from the mechanism's"
            )
        if (most := d["moving_base"]) is not None:
            lines.append(
                f"{say('effort')} for the base's motion: at most {most['value']:.4g} "
                f"{most['unit']}, {most['chain']} at t = {most['time']:g} s"
            )
        if d["peak_contact_force"]:
            lines.append(say(f"peak contact force ({load_sign(self.mechanism)})"))
            ends = np.transpose([*d["peak_contact_force"].values()])
            loads = np.sort(joint_loads(self.mechanism, ends), axis=0)
            lines += [
                f"  {name:<{width}}  {low:10.5g} to {high:.5g} N"
                for name, low, high in zip(d["peak_contact_force"], *loads, strict=True)
            ]
        for name, most in d["peak_pressure"].items():
            lines.append(
                f"peak pressure: {name}, {most['pressure'] * 1e-6:.4g} MPa on "
                f"{most['area'] * 1e6:.4g} mm^2, {most['indentation'] * 1e3:.3g} mm deep, at t = "
                f"{most['time']:g} s"
            )
        for name, work in d["friction_work"].items():
            lines.append(f"work of friction: {name}, {work:.5g} J")
        near = d["closest_to_singularity"]
        if near is not None:
            lines.append(
                f"{say('closest to a singularity')}: ratio {near['ratio']:.4g} "
                f"at t = {near['time']:g} s; {d['samples_near_singularity']} samples below 1e-3"
            )
        for name, bound in d["closest_to_bounds"].items():
            lines.append(
                f"closest to the bounds: {name}, {abs(bound['margin']) * 1e3:.4g} mm "
                f"{'OUTSIDE' if bound['margin'] < 0 else 'inside'} at t = {bound['time']:g} s"
            )
        for name, loss in d["contact_loss"].items():
            first = f"first at t = {loss['time']:g} s"
            lines.append(f"{say('contact loss')}: {name} in {loss['samples']} samples, {first}")
        for name, lift in d["contact_lifts"].items():
            times = "once" if lift["count"] == 1 else f"{lift['count']} times"
            speed = lift["landing_speed"]
            lines.append(
                f"{say('contact open')}: {name} {times}, {lift['open']:.4g} s in all, from t = "
                f"{lift['first']:.6g} to {lift['last']:.6g} s"
                + ("" if speed is None else f", lands at up to {speed:.4g} m/s")
            )
        if d["failed_samples"]:
            lines.append(f"samples without a result: {d['failed_samples']}")
            if d["shortfall"] is not None:
                lines.append(f"  {shortfall_text(d['shortfall'])}, to serve all of them")
            lines += [f"  {Failure(**failure)}" for failure in d["failures"][:FEW]]
            if (more := len(d["failures"]) - FEW) > 0:
                lines.append(f"  and {more} more intervals")
        return "\n".join(lines)


def summarize(solution: xr.Dataset) -> Summary:
    """Samples, time, peaks, and the closest approach to singularities and bounds."""
    time = solution["time"].values
    effort, contact = solution["effort"].values, solution["contact_force"].values
    ok = solution["status"].values == 0
    units = solution["effort_unit"].values
    margins, ratio = solution["bound_margin"].values, solution["singularity_ratio"].values
    options, failed = solution.condyle.options, solution.condyle.failures
    some = bool(ok.any())
    bounds = {}
    for i, name in enumerate(solution["contact"].values):
        if some and np.isfinite(margins[ok, i]).any():
            k = int(np.nanargmin(margins[:, i]))
            margin = float(margins[k, i])
            if abs(margin) < BOUND_TOLERANCE:  # rounding is no distance
                margin = 0.0
            bounds[str(name)] = {"margin": margin, "time": float(time[k])}
    lost = solution["contact_loss"].values
    closest = int(np.nanargmin(ratio)) if some else None
    return Summary(
        {
            "mechanism": solution.attrs["mechanism_name"],
            "samples": len(time),
            "failed_samples": int((~ok).sum()),
            "failures": [asdict(failure) for failure in failed],
            "time": [float(time[0]), float(time[-1])],
            "formulation": options["formulation"],
            "route": options["route"],
            "seconds": options["solve_seconds"],
            "peak_effort": {
                str(name): [float(np.nanmax(np.abs(effort[:, i]))), str(units[i])]
                for i, name in enumerate(solution["chain"].values)
                if some
            },
            "greatest_activation": _greatest_activation(solution),
            "emg_lag": emg_lags(solution),
            "residual": _residual(solution),
            "contact_fit": options.get("contact_fit"),
            "gravity": _gravity(solution),
            "moving_base": _moving_base(solution),
            "distribution": options.get("distribution", "minimum_norm"),
            "power": _power(solution),
            "friction_work": _friction_work(solution),
            "peak_pressure": _peak_pressure(solution),
            "shortfall": max(
                (f.shortfall for f in failed if f.shortfall is not None), default=None
            ),
            "peak_contact_force": {
                str(name): [float(np.nanmin(contact[:, i])), float(np.nanmax(contact[:, i]))]
                for i, name in enumerate(solution["contact"].values)
                if some
            },
            "closest_to_singularity": None
            if closest is None
            else {"ratio": float(ratio[closest]), "time": float(time[closest])},
            "samples_near_singularity": int((solution["singularity"].values != 0).sum()),
            "closest_to_bounds": bounds,
            "contact_loss": {
                str(name): {
                    "samples": int(lost[:, i].sum()),
                    "time": float(time[np.argmax(lost[:, i])]),
                }
                for i, name in enumerate(solution["contact"].values)
                if lost[:, i].any()
            },
            "contact_lifts": solution.condyle.contact_lifts,
            "warnings": solution.condyle.warnings,
            "notices": [notice.to_dict() for notice in solution.condyle.notices],
        },
        solution.condyle.mechanism,
    )


def _greatest_activation(solution: xr.Dataset) -> dict[str, Any] | None:
    """The largest activation: how much, whose and when; None without limits."""
    if "activation" not in solution or (found := peak(solution["activation"].values)) is None:
        return None
    sample, chain, value = found
    return {
        "value": abs(value),
        "chain": str(solution["chain"].values[chain]),
        "time": float(solution["time"].values[sample]),
    }


def _residual(solution: xr.Dataset) -> dict[str, float] | None:
    """The largest force [N] and moment [N m] that activations of `emg` leave; None of others."""
    if "residual" not in solution:
        return None
    wrench = solution["residual"].values
    size = (np.linalg.norm(wrench[:, part], axis=1) for part in (slice(3), slice(3, 6)))
    force, moment = (float(np.fmax.reduce(a, initial=0.0)) for a in size)
    return {"force": force, "moment": moment}


def _gravity(solution: xr.Dataset) -> dict[str, float] | None:
    """Size of gravity [m/s^2] and its angle with the mechanism's [deg], where the motion has it."""
    if "gravity" not in solution:
        return None
    gravity, own = solution["gravity"].values, np.array(solution.condyle.mechanism.gravity)
    size = np.linalg.norm(gravity, axis=1)
    across = np.linalg.norm(np.cross(gravity, own), axis=1)
    tilt = np.degrees(np.arctan2(across, gravity @ own))
    return {"least": float(size.min()), "most": float(size.max()), "tilt": float(tilt.max())}


def _moving_base(solution: xr.Dataset) -> dict[str, Any] | None:
    """The largest effort that the base's motion asks for; None where the base is at rest."""
    if "share" not in solution or "base" not in solution["part"].values:
        return None
    if (found := peak(solution["share"].sel(part="base").values)) is None:
        return None
    sample, chain, value = found
    return {
        "value": abs(value),
        "unit": str(solution["effort_unit"].values[chain]),
        "chain": str(solution["chain"].values[chain]),
        "time": float(solution["time"].values[sample]),
    }


def peak(values: np.ndarray) -> tuple[int, int, float] | None:
    """Row, column and value of the largest magnitude of (N, m) values; None without any."""
    if not np.isfinite(values).any():
        return None
    row, column = np.unravel_index(np.nanargmax(np.abs(values)), values.shape)
    return int(row), int(column), float(values[row, column])


def work(power: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Integral of powers (N, m) [W] by the trapezoidal rule, (m,) [J], as far as they are known.

    The sum does not depend on how the numbers lie in memory, which differs once a file is opened.
    """
    pieces = np.diff(time)[:, None] * (power[1:] + power[:-1]) / 2
    return np.nansum(np.ascontiguousarray(pieces), axis=0)


def _power(solution: xr.Dataset) -> dict[str, dict[str, float]]:
    """Peak power [W] and work [J] of every actuator; nothing where nothing moves."""
    if "actuator_power" not in solution:  # written before there was one
        return {}
    power = solution["actuator_power"].values
    peak = np.nanmax(np.abs(power), axis=0, initial=0.0)
    done = work(power, solution["time"].values)
    if not peak.any():
        return {}
    return {
        str(name): {"peak": float(peak[i]), "work": float(done[i])}
        for i, name in enumerate(solution["chain"].values)
    }


def _friction_work(solution: xr.Dataset) -> dict[str, float]:
    """Work of friction on the platform [J] at the contacts where there is some."""
    if "friction_power" not in solution:
        return {}
    power = solution["friction_power"].values
    done = work(power, solution["time"].values)
    names = solution["contact"].values
    return {str(name): float(done[i]) for i, name in enumerate(names) if done[i]}


def _peak_pressure(solution: xr.Dataset) -> dict[str, dict[str, float]]:
    """The largest pressure [Pa] of each contact that has one, its time [s] and its patch then."""
    if "peak_pressure" not in solution:
        return {}
    peaks = {}
    for i, name in enumerate(solution["contact"].values):
        if np.isfinite(own := solution["peak_pressure"].values[:, i]).any():
            k = int(np.nanargmax(own))
            patch = {"area": "contact_area", "indentation": "indentation"}
            peaks[str(name)] = {
                "pressure": float(own[k]),
                "time": float(solution["time"].values[k]),
                **{key: float(solution[of].values[k, i]) for key, of in patch.items()},
            }
    return peaks
