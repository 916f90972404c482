"""Errors that a user can cause, each told in one message and ending in exit code 2."""


class ConfigError(ValueError):
    """A value, a file or a folder that cannot be used; the message names the key, what was given, what is allowed."""
