# Gymnasium Acrobot-v1: LINK_LENGTH_2 is in no equation of motion; it is only drawn.
set -- gymnasium==1.4.0
. "$(dirname "$0")/run.sh" <<'PYTHON'
import gymnasium, numpy as np
def path(name, value):
    env = gymnasium.make("Acrobot-v1").unwrapped
    setattr(env, name, value)
    env.reset(seed=1)
    return np.array([env.step(step % 3)[0] for step in range(100)])
usual = path("LINK_LENGTH_2", 1.0)
same = {name: bool((path(name, 2.0) == usual).all()) for name in ("LINK_LENGTH_1", "LINK_LENGTH_2", "LINK_MASS_2")}
print("gymnasium", gymnasium.__version__, "the same path with twice:", same)
assert same == {"LINK_LENGTH_1": False, "LINK_LENGTH_2": True, "LINK_MASS_2": False}
PYTHON
