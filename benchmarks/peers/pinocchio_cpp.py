"""Pinocchio in C++, header-only, from the `pin` wheel's own include directory."""

from __future__ import annotations

from importlib.metadata import distribution

from .compiled import CompiledPeer


class _PinocchioCpp(CompiledPeer):
    packages = ("pin", "cmeel-eigen")

    def _options(self) -> list[str]:
        # The wheels around `pin` share one prefix: Pinocchio, Boost and Eigen.
        include = distribution("cmeel-eigen").locate_file("cmeel.prefix/include")
        return [
            f"-isystem{include}",
            f"-isystem{include}/eigen3",
            # Pinocchio has more joint types and visitor arguments than Boost's own limits allow.
            "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
            "-DBOOST_MPL_LIMIT_LIST_SIZE=50",
            "-DBOOST_MPL_LIMIT_VECTOR_SIZE=50",
            "-DBOOST_FUSION_INVOKE_MAX_ARITY=10",
        ]


class PinocchioTree(_PinocchioCpp):
    """RNEA on the whole cut tree."""

    title = "Pinocchio C++, cut tree"
    source = "pinocchio_tree.cpp"


class PinocchioFree(_PinocchioCpp):
    """RNEA on six free couplers, the rest by hand: the fastest found."""

    title = "Pinocchio C++, free couplers"
    source = "pinocchio_free.cpp"


class PinocchioDerivatives(PinocchioFree):
    """With the couplers' own derivatives too, which is not yet those of torques by q, q', q''."""

    title = "Pinocchio C++, computeRNEADerivatives of free couplers"

    def _options(self) -> list[str]:
        return [*super()._options(), "-DDERIVATIVES"]
