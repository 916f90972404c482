"""The command line: commands, their options, completion, and everything that is printed.

It imports what is heavy inside a command, so that help and completion come at once.
Others may import `commands.main` alone.
"""
