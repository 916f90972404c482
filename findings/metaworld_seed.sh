# Meta-World ignores reset(seed=): one seed gives another goal each time, in one environment and in new ones; make(seed=) is heard.
set -- metaworld==3.1.1 gymnasium==1.4.0 mujoco==3.3.0 packaging
. "$(dirname "$0")/run.sh" <<'PYTHON'
import gymnasium, metaworld
from importlib.metadata import version
def new(**options):
    return gymnasium.make("Meta-World/MT1", env_name="reach-v3", **options)
def goal(env):
    return tuple(env.reset(seed=5)[0][36:39].round(3).tolist())
kept = new()
goals = {"one": [goal(kept) for _ in range(3)], "new": [goal(new()) for _ in range(3)], "new, seed": [goal(new(seed=5)) for _ in range(3)]}
print("metaworld", version("metaworld"), "goals after reset(seed=5):", goals)
assert {name: len(set(each)) > 1 for name, each in goals.items()} == {"one": True, "new": True, "new, seed": False}
PYTHON
