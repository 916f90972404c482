# NEAT-Python 2.0.0: each pickle of a configuration takes a node number from the run that goes on. So the same seed gives
# another evolution where checkpoints are written, and another where genomes are evaluated in parallel.
set -- neat-python==2.0.0
. "$(dirname "$0")/run.sh" <<'PYTHON'
import contextlib, io, pickle, random
from importlib.metadata import version
import neat

SETTINGS = {
    "NEAT": "pop_size=50 fitness_criterion=max fitness_threshold=9 reset_on_extinction=False no_fitness_termination=True",
    "DefaultGenome": "num_inputs=2 num_hidden=0 num_outputs=1 feed_forward=True initial_connection=full_direct"
    " compatibility_disjoint_coefficient=1 compatibility_excess_coefficient=auto compatibility_weight_coefficient=.5"
    " compatibility_include_node_genes=True compatibility_enable_penalty=1 conn_add_prob=.5 conn_delete_prob=.5"
    " node_add_prob=.2 node_delete_prob=.2 single_structural_mutation=False structural_mutation_surer=default"
    " activation_default=sigmoid activation_options=sigmoid activation_mutate_rate=0 aggregation_default=sum"
    " aggregation_options=sum aggregation_mutate_rate=0 enabled_default=True enabled_mutate_rate=.01"
    " enabled_rate_to_true_add=0 enabled_rate_to_false_add=0",
    "DefaultSpeciesSet": "compatibility_threshold=3",
    "DefaultStagnation": "species_fitness_func=max max_stagnation=20 species_elitism=0",
    "DefaultReproduction": "elitism=2 survival_threshold=.2 min_species_size=2",
}
for name, mean, deviation in (("bias", 0, 1), ("response", 1, 0), ("weight", 0, 1), ("time_constant", 1, 0)):
    SETTINGS["DefaultGenome"] += f" {name}_init_mean={mean} {name}_init_stdev={deviation} {name}_init_type=gaussian"
    SETTINGS["DefaultGenome"] += f" {name}_min_value=-30 {name}_max_value=30 {name}_mutate_power={deviation / 2}"
    SETTINGS["DefaultGenome"] += f" {name}_mutate_rate=.8 {name}_replace_rate=.1"


def settings():
    with open("config", "w") as file:
        for section, words in SETTINGS.items():
            print(f"[{section}]", *words.split(), sep="\n", file=file)
    kinds = neat.DefaultGenome, neat.DefaultReproduction, neat.DefaultSpeciesSet, neat.DefaultStagnation
    return neat.Config(*kinds, "config")


def fitness(genome, config):
    answer = neat.nn.FeedForwardNetwork.create(genome, config).activate
    return 4 - sum((answer((a, b))[0] - (a ^ b)) ** 2 for a in (0, 1) for b in (0, 1))


def serial(genomes, config):
    for _, genome in genomes:
        genome.fitness = fitness(genome, config)


def evolve(evaluate, *reporters):
    best = []

    def watch(genomes, config):
        evaluate(genomes, config)
        best.append(round(max(genome.fitness for _, genome in genomes), 6))

    random.seed(1)
    population = neat.Population(settings())
    for reporter in reporters:
        population.add_reporter(reporter)
    with contextlib.redirect_stdout(io.StringIO()):
        population.run(watch, 12)
    return best


if __name__ == "__main__":
    print("NEAT-Python", version("neat-python"))
    alone, again = evolve(serial), evolve(serial)
    saved = evolve(serial, neat.Checkpointer(5, filename_prefix="checkpoint-"))
    workers = neat.ParallelEvaluator(2, fitness)
    parallel = evolve(workers.evaluate)
    workers.close()
    for name, best in {"alone": alone, "again": again, "checkpoints": saved, "parallel": parallel}.items():
        print(f"{name:12}", *best)
    genome_config = settings().genome_config
    genome_config.get_new_node_key({0: None})
    pickle.dumps(genome_config)
    print("node after node 1 and a pickle:", after := genome_config.get_new_node_key({0: None}))
    assert alone == again != saved
    assert alone != parallel
    assert after == 3
PYTHON
