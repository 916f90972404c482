"""A controller as an object, for loops of one's own: a genome, its network and its plasticity rule, step by step.

    controller = Controller(genes, Network((4, 16, 2)), rule)
    observation, _ = environment.reset(seed=1)
    controller.reset(seed=1)
    outputs = controller.act(observation, reward)     # of any world

The step is compiled: forward pass, then the update of the weights, which is in force from the next step on. Where the
weights shall change after the move, `decide` and `learn` are the two halves of `act`.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import PartError, explained
from epuckhebb.controller.compiling.kernel import SameTypes, bind_parts, compiled, kernel
from epuckhebb.controller.compiling.readonly import map_arrays, readonly
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.genotype import Genotype, initial_states
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.own_class import stored, user_classes
from epuckhebb.controller.plasticity.control import Control
from epuckhebb.controller.plasticity.control import signs as signs_of
from epuckhebb.controller.plasticity.rule import NO_RULE, Rule, Schedule, make_schedule, weight_bound
from epuckhebb.controller.plasticity.update import (
    StepContext,
    Workspace,
    controller_parts,
    effective_rate,
    make_workspace,
)
from epuckhebb.controller.plasticity.weight_change import saturated_fraction
from epuckhebb.controller.random import Stream, rng
from epuckhebb.controller.wiring import Neurons

_part: Any = None
HAS_RULE, SUBSTEPS = False, 1
forward = average = modulate = is_due = learn = decide = update = _part  # parts, which `step_parts` puts here
_kernels: dict[tuple[object, ...], Any] = {}
_NO_GAIN = 0.0  # rad/s: there are no wheels whose gain could be another than in training


class State(NamedTuple):
    """What a lifetime carries. tally: the present weight change, and its sum over the steps."""

    genotype: Genotype
    weights: Floats
    synapse_state: NDArray[np.void]
    activation: Floats
    recent: Floats
    neurons: Neurons
    tally: Floats
    workspace: Workspace


def _decide(state: State) -> None:
    """Act. The inputs stand among the activations."""
    workspace = state.workspace
    forward(state.weights, state.activation, workspace.drive, state.neurons, workspace.substeps)


def _update(
    state: State,
    numbers: tuple[float, ...],
    rate: float,
    floor: float,
    fitness: float,
    step_s: float,
    key: np.uint64,
    step: int,
) -> None:
    """Learn. rate: N. fitness: the live fitness F."""
    weights, activation, workspace, tally = state.weights, state.activation, state.workspace, state.tally
    for k in range(SUBSTEPS):
        number = step * SUBSTEPS + k
        read = average(state.recent, workspace.substeps[k] if SUBSTEPS > 1 else activation, number, workspace.mean)
        if HAS_RULE and rate > 0.0 and is_due(number, numbers):
            now = effective_rate(rate, 1.0, fitness, floor) * modulate(state.genotype.modulatory, read)
            context = StepContext(fitness, key, number, step_s / SUBSTEPS)
            tally[0] = learn(weights, state.synapse_state, state.genotype, read, now, context, numbers, workspace)
    tally[1] += tally[0]


def _step(
    state: State,
    numbers: tuple[float, ...],
    rate: float,
    floor: float,
    fitness: float,
    step_s: float,
    key: np.uint64,
    step: int,
    decides: bool,
    learns: bool,
) -> None:
    """Act, then learn, or one of the two."""
    if decides:
        decide(state)
    if learns:
        update(state, numbers, rate, floor, fitness, step_s, key, step)


def step_parts(rule: type[Rule], network: Network, schedule: Schedule) -> dict[str, Any]:
    """The two halves of a step, `decide(state)` and `update(state, ..)`, for a rule and a network."""
    parts = controller_parts(rule, network, schedule)
    return {"decide": compiled(bind_parts(_decide, parts)), "update": compiled(bind_parts(_update, parts))}


def _load_step(rule: type[Rule], network: Network, schedule: Schedule) -> Any:
    """`_step` for a rule and a network, compiled or from the cache."""
    values = rule, network, schedule
    if values not in _kernels:
        _kernels[values] = SameTypes(kernel(_step, values, **step_parts(rule, network, schedule)))
    return _kernels[values]


class Controller:
    """A genome with its network and rule, as an object.

    genes: (genes,) of all parts of the genome, weights first. rate: N of the rule, which may be set at any time; 0
    freezes the weights. weights: (synapses,), the present ones. weight_change: the present sum of |W - W_gene|.

    signs: (synapses,) of the updates; by default those of the rule, shuffled ones the same for all genes. step_s:
    length of a step [s], for rules and neurons that have time constants.

    Raises:
        ValueError: the genes do not fit the network and the rule, or the rule has a yoked control.
    """

    def __init__(
        self,
        genes: ArrayLike,
        network: Network = PAPER_NETWORK,
        rule: Rule = NO_RULE,
        *,
        signs: Floats | None = None,
        step_s: float = 0.032,
    ) -> None:
        self.genes, self.network, self.rule, self.step_s = np.asarray(genes, np.float64), network, rule, float(step_s)
        self.rate, self.floor, self.numbers = float(rule.N), float(rule.floor), rule.numbers()
        rule.check_wiring(network.wiring)
        if rule.control is not Control.none:
            raise ValueError(
                f"control={rule.control.name} is for the lifetimes of `run_lifetimes`; here it must be none"
            )
        self._plan = make_plan(network, type(rule))
        if signs is None:
            signs = signs_of(rule.sign, network.synapses, rng(rule.sign_draw, Stream.shuffled_signs))
        self._signs = signs
        self._kernel = _load_step(type(rule), network, make_schedule(rule))
        self._workspace = make_workspace(network)
        self.reset()

    def reset(self, seed: int = 0) -> None:
        """Begin a lifetime. seed: of initial weights that are random, and of what is random in the rule."""
        network, rule = self.network, self.rule
        self.key, self.steps = np.uint64(seed), 0
        synapse_state = stored(rule.synapse_state, network.synapses)
        states = initial_states(
            self.genes[None],
            self._plan,
            network,
            rule,
            [int(seed)],
            synapse_state=synapse_state,
            gain_rad_s=_NO_GAIN,
            step_s=self.step_s,
        )
        state = {name: map_arrays(value, lambda array: array[0].copy()) for name, value in states.items()}
        genotype = state.pop("genotype")._replace(synapse_state=synapse_state, signs=self._signs)
        recent = np.zeros((rule.average, network.neurons))
        self.state = State(readonly(genotype), **state, recent=recent, tally=np.zeros(2), workspace=self._workspace)
        self.weights, activation = self.state.weights, self.state.activation
        self._inputs, self._outputs = activation[: network.inputs], activation[network.first_output :]

    def act(self, observation: ArrayLike, reward: float = 0.0) -> Floats:
        """The outputs, (outputs,) of -1 to 1, for an observation, (inputs,); then the weights are updated.

        reward: the live fitness F, by default of no effect on the rate: it is N max(floor, F).
        """
        self._inputs[:] = observation
        self._do(float(reward), decides=True, learns=True)
        return self._outputs.copy()

    def decide(self, observation: ArrayLike) -> Floats:
        """The outputs, (outputs,) of -1 to 1, for an observation, (inputs,); `learn` ends the step."""
        self._inputs[:] = observation
        self._do(0.0, decides=True, learns=False)
        return self._outputs.copy()

    def learn(self, reward: float, reward_reading: float | None = None) -> None:
        """Update the weights for what was decided. reward: as of `act`. reward_reading: replaces the last input."""
        if reward_reading is not None:
            self._inputs[-1] = reward_reading
        self._do(float(reward), decides=False, learns=True)

    def _do(self, fitness: float, *, decides: bool, learns: bool) -> None:
        arguments = self.numbers, self.rate, self.floor, fitness, self.step_s, self.key, self.steps
        try:
            self._kernel.call(self.state, *arguments, decides, learns)
        except Exception as error:  # machine code raises nothing, so it comes from compiling
            raise explained(user_classes([self.rule, self.network.wiring]), error) from error
        self.steps += learns

    @property
    def weight_change(self) -> float:
        """The present sum of |W - W_gene|."""
        return float(self.state.tally[0])

    @property
    def weight_change_mean(self) -> float:
        """Its mean over the steps of this lifetime."""
        return float(self.state.tally[1]) / max(1, self.steps)

    @property
    def saturated_fraction(self) -> float:
        """The share of the weights at their bound; 0 without a rule."""
        return float(saturated_fraction(self.weights, weight_bound(self.rule)))

    def check(self) -> None:
        """Refuse weights or activations that are no numbers, a PartError: such a lifetime means nothing."""
        if not (np.isfinite(self.weights).all() and np.isfinite(self.state.activation).all()):
            raise PartError(f"rule {self.rule.name}: weights or activations are infinite or nan at step {self.steps}")
