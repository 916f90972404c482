"""Run folders on disk: claim them, write files atomically, verify, find and read them; the formats of their files.

It knows the science whose results it keeps, and no configuration.
Others may import all but `npz`: `run` reads a folder, `folder` writes one, `disk` has the names of files.
What cannot be read, written or used raises `ConfigError`, and its message names the file or the key.
"""
