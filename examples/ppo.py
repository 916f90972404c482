"""Trains a policy with PPO of Stable-Baselines3, and tests it beside the bundled champion in the same lifetimes.

    pip install --group ppo -e .
    python examples/ppo.py --steps 300000 --reward progress --seed 1

The docs say what it reached: docs/python.md, "The maze as an environment".
"""

import argparse
import time

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

import epuckhebb
from epuckhebb.gym import ID, REWARDS, TMaze, evaluation_key

ENVIRONMENTS = 8
TESTS = 10  # lifetimes a side


def tested(policy):
    """Success on the left, on the right, and mean fitness of a function from observation to action."""
    env = gymnasium.make(ID)
    success, fitness = {}, []
    for side in ("left", "right"):
        outcomes = []
        for repeat in range(TESTS):
            observation, _ = env.reset(seed=1, options={"side": side, "key": evaluation_key(1, repeat, side)})
            is_over = False
            while not is_over:
                observation, _, is_over, _, info = env.step(policy(observation))
            outcomes.append(info["outcome"])
        success[side] = np.mean([outcome.success for outcome in outcomes])
        fitness += [outcome.fitness for outcome in outcomes]
    return f"success left {success['left']:.1f}, right {success['right']:.1f}, fitness {np.mean(fitness):.3f}"


def main():
    """Train, and print what was reached."""
    words = argparse.ArgumentParser()
    words.add_argument("--steps", type=int, default=300_000)
    words.add_argument("--reward", choices=REWARDS, default="progress")
    words.add_argument("--seed", type=int, default=1)
    given = words.parse_args()
    torch.set_num_threads(1)
    print("champion:", tested(epuckhebb.Controller(epuckhebb.load()).act))
    seed = given.seed * ENVIRONMENTS  # Stable-Baselines3 gives environment i the seed s + i: no two runs share one
    env = make_vec_env(TMaze, n_envs=ENVIRONMENTS, env_kwargs={"reward": given.reward})
    model = PPO("MlpPolicy", env, seed=seed, n_steps=512, batch_size=256, device="cpu")
    began = time.process_time()
    model.learn(given.steps)
    spent = time.process_time() - began
    result = tested(lambda observation: model.predict(observation, deterministic=True)[0])
    print(f"PPO, reward {given.reward}, seed {given.seed}, {model.num_timesteps} steps, {spent:.0f} CPU s: {result}")


if __name__ == "__main__":
    main()
