"""condyle run: the main job."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from . import options
from .answer import Answer, files_line
from .command import COMPUTE, command
from .inputs import look_at, require_drawing, warn, written


@command(
    COMPUTE,
    example="condyle run jaw.toml --motion path.csv --units mm,deg --load bite.csv --report",
)
def run(
    motion: options.MotionOptions,
    model: options.ModelOptions,
    distribution: options.DistributionOptions,
    output: options.OutputOptions,
    mechanism: options.Mechanism = "masticatory",
    reactions: options.Reactions = False,
    flag: options.Flag = False,
    max_error: options.MaxError = None,
    prove: Annotated[int | None, options.option(min=1)] = None,
    measured: options.Measured = None,
    vary: Path | None = None,
) -> Answer:
    """Efforts and contact forces along a motion (inverse dynamics).

    Without arguments: the bundled chewing robot, a synthetic chewing path and bite force.

    Options:
        prove: Number of samples whose digits are proven by interval arithmetic (takes mpmath).
        vary: Study (TOML) whose numbers vary: also quantiles of efforts and contact forces.
    """
    require_drawing(output.figures, output.report)
    import condyle

    from ..results.proof import Proof
    from ..results.summary import summarize

    solution = condyle.run(
        mechanism,
        **motion.arguments(),
        **model.arguments(),
        distribution=distribution.chosen(),
        reactions=reactions,
        flag=flag,
        max_error=max_error,
        prove=prove,
        measured=measured,
        vary=vary,
    )
    warn(solution.condyle.warnings)
    files = written(solution, output, [motion.motion, motion.load, measured, vary, mechanism])
    summary = summarize(solution)
    proofs = json.loads(solution.attrs.get("proof", "[]"))
    said = "\n".join(str(Proof(**one)) for one in proofs)
    text = (
        f"{summary}\n{said}\n\n{files_line(files)}" if said else f"{summary}\n\n{files_line(files)}"
    )
    data = summary.data | ({"proof": proofs} if proofs else {}) | {"files": files}
    return Answer(text, data, look_at(files, output))
