"""The two ways in which things go wrong, each told in one message."""


class ConfigError(ValueError):
    """A value, a file or a folder that cannot be used; names it, what was given and what is allowed. Exit code 2."""


class JobFailedError(RuntimeError):
    """A run that began and could not be finished; says which and why. Exit code 1."""
