"""From lifetimes to answers: metrics, statistics, tables, figures, replay pages.

It knows the science below it, and no files and no settings.
Others may import all of its modules.
"""
