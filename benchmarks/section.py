"""One section of the benchmarks in a process of its own: `python section.py FOLDER MODULE REPEATS`, JSON on the output.

FOLDER is the `benchmarks` of the version of epuckhebb that this Python has installed.
"""

import importlib
import json
import sys
from typing import Any

if __name__ == "__main__":  # and not in the processes that a section starts
    folder, module, repeats = sys.argv[1:]
    sys.path[0] = folder
    section: Any = importlib.import_module(module)
    section.REPEATS = int(repeats)
    print(json.dumps(section.measure()))
