"""What a process needs, whatever it computes: errors, exit codes, signals, streams, cores, notes, bars, data folders.

It knows nothing of the science; of settings only which files `conf/` has. Others import the names below.
Every start needs it, so it loads nothing heavy. What a user must change raises `ConfigError`.
"""

from epuckhebb.runtime import conf
from epuckhebb.runtime.errors import (
    INTERRUPTED,
    JOB_FAILED,
    USAGE,
    ConfigError,
    JobFailedError,
    begin_worker,
    did_you_mean,
    end_on_signals,
    exit_with_parent,
    interrupted,
    interruptible,
    is_interruption,
    is_of_handler,
    leaving,
    open_folders,
    reason_of_failure,
    refusing,
)
from epuckhebb.runtime.progress import bar, be_quiet, compiling, counting, say, working
from epuckhebb.runtime.resources import (
    LATEST,
    REFERENCE,
    data_folder,
    discard,
    open_missing_streams,
    thread_count,
    user_path,
)
