"""Do anti-Hebbian updates beat Hebbian ones in random recurrent networks? After Medvid et al., arXiv 2604.03386.

epuckhebb sweep examples/any_world/anti_hebbian.py:AntiHebbian
"""

from dataclasses import dataclass, field

import gymnasium
import numpy as np
import pandas as pd

import epuckhebb
from epuckhebb.analysis.statistics import bootstrap, mean
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.controller.wirings.elman import Elman

WORLDS = {  # environment: scale of its readings, returns of competent networks, what changes
    "CartPole-v1": ([2.4, 2.0, 0.21, 2.0], (50, 450), {"gravity": 19.6, "length": 1.0, "masspole": 0.3}),
    "Acrobot-v1": ([1, 1, 1, 1, 3, 5], (-450, -100), {"LINK_MASS_1": 2.0, "LINK_MASS_2": 2.0}),
}
STEPS, HIDDEN = 500, 8
CHOOSE, FRESH, SELECT = range(3)  # purposes of episodes, which share no seed


@dataclass(frozen=True, kw_only=True)
class Hebb(epuckhebb.Rule):
    """Plain Hebbian plasticity, without a trace; with a negative sign, anti-Hebbian."""

    @staticmethod
    def synapse(correlation):
        """D = x_j x_i."""
        return correlation


def lifetimes(env, controller, world, episodes, change_at=STEPS):
    """The mean return over episodes, by their seeds; their mean number of steps; the share that reached the change."""
    scale, _, change = WORLDS[world]
    returns, steps = [], []
    for seed in episodes:
        observation, _ = env.reset(seed=seed)
        controller.reset(seed)
        before = {name: getattr(env.unwrapped, name) for name in change}
        total, step, is_over = 0.0, 0, False
        while not is_over and step < STEPS:
            if step == change_at:
                _set(env.unwrapped, change)
            readings = np.clip(np.asarray(observation, float) / scale, -3, 3)
            observation, reward, is_over, *_ = env.step(int(np.argmax(controller.act(readings))))
            total, step = total + reward, step + 1
        _set(env.unwrapped, before)
        returns.append(total)
        steps.append(step)
    return np.mean(returns), np.mean(steps), np.mean(np.array(steps) > change_at)


def _set(env, values):
    for name, value in values.items():
        setattr(env, name, value)
    if hasattr(env, "polemass_length"):
        env.total_mass, env.polemass_length = env.masspole + env.masscart, env.masspole * env.length


@dataclass(kw_only=True)
class AntiHebbian(epuckhebb.Study):
    """Gains of Hebbian and anti-Hebbian updates over the same networks without plasticity."""

    worlds: list[str] = field(default_factory=lambda: list(WORLDS))
    networks: int = 500
    block: int = 25
    rates: list[float] = field(default_factory=lambda: [0.00001, 0.00003, 0.0001, 0.001, 0.01])
    episodes: int = 8

    def plan(self):
        """A job for each block of networks in each world."""
        shared = {"networks": self.block, "rates": self.rates, "episodes": self.episodes}
        return [
            {"world": world, "number": number, **shared}
            for world in self.worlds
            for number in range(self.networks // self.block)
        ]

    @classmethod
    def do(cls, job):
        """Find competent networks; then the gains of both signs at each rate, and again in fresh episodes."""
        world, count = job["world"], job["episodes"]
        env = gymnasium.make(world, disable_env_checker=True, max_episode_steps=STEPS)
        least, most = WORLDS[world][1]
        inputs, outputs = env.observation_space.shape[0], int(env.action_space.n)
        network = Network((inputs, HIDDEN, outputs), wiring=Elman(hidden=HIDDEN, outputs=outputs))
        rng, rows, found = np.random.default_rng([job["number"], inputs]), [], 0

        def seeds(purpose, number=count):
            return [10_000 * purpose + 100 * job["number"] + k for k in range(number)]

        while found < job["networks"]:
            weights = np.clip(rng.normal(size=network.synapses), -2, 2)
            plain = epuckhebb.Controller(weights, network)
            if lifetimes(env, plain, world, seeds(SELECT, 2))[0] < least:
                continue
            if not least <= lifetimes(env, plain, world, seeds(SELECT))[0] <= most:
                continue
            found += 1
            for purpose in (CHOOSE, FRESH):
                base, steps, _ = lifetimes(env, plain, world, seeds(purpose))
                for change_at in (STEPS, round(steps / 2)):  # never, or in the middle of its mean lifetime
                    row = {"world": world, "network": 1000 * job["number"] + found, "purpose": purpose}
                    row["change"] = change_at < STEPS
                    if row["change"]:
                        base, _, _ = lifetimes(env, plain, world, seeds(purpose), change_at)
                    for sign in ("hebbian", "anti"):
                        for rate in job["rates"]:
                            rule = Hebb(N=rate, floor=1.0, sign=Sign[sign])
                            controller = epuckhebb.Controller(weights, network, rule)
                            total, _, reached = lifetimes(env, controller, world, seeds(purpose), change_at)
                            result = {"sign": sign, "rate": rate, "base": base, "gain": total - base}
                            rows.append({**row, **result, "reached": reached})
        return {"networks": pd.DataFrame(rows)}

    def tables(self, runs):
        """Cohen's d of anti over Hebb, each at the rate with the highest mean gain in episodes of its own.

        With it go these mean gains, and the gains of each network in fresh episodes at the rates that were chosen.
        """
        rows = pd.concat([run.table("networks.csv") for run in runs])
        effects, gains, chosen = [], [], rows[rows.purpose == CHOOSE]
        for (world, change), own in rows.groupby(["world", "change"], sort=False):
            means = own[own.purpose == CHOOSE].groupby(["sign", "rate"]).gain.mean()
            best = {sign: means[sign].idxmax() for sign in ("hebbian", "anti")}
            fresh = own[own.purpose == FRESH].set_index(["sign", "rate", "network"]).sort_index()
            pairs = pd.DataFrame({f"gain_{sign}": fresh.gain[sign, best[sign]] for sign in best})
            reached = pd.concat(fresh.reached[sign, best[sign]] for sign in best).mean()
            gains.append(pairs.reset_index().assign(world=world, change=change))
            hebb, anti = pairs.to_numpy().T
            spread = np.sqrt((hebb.var(ddof=1) + anti.var(ddof=1)) / 2) or np.nan
            difference = (anti - hebb) / spread
            low, high = bootstrap(mean, difference)
            effects.append(
                {
                    "world": world,
                    "change": change,
                    "networks": len(hebb),
                    "reached": reached if change else np.nan,
                    "rate_hebbian": best["hebbian"],
                    "rate_anti": best["anti"],
                    "gain_hebbian": hebb.mean(),
                    "gain_anti": anti.mean(),
                    "d": difference.mean(),
                    "d_low": low,
                    "d_high": high,
                }
            )
        rates = chosen.groupby(["world", "change", "sign", "rate"], sort=False).gain.mean().reset_index()
        return {"effects": pd.DataFrame(effects), "rates": rates, "gains": pd.concat(gains)}
