"""Points held against markers between trials: whether all stand in one frame.

Every trial says where its markers are in {S} at home. Where points were given as numbers and the
head stood elsewhere, the registration is wrong though its residuals stay the same: then the fixed
markers are at other places in {S} than in the first trial.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .marker_report import MarkerMotion

APART = 2e-3  # m, beyond which trials disagree


def between_trials(
    trials: Sequence[MarkerMotion],
) -> tuple[dict[str, dict[str, float]], tuple[str, ...]]:
    """Distances of each trial's markers at home from the first's, in {S}.

    Returns: source of the recording -> body -> root mean square over markers [m], and warnings.
    """
    distances: dict[str, dict[str, float]] = {}
    warnings = []
    for other in trials[1:]:
        first, here = trials[0].home_places, other.home_places
        apart = distances[other.recording.source] = {}
        for body in first:
            if common := first[body].keys() & here[body].keys():
                way = [first[body][name] - here[body][name] for name in common]
                apart[body] = float(np.sqrt((np.array(way) ** 2).sum(axis=1).mean()))
        if apart.get("fixed", 0.0) > APART:
            warnings.append(
                f"{other.recording.source}: points and markers disagree with "
                f"{trials[0].recording.source}: at home the fixed markers are "
                f"{apart['fixed'] * 1e3:.3g} mm elsewhere in {{S}}. Points given as numbers hold "
                "in one recording only: name it as the static trial (static)"
            )
        elif apart.get("platform", 0.0) > APART:
            warnings.append(
                f"{other.recording.source}: at home the platform is {apart['platform'] * 1e3:.3g} "
                f"mm from where it is in {trials[0].recording.source}; did markers move on their "
                "body, or were the teeth not closed?"
            )
    return distances, tuple(warnings)
