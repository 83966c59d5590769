"""The check that results are as accurate as required."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import AccuracyError, InputError, brief

FEW_DIGITS = 1e-6  # bound of the relative error above which a warning says so


def max_error_of(given: Any) -> float | None:
    """The largest bound that is accepted; None: any.

    Raises: InputError: for anything but a positive number.
    """
    if given is None:
        return None
    if isinstance(given, bool) or not isinstance(given, int | float | np.number) or not given > 0:
        raise InputError(
            f"max_error: expected a positive number such as 1e-8, got {brief(given)}; it is the "
            "largest relative error that is accepted"
        )
    return float(given)


def require_accuracy(
    bound: np.ndarray, max_error: float | None, t: np.ndarray | None = None, first_row: int = 0
) -> None:
    """Raises AccuracyError for samples whose bounds exceed `max_error`.

    Args: bound: (N,), NaN where there is no result.
          t: times, (N,) [s]; without, samples are rows of a file that start at `first_row`.
    """
    if max_error is None or not (bad := np.flatnonzero(bound > max_error)).size:
        return
    first, row = int(bad[0]), first_row + int(bad[0]) + 1
    place: dict[str, Any] = {"row": row} if t is None else {"time": float(t[first])}
    where = f"row {row}" if t is None else f"t = {t[first]:g} s (sample {first})"
    more = f"; {bad.size - 1} more exceed it" if bad.size > 1 else ""
    value = float(bound[first])
    raise AccuracyError(
        f"the relative error at {where} may be {value:.2g}, more than --max-error "
        f"{max_error:g}{more}.",
        bad.tolist(),
        hint="Keep away from singularities and limits of the chains, or raise --max-error "
        "(max_error=)",
        value=value,
        bound=max_error,
        unit="1",
        **place,
    )
