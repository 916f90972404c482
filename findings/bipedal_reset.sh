# Gymnasium BipedalWalker-v3: an environment that was reset before may give another lifetime with a seed than a new one.
set -- gymnasium==1.4.0 Box2D==2.3.10 pygame==2.6.1
. "$(dirname "$0")/run.sh" <<'PYTHON'
import gymnasium, numpy as np
def life(env, seed):
    env.reset(seed=seed)
    rewards, draw = [], np.random.default_rng(seed)
    for _ in range(200):
        _, reward, terminated, truncated, _ = env.step(draw.uniform(-1, 1, 4).astype(np.float32))
        rewards.append(reward)
        if terminated or truncated:
            break
    return rewards
kept = gymnasium.make("BipedalWalker-v3")
same = [life(kept, seed) == life(gymnasium.make("BipedalWalker-v3"), seed) for seed in range(14)]
print("gymnasium", gymnasium.__version__, "resets of one environment that are as in a new one:", same)
assert sum(same) < len(same)
PYTHON
