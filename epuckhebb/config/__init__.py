"""Settings: the schema, composing with Hydra, overrides, names, and the parts of the science made from them.

It knows the science and no run folders. Others import the names below; `load` comes first. `runs/hydra.py`, the other
file that knows Hydra, imports `catalogue`, `compose` and `resolve` too. What cannot be used raises a ValueError, mostly
`ConfigError`: it names the key, what was given and what is allowed.
"""

from epuckhebb.config import hand
from epuckhebb.config.build import make_controller
from epuckhebb.config.compose import configurations, load, load_any, swept_values
from epuckhebb.config.environments import EnvironmentConfig, EvaluateEnvironment, EvolveEnvironment, environment_of_run
from epuckhebb.config.errors import explain
from epuckhebb.config.overrides import (
    RUN_DIR,
    SWEEP_DIR,
    alternatives,
    check_words,
    format_overrides,
    hydra_arguments,
    make_overrides,
    override_value,
    quoted,
    readable,
    value_text,
    values_of,
)
from epuckhebb.config.parts import KINDS, NONE, PAPER, make_part, part_class
from epuckhebb.config.plugins import (
    OWN_CODE,
    OwnFile,
    class_named,
    loaders,
    object_text,
    own_files,
    substitute_copies,
    user_place,
    user_references,
    user_sources,
)
from epuckhebb.config.resolve import training_world, world_name
from epuckhebb.config.schema import (
    MOST_THREADS,
    SCHEMAS,
    Checked,
    Config,
    EvaluateConfig,
    EvolveConfig,
    WorldConfig,
    dump,
    find_schema,
    make_config,
    register,
    typed,
)
from epuckhebb.config.values import Plain, part_settings
from epuckhebb.runtime.yaml_file import load as settings
