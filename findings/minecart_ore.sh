# mo-gymnasium minecart-v0: ore is drawn from NumPy's global generator, so the seed of a reset does not repeat a lifetime.
set -- mo-gymnasium==1.3.2 gymnasium==1.4.0
. "$(dirname "$0")/run.sh" <<'PYTHON'
import gymnasium, numpy as np, mo_gymnasium
def life(name, seed=None):
    env = gymnasium.make(f"mo_gymnasium:{name}")
    env.reset(seed=5)
    if seed is not None:
        np.random.seed(seed)
    draw, rewards = np.random.default_rng(5), []
    for _ in range(1000):
        _, reward, terminated, truncated, _ = env.step(int(draw.integers(6)))
        rewards.append(reward.tolist())
        if terminated or truncated:
            env.reset(seed=5)
    return rewards
same = {"minecart-v0": life("minecart-v0") == life("minecart-v0"),
        "after np.random.seed": life("minecart-v0", 1) == life("minecart-v0", 1),
        "minecart-deterministic-v0": life("minecart-deterministic-v0") == life("minecart-deterministic-v0")}
print("mo-gymnasium", mo_gymnasium.__version__, "the same 1000 rewards again:", same)
assert list(same.values()) == [False, True, True]
PYTHON
