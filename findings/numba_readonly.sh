# numba compiles stores through .flat, np.nditer and np.ascontiguousarray into an array that is read-only; NumPy refuses the first.
set -- numba==0.68.1 numpy==2.4.*
. "$(dirname "$0")/run.sh" <<'PYTHON'
import numba, numpy as np
def flat(x): x.flat[0] = 9.0
def nditer(x):
    for one in np.nditer(x): one[()] = 9.0
def contiguous(x): np.ascontiguousarray(x)[0] = 9.0
def index(x): x[0] = 9.0
def result(store):
    numbers = np.zeros(3)
    view = numbers.view()
    view.flags.writeable = False
    try:
        numba.njit(store)(view)
    except numba.TypingError:
        return "refused"
    return "written" if numbers[0] == 9.0 else "nothing"
seen = {store.__name__: result(store) for store in (index, flat, nditer, contiguous)}
print("numba", numba.__version__, seen)
assert seen == {"index": "refused", "flat": "written", "nditer": "written", "contiguous": "written"}
PYTHON
