"""Muscles as bands: how wide they are, their surface, and their colour by activation."""

from __future__ import annotations

import numpy as np

from ...kinematics.chain.muscle import MuscleState, muscles
from ...mechanism import Mechanism
from ...mechanism.chain import limits
from ...mechanism.vocabulary import of_muscles
from .place import Scene
from .solids import Mesh, Solid, tube

WIDE = 0.26  # width of the strongest muscle over the size of a picture; others by root of force
NARROWEST = 0.4  # of that
FLAT = 0.35  # thickness over width
BELLY = ((0.0, 0.35), (0.2, 0.8), (0.5, 1.0), (0.8, 0.8), (1.0, 0.35))  # width along the line
SIDES = 8
# From rest to full activation, on light and on dark grounds; the last beyond 1.
ACTIVATION = (
    ("#e6d3c8", "#d3694f", "#7d0716", "#105dca"),
    ("#54423f", "#c4513f", "#ffb8a0", "#4491e5"),
)


def bands(mechanism: Mechanism, scene: Scene, size: float) -> list[Solid]:
    """A band for each muscle; none where a mechanism is not of muscles."""
    if not of_muscles(mechanism):
        return []
    force = np.array(
        [c.muscle.max_force if c.kind == "muscle" else limits(c).greatest for c in mechanism.chains]
    )
    force = np.where(np.isfinite(force), force, np.nan)
    strongest = np.nanmax(force) if np.isfinite(force).any() else 1.0
    width = np.clip(np.sqrt(np.nan_to_num(force / strongest)), NARROWEST, 1.0)
    meshes = []
    for chain, part in zip(mechanism.chains, width, strict=True):
        points = tuple(scene.chains[chain.name].points)
        line = scene.line(chain.name, points, 0)
        mesh = band(line, WIDE * size * float(part))
        meshes.append(Solid("chains", chain.name, *mesh, "activation", "line", points))
    return meshes


def band(line: np.ndarray, width: float) -> Mesh:
    """A closed band to be swept along a line, (m, 3) [m]; its belly is halfway by length."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)]) / (steps.sum() or 1.0)
    at = np.sort(np.concatenate([[t for t, _ in BELLY], along[1:-1]]))
    half = 0.5 * width * np.interp(at, *np.transpose(BELLY))
    return tube(half, np.interp(at, along, np.arange(len(line))), FLAT, SIDES)


def activation_of(
    mechanism: Mechanism, effort: np.ndarray, joint: np.ndarray, rate: np.ndarray
) -> np.ndarray:
    """Activations (N, n) by forces, joint coordinates and their rates, (N, n) each.

    Of a cable, force over greatest force; NaN without a limit.
    """
    greatest = np.array([limits(chain).greatest for chain in mechanism.chains])
    with np.errstate(invalid="ignore", divide="ignore"):
        activation = np.abs(effort) / np.where(np.isfinite(greatest), greatest, np.nan)
        if driven := muscles(mechanism.chains):
            state = MuscleState.of(mechanism.chains, joint, rate)
            activation[:, driven] = ((effort - state.passive) / state.active)[:, driven]
    return activation


def activation_colour(value: float, dark: bool = False) -> str:
    """Colour of an activation, "#rrggbb"; one that is not known looks like rest."""
    *stops, beyond = ACTIVATION[dark]
    if value > 1.0 + 1e-6:
        return beyond
    rgb = np.array([[int(stop[i : i + 2], 16) for i in (1, 3, 5)] for stop in stops])
    at = np.clip(np.nan_to_num(value), 0.0, 1.0) * (len(stops) - 1)
    mixed = [np.interp(at, np.arange(len(stops)), channel) for channel in rgb.T]
    return "#" + "".join(f"{round(channel):02x}" for channel in mixed)
