"""Settings: the schema, composing with Hydra, overrides, names, and the parts of the science made from them.

It knows the science and no run folders. Others import the names below; `load` comes first. `runs/hydra.py`, the other
file that knows Hydra, imports `catalogue`, `compose` and `resolve` too. What cannot be used raises a ValueError, mostly
`ConfigError`: it names the key, what was given and what is allowed.
"""

from epuckhebb.config import hand
from epuckhebb.config.build import controller_of
from epuckhebb.config.compose import configurations, load, load_any, swept_values
from epuckhebb.config.environments import EnvironmentConfig, EvaluateEnvironment, EvolveEnvironment, environment_of_run
from epuckhebb.config.errors import explain
from epuckhebb.config.overrides import (
    RUN_DIR,
    SWEEP_DIR,
    alternatives,
    check_words,
    for_hydra,
    overrides_of,
    quoted,
    readable,
    typed_as,
    value_of,
    value_text,
    values_of,
)
from epuckhebb.config.parts import KINDS, NONE, PAPER, part_class, part_from
from epuckhebb.config.plugins import (
    OWN_CODE,
    OwnFile,
    class_named,
    loaders,
    own_files,
    own_place,
    own_references,
    own_sources,
    text_of,
    with_own_copies,
)
from epuckhebb.config.resolve import training_world, world_name
from epuckhebb.config.schema import (
    MOST_THREADS,
    SCHEMAS,
    Checked,
    Config,
    EvaluateConfig,
    EvolveConfig,
    Plain,
    WorldConfig,
    dump,
    from_values,
    register,
    schema_of,
    typed,
)
from epuckhebb.config.values import part_settings
from epuckhebb.runtime.yaml_file import load as settings
