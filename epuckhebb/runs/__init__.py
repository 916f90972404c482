"""One evaluation or one evolution in its folder: run by Hydra or by a study, resumed, repeated.

It puts a configuration, the science and a run folder together; it knows no study.
Others may import all of its modules; `evaluate` and `evolve` come first.
What is refused raises `ConfigError` and leaves nothing behind; a run that began and fails raises `JobFailedError`.
"""
