"""Makes environments: those that Gymnasium knows by an id, or of a class or function of the user's."""

import importlib
import traceback
from collections.abc import Callable
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.worlds.environment import Environment

_INSTALL = 'pip install "epuckhebb[gym]"'


def gymnasium() -> Any:
    """The library, which takes a while to load; a PartError if it is not installed."""
    try:
        return importlib.import_module("gymnasium")
    except ImportError as error:
        raise PartError(f"environments need Gymnasium: {_INSTALL}") from error


def _reason(error: Exception) -> str:
    """What an error says, or, as after a bare `assert`, the line that raised it."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return str(error) or f"{last.line} ({Path(last.filename).name}, line {last.lineno})"


@dataclass(frozen=True)
class Maker:
    """Makes the environment of settings. entry: the user's class or function; None for an id of Gymnasium."""

    settings: Environment
    entry: Callable[..., Any] | None = None

    def __call__(self, **more: Any) -> Any:
        """A new environment, with more options than the settings have.

        Raises:
            PartError: Gymnasium is missing, the environment cannot be made, or it is none of Gymnasium's.
        """
        settings, library = self.settings, gymnasium()
        try:
            with chdir(Path.cwd()):  # one of the user's may go elsewhere
                env = self._made({**settings.options, **more}, is_drawn=bool(more))
        except Exception as error:  # of a user's code, or of a library that is missing
            missing = (ImportError, library.error.DependencyNotInstalled)
            hint = (
                f"; environments of MuJoCo: {_INSTALL}" if isinstance(error, missing) and ":" not in settings.id else ""
            )
            raise PartError(f"environment.id={settings.id}: {type(error).__name__}: {_reason(error)}{hint}") from error
        if not isinstance(env, library.Env):
            raise PartError(f"environment.id={settings.id} must make a gymnasium.Env, it made {env!r}")
        return env

    def _made(self, options: dict[str, Any], *, is_drawn: bool) -> Any:
        if self.entry is not None:
            return self.entry(**options)
        package, _, name = self.settings.id.rpartition(":")
        if package:
            importlib.import_module(package)  # it registers its environments
        if "mujoco" in str(gymnasium().spec(name).entry_point):
            import mujoco

            mujoco.set_mju_user_warning(lambda _: None)  # else each environment prints one, and writes a file here
            options = {"camera_name": "track", **options} if is_drawn else options  # a film follows the robot
        return gymnasium().make(name, max_episode_steps=self.settings.horizon, disable_env_checker=True, **options)
