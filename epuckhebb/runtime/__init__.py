"""What a process needs, whatever it computes: errors and exit codes, signals, cores and memory, console, progress.

It knows nothing of this program's science, files or settings.
Others may import all of its modules.
What the machine does not have, or a user must change, raises `ConfigError`.
"""
