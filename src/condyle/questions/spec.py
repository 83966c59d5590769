"""What shapes a kernel: the structure of a mechanism, without its numbers."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from ..mechanism.home import dependent_coordinates
from ..mechanism.mechanism import Mechanism

OUTPUTS = ("contact", "share", "motion", "joint")


@dataclass(frozen=True)
class KernelSpec:
    """Mechanisms with one spec share one kernel; their numbers are its inputs.

    chains:    (family, count) pairs, in the order in which families first occur.
    contacts:  (form of the surface, number of its constants) pairs.
    parallel:  two contacts on planes of one slope, written as their mean and difference.
    zeros:     parameters that are zero, and lane constants that are zero in every chain of a
               group: (-1, i) and (group, i). What they multiply is left out.
    outputs:   what is computed besides the torques, of `OUTPUTS`.
    moment:    whether the load has a moment as well as a force.
    """

    formulation: str
    route: str
    chains: tuple[tuple[str, int], ...]
    contacts: tuple[tuple[str, int], ...]
    dependent: tuple[str, ...]
    parallel: bool = False
    outputs: tuple[str, ...] = ()
    moment: bool = False
    zeros: tuple[tuple[int, int], ...] = ()

    @property
    def n(self) -> int:
        return sum(count for _, count in self.chains)

    @property
    def m(self) -> int:
        return 6 - len(self.contacts)

    def text(self) -> str:
        """Everything that tells one spec from another."""
        return repr(sorted(asdict(self).items()))


def kernel_spec(
    mechanism: Mechanism,
    formulation: str,
    route: str,
    outputs: tuple[str, ...] = (),
    moment: bool = False,
) -> KernelSpec:
    """The spec of a mechanism's kernel; see `condyle.questions.layout.specialise` for `zeros`."""
    counts: dict[str, int] = {}
    for chain in mechanism.chains:
        counts[chain.kind] = counts.get(chain.kind, 0) + 1
    loci = [c.locus for c in mechanism.contacts]
    contacts = tuple((locus.form, len(locus.constants())) for locus in loci)
    planes = [locus for locus in loci if locus.form == "plane"]
    parallel = len(contacts) == len(planes) == 2 and planes[0].slope == planes[1].slope
    return KernelSpec(
        formulation=formulation,
        route=route,
        chains=tuple(counts.items()),
        contacts=contacts,
        dependent=dependent_coordinates(mechanism),
        parallel=parallel,
        outputs=tuple(o for o in OUTPUTS if o in outputs),
        moment=moment,
    )
