# rliable 1.2.0: two intervals with one and the same `random_state` differ; NumPy's global seed decides them.
set -- rliable==1.2.0 "pandas==2.3.3" "arch==7.2.0" "numpy==2.4.6"
. "$(dirname "$0")/run.sh" <<'PYTHON'
import importlib.metadata
import numpy as np
from rliable import library

scores = {"rule": np.random.default_rng(0).random((10, 4))}  # ten champions in four worlds


def interval(state, of_all):
    np.random.seed(of_all)
    _, ends = library.get_interval_estimates(
        scores, lambda x: np.array([x.mean()]), reps=500, random_state=np.random.RandomState(state)
    )
    return ends["rule"].ravel().round(4).tolist()


print("rliable", importlib.metadata.version("rliable"))
print("random_state 1, global seeds 7, 8:", interval(1, 7), interval(1, 8))
print("random_states 1, 2, global seed 7:", interval(1, 7), interval(2, 7))
assert interval(1, 7) != interval(1, 8)
assert interval(1, 7) == interval(2, 7)
PYTHON
