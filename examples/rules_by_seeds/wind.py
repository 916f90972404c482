"""An environment of your own: a cart that must stay where it is while a wind pushes it, and the wind can turn."""

import gymnasium
import numpy as np


class Wind(gymnasium.Env):
    """Six readings: place, speed, the wind now and in the three steps before. One action: a push. Reward: nearness."""

    observation_space = gymnasium.spaces.Box(-5.0, 5.0, (6,))
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))
    works = 1.0  # sign of what a push does

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.works, self.place, self.speed, self.winds = 1.0, 0.0, 0.0, np.zeros(4)
        return self._look(), {}

    def step(self, action):
        wind = 0.9 * self.winds[0] + 0.2 * self.np_random.standard_normal()
        self.winds = np.array([wind, *self.winds[:3]])
        self.speed += 0.1 * (self.works * float(action[0]) + wind) - 0.05 * self.speed
        self.place += 0.1 * self.speed
        return self._look(), float(np.exp(-abs(self.place))), abs(self.place) > 5.0, False, {}

    def _look(self):
        return np.clip([self.place, self.speed, *self.winds], -5.0, 5.0).astype(np.float32)


def turn_round(env):
    """A change: pushes go the other way from now on."""
    env.works = -1.0
