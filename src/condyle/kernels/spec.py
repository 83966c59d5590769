"""What shapes a kernel: the structure of a mechanism, without its numbers."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from ..mechanism.home import dependent_coordinates
from ..mechanism.mechanism import Mechanism

OUTPUTS = ("contact", "share", "motion", "joint")


@dataclass(frozen=True)
class KernelSpec:
    """Mechanisms with one spec share one kernel; their numbers are its inputs.

    chains:   (family, count) pairs, in the order in which families first occur.
    contacts: (kind of surface, number of its constants) pairs.
    outputs:  what is computed besides the torques, of `OUTPUTS`.
    moment:   whether the load has a moment as well as a force.
    """

    formulation: str
    route: str
    chains: tuple[tuple[str, int], ...]
    contacts: tuple[tuple[str, int], ...]
    dependent: tuple[str, ...]
    outputs: tuple[str, ...] = ()
    moment: bool = False

    @property
    def n(self) -> int:
        return sum(count for _, count in self.chains)

    @property
    def m(self) -> int:
        return 6 - len(self.contacts)

    def text(self) -> str:
        return repr(sorted(asdict(self).items()))


def kernel_spec(
    mechanism: Mechanism,
    formulation: str,
    route: str,
    outputs: tuple[str, ...] = (),
    moment: bool = False,
) -> KernelSpec:
    """The spec of a mechanism's kernel."""
    counts: dict[str, int] = {}
    for chain in mechanism.chains:
        counts[chain.kind] = counts.get(chain.kind, 0) + 1
    contacts = tuple((c.surface.kind, len(c.surface.constants())) for c in mechanism.contacts)
    return KernelSpec(
        formulation,
        route,
        tuple(counts.items()),
        contacts,
        dependent_coordinates(mechanism),
        tuple(o for o in OUTPUTS if o in outputs),
        moment,
    )
