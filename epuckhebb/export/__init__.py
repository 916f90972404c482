"""A finished run as something else: a page to watch, a GIF, a gallery of both, a controller for Webots.

It reads run folders, and changes no result in them.
Others may import `figure`, `gallery`, `replay` and `webots`.
What cannot be read, exported or written raises `ConfigError`.
"""

FIGURES = {  # of a run, and the file that each needs
    "trajectories": "traces.npz",
    "maze": "traces.npz",
    "weights": "traces.npz",
    "reversal": "reversal.csv",
    "learning": "history.csv",
    "lifetime": "lifetime.csv",
}
