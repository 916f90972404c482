# panda-gym: PandaPushDense-v3 gives another lifetime with a seed after a lifetime with another one; a new environment gives the first again.
set -- panda-gym==3.0.7 gymnasium==1.4.0
. "$(dirname "$0")/run.sh" <<'PYTHON'
import gymnasium, numpy as np, panda_gym
def life(env, seed):
    env.reset(seed=seed)
    draw = np.random.default_rng(seed)
    return float(sum(env.step(draw.uniform(-1, 1, env.action_space.shape).astype(np.float32))[1] for _ in range(50)))
found = {}
for name in ("PandaReachDense-v3", "PandaPushDense-v3"):
    kept = gymnasium.make(name)
    first, _, again = (life(kept, seed) for seed in (5, 6, 5))
    found[name] = first, again, life(gymnasium.make(name), 5)
print("panda-gym", panda_gym.__version__, "returns of seed 5: first, after another lifetime, in a new environment:", found)
assert all(first == new for first, _, new in found.values())
assert [first == again for first, again, _ in found.values()] == [True, False]
PYTHON
