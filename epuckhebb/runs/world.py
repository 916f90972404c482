"""The world of a run, from its settings."""

from typing import Any

from epuckhebb.config import EnvironmentConfig
from epuckhebb.runs.gymnasium import Gymnasium
from epuckhebb.runs.maze import Maze
from epuckhebb.worlds.world import World


def make_world(config: Any) -> World:
    """The world that settings describe."""
    return Gymnasium(config) if isinstance(config, EnvironmentConfig) else Maze(config)
