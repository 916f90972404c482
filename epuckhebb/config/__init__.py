"""Settings: the schema, composing with Hydra, overrides, names, and the parts of the science made from them.

It knows the science and no run folders.
Others may import all but `choices`, `values` and `yaml_file`; `compose.load` and `schema.dump` come first.
What cannot be used raises a ValueError, mostly `ConfigError`: it names the key, what was given and what is allowed.
"""
