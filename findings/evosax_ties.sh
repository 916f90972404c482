# evosax 0.3.2: individuals of equal fitness get the weight of their mean rank, not their mean weight. Where all are alike,
# as before the first success, CMA_ES and Sep_CMA_ES lose their step size, and SimpleES widens.
set -- evosax==0.3.2 jax==0.10.2 numpy==2.4.6
. "$(dirname "$0")/run.sh" <<'PYTHON'
from importlib.metadata import version
import jax, jax.numpy as jnp
from evosax.algorithms import CMA_ES, Sep_CMA_ES, SimpleES

print("evosax", version("evosax"))
seen = {}
for kind in (CMA_ES, Sep_CMA_ES, SimpleES):
    for name in ("all alike", "by chance"):
        search = kind(population_size=16, solution=jnp.zeros(20))
        settings, key = search.default_params, jax.random.key(1)
        state = search.init(key, jnp.zeros(20), settings)
        for generation in range(10):
            key, asking, chance = jax.random.split(key, 3)
            genomes, state = search.ask(asking, state, settings)
            losses = jnp.zeros(16) if name == "all alike" else jax.random.normal(chance, (16,))
            weights = search.fitness_shaping_fn(genomes, losses, state, settings)
            state, _ = search.tell(chance, genomes, losses, state, settings)
        positive = float(jnp.where(weights > 0, weights, 0).sum())
        seen[kind.__name__, name] = positive, float(jnp.mean(state.std))
        print(f"{kind.__name__:10} {name}: positive weights sum to {positive:.3f}, step size after 10 {seen[kind.__name__, name][1]:.2f}")
for name in ("CMA_ES", "Sep_CMA_ES"):
    assert abs(seen[name, "by chance"][0] - 1) < 1e-3 and seen[name, "by chance"][1] > 0.7
    assert seen[name, "all alike"][0] < 0.2 and seen[name, "all alike"][1] < 0.25
assert abs(seen["SimpleES", "all alike"][0] - 2) < 1e-3 and seen["SimpleES", "all alike"][1] > 1.3
PYTHON
