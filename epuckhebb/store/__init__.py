"""Run folders on disk: claim them, write files atomically, verify, find and read them; the formats of their files.

It knows the science whose results it keeps, and no configuration. `Run` reads a folder, `RunFolder` writes one. Others
import the names below.
What cannot be read, written or used raises `ConfigError`, and its message names the file or the key.
"""

from epuckhebb.store.checkpoint import Checkpoint
from epuckhebb.store.disk import (
    CHAMPION,
    CHECKPOINT,
    CONFIG,
    MULTIRUN,
    PROVENANCE,
    SCHEMA,
    STATUS,
    as_json,
    as_npz,
    write_atomic,
)
from epuckhebb.store.folder import UNFINISHED, Content, RunFolder, as_bytes, check_multirun_folder, set_aside
from epuckhebb.store.genome import Genome, champion_file, checked_genes, load_genome, shaped
from epuckhebb.store.lock import is_locked, locked
from epuckhebb.store.provenance import SCIENCE, compare_machines, digest, fingerprint, versions
from epuckhebb.store.run import Run, list_runs, multirun_runs, resolve_run
from epuckhebb.store.traces import read_traces, traces_arrays
