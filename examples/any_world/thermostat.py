"""A room that is to be kept warm, and whose heater turns into a cooler: an environment of one's own, with a change."""

import gymnasium
import numpy as np


class Room(gymnasium.Env):
    """A temperature that a heater must follow. Readings: how far it is too cold, and the heater's last power."""

    observation_space = gymnasium.spaces.Box(-10.0, 10.0, (2,))
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))
    works = 1.0  # sign of what the heater does

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.works, self.power, self.wanted = 1.0, 0.0, 0.0
        self.error = float(self.np_random.uniform(-2.0, 2.0))
        return self._look(), {}

    def step(self, action):
        self.power = float(action[0])
        self.wanted += 0.05 * self.np_random.standard_normal() - 0.05 * self.wanted
        self.error += 0.3 * (self.wanted - self.works * self.power) - 0.1 * self.error
        return self._look(), float(np.exp(-abs(self.error))), abs(self.error) > 10.0, False, {}

    def _look(self):
        return np.array([self.error, self.power], np.float32)


def turn_round(room):
    """The change: the heater cools from now on."""
    room.works = -1.0
