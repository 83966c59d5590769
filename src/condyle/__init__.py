"""condyle: dynamics of redundantly actuated parallel mechanisms held at point contacts.

mechanism = condyle.load_mechanism("masticatory")
model = condyle.derive(mechanism, formulation="momentum", route="core")
solution = model.solve(condyle.reference_motion(), condyle.reference_load())
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .accessors import register
from .version import __version__

# Heavy rooms open when they are entered: `import condyle` alone loads nothing.
_HOMES = {
    "AmbiguousError": "errors",
    "CondyleError": "errors",
    "InfeasibleError": "errors",
    "InputError": "errors",
    "AccuracyError": "errors",
    "GimbalLockError": "errors",
    "JammedError": "errors",
    "MechanismError": "errors",
    "SingularError": "errors",
    "UnreachableError": "errors",
    "UnsupportedError": "errors",
    "Mechanism": "mechanism",
    "bundled_mechanisms": "mechanism",
    "dump": "mechanism",
    "dumps": "mechanism",
    "load_mechanism": "mechanism",
    "motion_from_c3d": "markers",
    "Model": "model.model",
    "derive": "model.model",
    "Distribution": "model.distributing",
    "Load": "motion",
    "Motion": "motion",
    "reference_load": "motion",
    "reference_motion": "motion",
    "trial_motion": "motion",
    "write_reference": "motion",
    "open_solution": "results.solution",
    "derivative_states": "results.derivative_rows",
    "forward_states": "results.forward_rows",
    "pose_states": "results.pose_rows",
    "solve_states": "results.inverse_rows",
    "Scenario": "simulation",
    "load_scenario": "simulation",
    "simulate": "simulation",
    "check_gains": "simulation",
    "write_log": "simulation.recorded_log",
    "ScenarioError": "errors",
    "workspace_map": "analysis.map",
    "workspace_size": "analysis.map",
    "open_map": "analysis.map",
    "identify": "identification.identify",
    "calibrate": "identification.calibrate",
    "excite": "identification.excite",
    "design": "analysis.design",
    "optimise": "optimisation.optimal_motion",
    "plan_path": "optimisation.path_study",
    "largest_bite": "analysis.bite",
    "cite": "analysis.cite",
    "literature": "analysis.literature",
    "run": "analysis.run_motion",
    "compare": "analysis.comparison",
    "tradeoff": "analysis.weight_curve",
    "schema": "analysis.studies",
    "check": "report.mechanism_summary",
    "measure_session": "report.measured_session",
    "video": "report.video",
    "write_report": "report.page",
    "serve_view": "view",
    "new_mechanism": "export.new_mechanism",
    "new_study": "export.new_study",
    "Study": "analysis.sweep",
    "sweep": "analysis.sweep",
    "open_sweep": "analysis.sweep",
    "export_controller": "export.controller",
    "export_c": "export.c_package",
    "export_fmu": "export.fmu",
    "export_acados": "export.acados",
    "export_matlab": "export.matlab",
    "export_mjcf": "export.mjcf",
    "export_ros2": "export.ros2",
}

if TYPE_CHECKING:
    from .analysis.bite import largest_bite
    from .analysis.cite import cite
    from .analysis.comparison import compare
    from .analysis.design import design
    from .analysis.literature import literature
    from .analysis.map import open_map, workspace_map, workspace_size
    from .analysis.run_motion import run
    from .analysis.studies import schema
    from .analysis.sweep import Study, open_sweep, sweep
    from .analysis.weight_curve import tradeoff
    from .errors import (
        AccuracyError,
        AmbiguousError,
        CondyleError,
        GimbalLockError,
        InfeasibleError,
        InputError,
        JammedError,
        MechanismError,
        ScenarioError,
        SingularError,
        UnreachableError,
        UnsupportedError,
    )
    from .export.acados import export_acados
    from .export.c_package import export_c
    from .export.controller import export_controller
    from .export.fmu import export_fmu
    from .export.matlab import export_matlab
    from .export.mjcf import export_mjcf
    from .export.new_mechanism import new_mechanism
    from .export.new_study import new_study
    from .export.ros2 import export_ros2
    from .identification.calibrate import calibrate
    from .identification.excite import excite
    from .identification.identify import identify
    from .markers import motion_from_c3d
    from .mechanism import Mechanism, bundled_mechanisms, dump, dumps, load_mechanism
    from .model.distributing import Distribution
    from .model.model import Model, derive
    from .motion import (
        Load,
        Motion,
        reference_load,
        reference_motion,
        trial_motion,
        write_reference,
    )
    from .optimisation.optimal_motion import optimise
    from .optimisation.path_study import plan_path
    from .report.measured_session import measure_session
    from .report.mechanism_summary import check
    from .report.page import write_report
    from .report.video import video
    from .results.derivative_rows import derivative_states
    from .results.forward_rows import forward_states
    from .results.inverse_rows import solve_states
    from .results.pose_rows import pose_states
    from .results.solution import open_solution
    from .simulation import Scenario, check_gains, load_scenario, simulate
    from .simulation.recorded_log import write_log
    from .view import serve_view

# What later rooms give to models, solutions, comparisons and exports, which do not know them.
register("model.solve", "condyle.results.solving:solve")
register("model.variants", "condyle.model.variants:Variants")
register("variants.solve", "condyle.results.variant_solutions:solve")
register("variants.simulate", "condyle.simulation.simulating:of_variants")
register("model.base_parameters", "condyle.identification.base_parameters:base_parameters")
register("model.to_casadi", "condyle.frameworks.casadi_functions:CasadiFunctions")
register("model.to_torch", "condyle.frameworks.torch_functions:TorchFunctions")
register("model.to_jax", "condyle.frameworks.jax_functions:JaxFunctions")
register("solution.plot", "condyle.report.figures:solution_plots")
register("solution.table", "condyle.results.summary:summarize")
register("map.plot", "condyle.report.figures.map_figures:map_plots")
register("map.table", "condyle.report.map_text:map_table")
register("sweep.plot", "condyle.report.figures.sweep_figures:sweep_plots")
register("sweep.table", "condyle.report.tables.sweep_tables:sweep_text")
register("tables.text", "condyle.report.tables:tables_text")
register("answer.report", "condyle.report.answer_page:write_page")
register("mechanism.picture", "condyle.report.cell:mechanism_picture")
register("mechanism.look", "condyle.report.scene.parts:Look")

__all__ = [*_HOMES, "__version__"]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f".{_HOMES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
