"""One evaluation or one evolution in its folder: run by Hydra or by a study, resumed, repeated.

It puts a configuration, the science and a run folder together; it knows no study. Others import the names below, and
`figures`, which loads matplotlib. What is refused raises `ConfigError` and leaves nothing behind; a run that began and
fails raises `JobFailedError`.
"""

from epuckhebb.runs import hydra
from epuckhebb.runs.begin import check_same
from epuckhebb.runs.evaluate import (
    PreparedEvaluation,
    check_rules,
    drawn,
    evaluate_into,
    evaluate_job,
    inherit_choices,
    make_genome,
    prepare_evaluation,
)
from epuckhebb.runs.evolve import (
    earlier_champions,
    evolve_into,
    evolve_job,
    evolved,
    prepare_evolution,
    resume,
    settings_but_seed,
    settings_of,
)
from epuckhebb.runs.maze import compile_kernels
from epuckhebb.runs.notes import caption, evaluation_notes
from epuckhebb.runs.rerun import repeat, run_settings
