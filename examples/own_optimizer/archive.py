"""Draws the archive of a run by `my_optimizer.py` as a heat map, and takes a genome out of it.

python archive.py RUN                                        # writes RUN/archive.png
python archive.py RUN --lamp-on 0.36 --lamp-off -0.36        # and RUN/genome.npy, whose ends are nearest to these [m]
"""

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import yaml

mpl.use("agg")
import matplotlib.pyplot as plt

GOAL = 0.36  # m, x of the goal on the right; that on the left is at -GOAL
HALF = 0.4  # m, the range of the archive


def draw(archive, cells, file):
    """A heat map: a column for each end with the lamp on, a row for each with the lamp off; colour is fitness."""
    fitness = np.full((cells, cells), np.nan)
    fitness.flat[archive["index"].astype(int)] = archive.objective
    figure, axes = plt.subplots(figsize=(6.4, 5.2), layout="constrained")
    image = axes.imshow(fitness.T, origin="lower", extent=[-HALF, HALF, -HALF, HALF], cmap="viridis")
    for on, off, text in (
        (GOAL, -GOAL, "both goals"),
        (-GOAL, GOAL, "no goal"),
        (GOAL, GOAL, "always right"),
        (-GOAL, -GOAL, "always left"),
    ):
        axes.plot(on, off, "s", markersize=14, markerfacecolor="none", markeredgecolor="crimson")
        axes.text(on, np.copysign(HALF + 0.02, off), text, ha="center", va="center", size=9)
    limits = (-HALF - 0.05, HALF + 0.05)
    axes.set(xlim=limits, ylim=limits, xlabel="final x with the lamp on [m]", ylabel="final x with the lamp off [m]")
    axes.set_title(f"{len(archive)} of {cells * cells} cells; best fitness {archive.objective.max():.3f}", size=10)
    figure.colorbar(image, label="fitness")
    figure.savefig(file, dpi=120)


def main():
    """Draw, and take out what is asked for."""
    words = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    words.add_argument("run", type=Path)
    words.add_argument("--lamp-on", type=float, help="final x with the lamp on, m")
    words.add_argument("--lamp-off", type=float, help="final x with the lamp off, m")
    given = words.parse_args()
    archive = pd.read_csv(given.run / "archive.csv", dtype=str).astype(float)  # to the last digit
    settings = yaml.safe_load((given.run / ".hydra" / "config.yaml").read_text())
    draw(archive, settings["optimizer"]["cells"], given.run / "archive.png")
    if given.lamp_on is not None and given.lamp_off is not None:
        distance = np.hypot(archive.measures_0 - given.lamp_on, archive.measures_1 - given.lamp_off)
        chosen = archive.loc[distance.idxmin()]
        np.save(given.run / "genome.npy", chosen.filter(like="solution").to_numpy(float))
        ends = f"{chosen.measures_0:.2f} with the lamp on, {chosen.measures_1:.2f} with the lamp off"
        print(f"{given.run / 'genome.npy'}: final x {ends}, fitness {chosen.objective:.3f}")


if __name__ == "__main__":
    main()
