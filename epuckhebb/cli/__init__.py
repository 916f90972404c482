"""The command line: commands, their options, and everything that is printed.

It imports what is heavy inside a command, so that help comes at once.
Others may import `commands.main` alone.
"""
