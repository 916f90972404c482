# Gymnasium LunarLander-v3: the attribute `gravity` acts from the next reset on, in no step of the episode that goes on.
set -- gymnasium==1.4.0 Box2D==2.3.10 pygame==2.6.1
. "$(dirname "$0")/run.sh" <<'PYTHON'
import gymnasium, numpy as np
def path(change=None, before_reset=False):
    env = gymnasium.make("LunarLander-v3")
    for is_reset in (False, True):
        if is_reset:
            env.reset(seed=1)
        if change is not None and before_reset != is_reset:
            env.unwrapped.gravity = change
    return np.array([env.step(step % 4)[0] for step in range(60)])
same = {when: bool((path(-1.6, when == "before") == path()).all()) for when in ("before", "after")}
print("gymnasium", gymnasium.__version__, "the same path with gravity set before, after reset:", same)
assert same == {"before": False, "after": True}
PYTHON
